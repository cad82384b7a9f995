"""A found effect: the best of a round, its rivals, and the hypothesis with it."""

from dataclasses import dataclass

from ..fit.likelihood import Weighed
from ..fit.normal_equations import Fit
from ..model.hypothesis import Design


@dataclass(frozen=True)
class Found:
    """The effect that a search round accepts, its rivals, and the hypothesis with it and its fit."""

    best: Weighed
    rivals: tuple[tuple[Weighed, float], ...]
    trial: tuple[Design, Fit]
