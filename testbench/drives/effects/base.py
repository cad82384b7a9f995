"""An effect of a drive or its joint: how it changes the simulated plant, and how large it is."""

from dataclasses import dataclass
from enum import Enum

# Before the name of an effect, where its size is an unknown beside the figures of a joint.
PREFIX = "effect "


class Scale(Enum):
    """Units of a size, at a joint and in the runs at hand."""

    ONE = "1"
    # RMS and highest torque of the drive by its law.
    TORQUE = "torque"
    PEAK_TORQUE = "peak_torque"
    # RMS speed; highest speed of the command, turned round.
    SPEED = "speed"
    # RMS torque over the deviation of the position about its middle.
    TORQUE_SLOPE = "torque_slope"
    DAMPING = "damping"
    SLOWNESS = "slowness"
    # Inertia that the joint moves, without its rotor.
    INERTIA = "inertia"
    # One over the torque that all drives give together, RMS.
    PER_TOTAL = "per_total"


@dataclass(frozen=True)
class Law:
    """One form of an effect. fixed: entries of the plant's table that it needs: column, value, its scale."""

    name: str = ""
    fixed: tuple[tuple[int, float, Scale], ...] = ()


@dataclass(frozen=True)
class DriveEffect:
    """An effect with one size.

    moves: columns of the plant's table and what one unit of the size adds to each. scale: of the size.
    healthy: size that a joint in order has, as a standard deviation. smallest, largest: of a fault; sizes
    between are equally likely in logarithm. two_sided: of either sign. whole_limb: all joints at once too, or
    (only_whole) nothing else. smooth: position changes smoothly with the size. parameter: name of what is
    reported: the entry of the first column, or one over it where ``inverse``. confused_with: effects that
    act alike along most motions. experiment: what would show it best.
    """

    name: str
    title: str
    law: str
    parameter: str
    unit: str
    moves: tuple[tuple[int, float], ...]
    scale: Scale
    healthy: float
    smallest: float
    largest: float
    experiment: str
    confused_with: tuple[str, ...] = ()
    laws: tuple[Law, ...] = (Law(),)
    two_sided: bool = False
    whole_limb: bool = False
    only_whole: bool = False
    smooth: bool = True
    inverse: bool = False
