"""Torque in other units than the model's: a motor's before its gearbox, millinewtons, per cent of a rating.

Re-identification takes up what all joints have in common, and says that the model was wrong; a factor of one
joint is in no effect's range.
"""

from collections.abc import Mapping

import numpy as np

from testbench.robot import Robot

from .ground import ground
from .preparation import Prepared

# No model of the robot is so many times off where its torque goes with the log's by this correlation.
FACTOR, ALIKE = 5.0, 0.9
# Factors of all joints that are one, but for errors of the model.
IN_COMMON = 2.0


def foreign_scales(prepared: Prepared) -> dict[int, float]:
    """By joint, the factor of its logged torque to the model's, where no model is so far off."""
    torque = np.concatenate([run.torque for run in prepared.runs])
    model = torque - np.concatenate(ground(prepared).gap)
    both, own = np.sum(torque * model, axis=0), np.sum(model**2, axis=0)
    alike = both / np.sqrt(np.maximum(own * np.sum(torque**2, axis=0), np.finfo(float).tiny))
    factor = both / np.maximum(own, np.finfo(float).tiny)
    foreign = (alike > ALIKE) & ((factor < 1 / FACTOR) | (factor > FACTOR))
    return {joint: float(factor[joint]) for joint in np.flatnonzero(foreign).tolist()}


def in_words(robot: Robot, scales: Mapping[int, float]) -> str:
    """The factors of ``foreign_scales`` in a sentence that precedes another; empty for none."""
    if not scales:
        return ""
    factors = np.array(list(scales.values()))
    if len(scales) == robot.joints and factors.max() < IN_COMMON * factors.min():
        told = f"every joint is {np.exp(np.mean(np.log(factors))):.2g}"
    else:
        told = ", ".join(f"{robot.joint_names[joint]} is {factor:.2g}" for joint, factor in scales.items())
    return f"The torque of {told} times the model's: is it N·m (N), at the joint? "
