"""Probability that a reported effect is right: by its rivals, and by how well it explains its joint."""

from collections.abc import Sequence

import numpy as np

from testbench.effects.signature import Quantity

from ..model.effect_sizes import sizes
from .findings import Gap, NamedEffect

# How often an effect is the right one when nothing in the catalogue rivals it, counted on blind cases
# (docs/blind.md): of the first one reported, and of those after it.
NAMED = (0.98, 0.93)
# Deviations are those of a model that holds. Where so many times its noise is left at a joint, it does not
# quite, and a size within so many deviations of none may stand for what is left. Nor does one run show
# what another would.
LEFT, DEVIATIONS = 2.0, 20.0
DOUBTFUL = (0.8, 0.55)


def certainties(effects: Sequence[NamedEffect], gap: Gap, runs: int) -> tuple[float, ...]:
    """The probability, 0 to 1, of each reported effect, the likeliest first.

    effects: with their probabilities against their rivals only. gap: with all of them, by joint. runs: how
    many there are.
    """
    levels = [DOUBTFUL if runs == 1 or _is_doubtful(each, gap) else NAMED for each in effects]
    return tuple(
        each.probability * level[min(place, len(level) - 1)]
        for place, (each, level) in enumerate(zip(effects, levels, strict=True))
    )


def _is_doubtful(effect: NamedEffect, gap: Gap) -> bool:
    """Whether much is left at its joint, and little is known of its size."""
    floor = np.maximum(gap.noise_floor, np.finfo(float).tiny)
    joint = int(np.argmax(gap.parameters / floor)) if effect.joint is None else effect.joint
    known = max(_deviations(effect.parameters[name]) for name in sizes(effect.effect))
    return bool(gap.effects[joint] > LEFT * floor[joint] and known < DEVIATIONS)


def _deviations(size: Quantity) -> float:
    """How many stated deviations a size, or the largest of several, is from none."""
    value, std = np.atleast_1d(np.abs(size.value)), np.atleast_1d(size.std)
    return float(np.max(value / np.maximum(std, np.finfo(float).tiny)))
