"""The joints that a recording is read for: the model's, or those that the recording itself names."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.chain import Chain
from testbench.robot import Limits

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Joints:
    """Names and limits of n joints. is_slide: flags. lower, upper, torque: (n,) SI units, inf where not
    known.
    """

    names: tuple[str, ...]
    is_slide: tuple[bool, ...]
    lower: Array
    upper: Array
    torque: Array
    are_of_model: bool = False

    def some(self, chosen: Sequence[int]) -> "Joints":
        """Only the joints of these indices, in their order."""
        at = list(chosen)
        names, slides = tuple(self.names[each] for each in at), tuple(self.is_slide[each] for each in at)
        limits = (self.lower[at], self.upper[at], self.torque[at])
        return Joints(names, slides, *limits, self.are_of_model)


def joints_of(chain: Chain, limits: Limits) -> Joints:
    """The joints of a model."""
    slides = tuple(bool(slide) for slide in chain.is_slide)
    return Joints(chain.joint_names, slides, limits.lower, limits.upper, limits.torque, are_of_model=True)


def joints_named(names: Sequence[str]) -> Joints:
    """Hinges of these names, of which nothing else is known."""
    endless = np.full(len(names), np.inf)
    return Joints(tuple(names), (False,) * len(names), -endless, endless, endless)
