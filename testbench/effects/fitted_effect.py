"""An effect as it was fitted to runs of a robot: how large it is there, and whether it can be one.

An effect's file may have functions of its own for it, each of a ``FittedEffect``; without them all effects
are judged alike, by their parameters' bounds and typical ranges:

    size(fitted) -> float             its size, a multiple of the mild end of its typical range
    is_plausible(fitted) -> bool      False for parameters within their bounds that no such effect has
    is_distinct(fitted) -> bool       False for what joints and encoders of healthy robots look like
    is_excessive(fitted, share) -> bool    True for more than any robot has; it is fitted but not reported
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..robot import Robot
from . import effect
from .base import EffectDescription
from .signature import Member, Quantity
from .size import typical_range

Array = NDArray[np.float64]

# Share of its joint's squared residual from which on an effect explains it, however much no gear or oil has.
ALL_BUT_ALL = 0.95


@dataclass(frozen=True)
class FittedEffect:
    """An effect as it was fitted to runs of a robot.

    description: of the effect. robot: that its size is relative to. joint: index; None for the whole robot.
    member: its shape, and its columns along the runs. coefficients: (k,) of them. values: parameters by name;
    their deviations are not used. torque: N·m (N), a typical torque of its joint. seconds: of all runs
    together. position_step: rad (m), that its joint's encoder counts in. Without a joint the last is 0, and
    the torque.
    """

    description: EffectDescription
    robot: Robot
    joint: int | None
    member: Member
    coefficients: Array
    values: Mapping[str, Quantity]
    torque: float
    seconds: float
    position_step: float

    @property
    def own_joint(self) -> int:
        """The joint of an effect that acts on one."""
        assert self.joint is not None
        return self.joint

    def value(self, name: str) -> float:
        """The largest absolute component of a parameter."""
        return float(np.max(np.abs(self.values[name].value)))

    def typical(self, name: str) -> tuple[float, float]:
        """(mild, severe) values of a parameter on this robot's joint."""
        return typical_range(self.description.parameter(name), self.robot, self.joint)

    def mild(self, name: str) -> float:
        """The mild end of a parameter's typical range; of a torque, no less than ``least_torque``."""
        mild, _ = self.typical(name)
        return max(mild, self.least_torque) if self.is_torque(name) else mild

    @property
    def least_torque(self) -> float:
        """N·m (N) that is hardly any of its joint's torque."""
        return self.description.least * self.torque

    def is_torque(self, name: str) -> bool:
        """Whether a parameter is a torque of one joint."""
        return self.joint is not None and self.description.parameter(name).unit == "N·m"


def times(value: float, mild: float) -> float:
    """A size as a multiple of a mild one; infinite where that is none."""
    return value / mild if mild > 0 else np.inf


def size(fitted: FittedEffect) -> float:
    """An effect's size as a multiple of the mild end of its typical range on this robot's joint.

    By its own file, or the largest of its size's parameters. Of those that are less where an effect is more,
    as a stiffness, the inverse.
    """
    if own := _own(fitted, "size"):
        return float(own(fitted))
    largest = 0.0
    for name in fitted.description.size_names:
        (mild, severe), value = fitted.typical(name), fitted.value(name)
        # A least torque stands for the mild end of what grows.
        grows = fitted.is_torque(name) or severe >= mild
        largest = max(largest, times(value, fitted.mild(name)) if grows else times(mild, value))
    return largest


def is_plausible(fitted: FittedEffect) -> bool:
    """Whether the effect's parameters are within their bounds, and by its own file one can have them."""
    for parameter in fitted.description.parameters:
        if parameter.name in fitted.values:
            value = np.asarray(fitted.values[parameter.name].value)
            if np.any(value < parameter.lower) or np.any(value > parameter.upper):
                return False
    own = _own(fitted, "is_plausible")
    return own is None or bool(own(fitted))


def is_distinct(fitted: FittedEffect) -> bool:
    """Whether it is by its own file none that joints and encoders of healthy robots look like."""
    own = _own(fitted, "is_distinct")
    return own is None or bool(own(fitted))


def is_excessive(fitted: FittedEffect, share: float) -> bool:
    """Whether it is by its own file more than any robot has.

    share: of its joint's squared residual that it explains.
    """
    own = _own(fitted, "is_excessive")
    return own is not None and bool(own(fitted, share))


def _own(fitted: FittedEffect, name: str) -> Any:
    """A function that its effect's file has of its own, or None."""
    return getattr(effect(fitted.description.name), name, None)
