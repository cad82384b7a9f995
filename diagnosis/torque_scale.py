"""Torque in other units than the model's: a motor's before its gearbox, millinewtons, per cent of a rating.

Re-identification takes up what all joints have in common, and says that the model was wrong; a factor of one
joint is in no effect's range. Peak currents for effective ones make the square root of two at every joint.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from testbench.robot import Robot

from .ground import ground
from .link_torque import LinkTorque
from .preparation import Prepared

Array = NDArray[np.float64]

# No model of the robot is so many times off where its torque goes with the log's by this correlation.
FACTOR, ALIKE = 5.0, 0.9
# Factors of all joints that are one, but for errors of the model.
IN_COMMON = 2.0
# And where they are one so nearly, at so many joints, a model is not so much too light or too heavy.
NEARLY_ONE, FEWEST, TOO_MUCH = 1.1, 3, 1.25


def foreign_scales(prepared: Prepared) -> dict[int, float]:
    """By joint, the factor of its logged torque to the model's, where no model is so far off."""
    torque = np.concatenate([run.torque for run in prepared.runs])
    links = LinkTorque(prepared)
    whole = _factors(list(torque.T), list((torque - np.concatenate(ground(prepared).gap)).T))
    # A model without friction says nothing of a joint's whole torque.
    of_links = _factors(links.projected(links.torque), links.projected(links.model(links.q)))
    found = {j: each for j, each in (of_links | whole).items() if not 1 / FACTOR < each < FACTOR}
    factors = np.array(list(of_links.values()))
    if len(factors) >= FEWEST and factors.max() < NEARLY_ONE * factors.min():
        found |= {j: each for j, each in of_links.items() if not 1 / TOO_MUCH < each < TOO_MUCH}
    return dict(sorted(found.items()))


def _factors(torque: Sequence[Array], model: Sequence[Array]) -> dict[int, float]:
    """The joints whose torque goes with the model's, by how many times that. torque, model: (M,) a joint."""
    found = {}
    for joint, (own, said) in enumerate(zip(torque, model, strict=True)):
        both, square = float(own @ said), float(said @ said)
        if both > ALIKE * np.sqrt(square * float(own @ own)) > 0:
            found[joint] = both / square
    return found


def beyond_limits(prepared: Prepared) -> dict[int, float]:
    """By joint, its RMS torque by the limit of its drive, where no drive gives so much."""
    torque = np.concatenate([run.torque for run in prepared.runs])
    limit = prepared.robot.limits.torque
    times = np.sqrt(np.mean(torque**2, axis=0)) / np.where(limit > 0, limit, np.inf)
    return {joint: float(times[joint]) for joint in np.flatnonzero(times > FACTOR).tolist()}


def in_words(robot: Robot, scales: Mapping[int, float], limits: Mapping[int, float]) -> str:
    """What ``foreign_scales`` and ``beyond_limits`` found, in what precedes a sentence; empty for nothing."""
    parts, names = [], robot.joint_names
    factors = np.array(list(scales.values()))
    if len(scales) == robot.joints and factors.max() < IN_COMMON * factors.min():
        parts.append(f"of every joint is {np.exp(np.mean(np.log(factors))):.2g} times the model's")
    elif scales:
        each = ", ".join(f"{names[joint]} is {factor:.2g}" for joint, factor in scales.items())
        parts.append(f"of {each} times the model's")
    if beyond := [f"{names[joint]} is {times:.2g}" for joint, times in limits.items() if joint not in scales]:
        parts.append(f"of {', '.join(beyond)} times what its drive can, RMS")
    return f"The torque {', '.join(parts)}: is it N·m (N), at the joint? " if parts else ""
