"""Limits that a design keeps: a model's own, and cautious ones where it states none."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from identification.errors import InputError

from .model_reading.limits import Limits
from .robot import Robot

Array = NDArray[np.float64]

# Where a model rates no speed: rad/s, below what arms are rated at (the slowest joints of a KUKA iiwa 14 at
# 1.3, of a Kinova Gen3 at 1.2), and m/s, the reduced speed of ISO 10218-1, at which people may be near.
CAUTIOUS_SPEED, CAUTIOUS_SLIDE = 1.0, 0.25
# 1/s, acceleration over speed where a model limits neither torque nor acceleration: half a second to speed.
CAUTIOUS_RATE = 2.0


@dataclass(frozen=True)
class DesignLimits:
    """Limits of a design, and a sentence for everything in them that the model does not state."""

    limits: Limits
    assumed: tuple[str, ...]


def design_limits(robot: Robot, velocity_limit: float | None = None) -> DesignLimits:
    """The robot's limits; what is missing filled in, as the sentences say.

    velocity_limit: rad/s (m/s) of joints without a rated speed, CAUTIOUS_SPEED and CAUTIOUS_SLIDE when None;
    a rated one stays as it is. A hinge without a range gets ± pi. A joint with neither a limit of torque
    nor of acceleration gets one of acceleration. Raises InputError for a velocity limit that is not positive.
    """
    if velocity_limit is not None and not (np.isfinite(velocity_limit) and velocity_limit > 0):
        raise InputError("limits", "velocity limit", "a speed above 0 rad/s", velocity_limit)
    limits, slide = robot.limits, robot.chain.is_slide
    said = []
    free = ~slide & ~(np.isfinite(limits.lower) & np.isfinite(limits.upper))
    if np.any(free):
        said.append(f"no range in the model: ±π for {_named(robot, free)}")
    unrated = ~np.isfinite(limits.velocity)
    speed = np.where(slide, CAUTIOUS_SLIDE, CAUTIOUS_SPEED)
    if velocity_limit is not None:
        speed = np.full(robot.joints, velocity_limit)
    for kind, unit in ((False, "rad/s"), (True, "m/s")):
        these = unrated & (slide == kind)
        if np.any(these):
            value = f"{speed[these][0]:g} {unit}"
            source = "a cautious default, --velocity-limit sets it" if velocity_limit is None else "as asked"
            said.append(f"no rated speed in the model: {value} ({source}) for {_named(robot, these)}")
    velocity = np.where(unrated, speed, limits.velocity)
    unbound = ~np.isfinite(limits.torque) & ~np.isfinite(limits.acceleration)
    if np.any(unbound):
        said.append(
            f"no torque limit in the model: acceleration up to {CAUTIOUS_RATE:g}/s times the speed"
            f" for {_named(robot, unbound)}"
        )
    filled = replace(
        limits,
        lower=np.where(free, -np.pi, limits.lower),
        upper=np.where(free, np.pi, limits.upper),
        velocity=velocity,
        acceleration=np.where(unbound, CAUTIOUS_RATE * velocity, limits.acceleration),
    )
    return DesignLimits(filled, tuple(said))


def _named(robot: Robot, which: Sequence[bool] | NDArray[np.bool_]) -> str:
    """The names of these joints, or that they are all."""
    if np.all(which):
        return "every joint"
    return ", ".join(name for name, one in zip(robot.joint_names, which, strict=True) if one)
