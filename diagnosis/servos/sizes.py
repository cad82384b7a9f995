"""Sizes that are typical of a limb and its runs: what the sizes of effects count in."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.output_error.problem import SMALLEST
from identification.output_error.servo_run import SMOOTHING, SMOOTHING_SHARE, ServoRun
from identification.output_error.unknowns import Knowledge
from testbench.drives.effects.base import Scale

Array = NDArray[np.float64]

# Share of the position error of the loop that no law of a drive follows.
DISCREPANCY = 0.005
# Of a run, the part at either end that a low-pass distorts: one so many-th.
EDGE = 20


@dataclass(frozen=True)
class Sizes:
    """Of each joint of a limb, (n,): ``scales`` by what they are; position noise, and RMS of
    command less position, rad."""

    scales: dict[Scale, Array]
    noise: Array
    tracking: Array

    @property
    def discrepancy(self) -> Array:
        """The part of the position error (n,) rad that no law follows."""
        return np.asarray(DISCREPANCY * self.tracking)


def sizes_of(runs: Sequence[ServoRun], known: Knowledge, limit: Array) -> Sizes:
    """The sizes of a limb's runs. known: its typical torque, speed and inertia. limit: (n,) N·m as stated."""
    n = len(known.torque_scale)
    peak, fastest, errors, totals = np.zeros(n), np.zeros(n), np.zeros(n), []
    for run in runs:
        position, velocity = run.smoothed
        error = run.command - position
        torque = np.clip(run.kp * error - run.kd * velocity, -limit, limit)
        peak = np.maximum(peak, np.max(np.abs(torque), axis=0))
        speed = np.abs(np.diff(run.command, axis=0)) * run.rate
        # A step of the command is no speed.
        fastest = np.maximum(fastest, np.quantile(speed, 0.999, axis=0))
        errors += np.mean(error**2, axis=0) / len(runs)
        totals.append(np.sum(np.abs(torque), axis=1))
    total = float(np.sqrt(np.mean(np.concatenate(totals) ** 2)))
    full = np.ones(n)
    scales = {
        Scale.ONE: full,
        Scale.TORQUE: known.torque_scale,
        Scale.PEAK_TORQUE: peak + SMALLEST,
        Scale.SPEED: known.speed_scale,
        Scale.TORQUE_SLOPE: known.torque_scale / known.reach,
        Scale.DAMPING: known.torque_scale / known.speed_scale,
        Scale.SLOWNESS: 1 / (fastest + SMALLEST),
        Scale.INERTIA: known.inertia,
        Scale.PER_TOTAL: full / (total + SMALLEST),
    }
    return Sizes(scales, noise_of(runs), np.sqrt(errors))


def noise_of(runs: Sequence[ServoRun]) -> Array:
    """RMS (n,) rad of the positions' noise, by what is above the band that they are smoothed to."""
    squares, samples = np.zeros(runs[0].position.shape[1]), 0.0
    for run in runs:
        cut = len(run.position) // EDGE
        above = (run.position - run.smoothed[0])[cut : len(run.position) - cut]
        # White noise is in the whole band alike.
        share = 1 - 2 * min(SMOOTHING, SMOOTHING_SHARE * run.rate) / run.rate
        squares += np.sum(above**2, axis=0) / share
        samples += len(above)
    return np.asarray(np.sqrt(squares / samples))
