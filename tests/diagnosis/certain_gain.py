"""Gains of a candidate as a test wants them, on the runs of an arm without a fault."""

from dataclasses import replace

import numpy as np

from diagnosis.data.preparation import prepare
from diagnosis.fit.score import Stage
from diagnosis.model.base_regressor import BaseRegressor
from diagnosis.model.candidates import candidates
from diagnosis.model.effect_sizes import times_healthy

from ..diagnosed import simulated_runs
from ..once import once_per_robot


def squares(stage, share):
    """(joints,) what this share of each joint's torque adds up to, squared, over the held-out samples."""
    return (share * stage.base.torque_rms) ** 2 * stage.counts


def certain(stage, own, amount, squared, wald=400.0):
    """A candidate's gain, twenty deviations from zero or so, that takes so much off the held-out squares."""
    return replace(
        stage.gain(own),
        coefficients=amount * np.eye(own.count)[0],
        information=wald / amount**2 * np.eye(own.count),
        held_out=squared,
    )


def of_size(arm, stage, own, times, torque, left):
    """A certain gain, so many times a healthy joint's; its shares of its joint's torque and rest."""
    unit = np.eye(own.count)[0]
    joint = own.family.joint
    squared = squares(stage, torque) * np.eye(arm.joints)[joint]
    stage.held_squares[joint] = squared[joint] / left
    amount = times / times_healthy(arm, stage.base.torque_rms, own, unit)
    return certain(stage, own, amount, squared)


def healthy_stage(arm, name):
    """The stage of runs without a fault, and the first candidate of this effect at each joint."""
    prepared = _prepared(arm)
    every = candidates(prepared, only=[name])
    of_joints = [next(c for c in every if c.family.joint == joint) for joint in range(arm.joints)]
    return Stage.of(BaseRegressor(prepared), []), of_joints


@once_per_robot
def _prepared(arm):
    return prepare(arm, simulated_runs(arm, [], runs=2))
