"""From logs to equations: every run filtered once, with what the given model says along it."""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.band import joint_bands
from identification.errors import InputError
from identification.filtering import decimation_step
from testbench.log import Recording
from testbench.robot import Robot
from testbench.torque_lag import IN_TIME, TorqueLag

from .mended_log import MendedLog, fastest, mended_log
from .run import DEAD_ZONE, SMALLEST_RUN, Run, filter_cutoff, filtered_run

Array = NDArray[np.float64]

# So many samples are kept of what the low-pass leaves, but one in so many at least.
MOST_KEPT, THINNEST = 150_000, 3
# Where there are fewer runs, blocks of each stand in for them.
FEWEST_FOLDS = 3


@dataclass(frozen=True, eq=False)
class Prepared:
    """All runs, and the folds that are left out in turn.

    folds: per fold, the run's index and the samples (into its M) that belong to it. band: (n,) of the widest
    band, the share that each joint's filter leaves. encoder_torque: (n,) N·m RMS that encoders' noise
    seems to add there. thinning: one in so many is kept of the samples that hold what was passed. standing:
    pairs of joints whose shared drive stands still at times: what holds any of that does not count there.
    lag: by which the logs had their torque late; it is as of the positions here. silent: joints whose torque
    never changes, of which no sample counts. still: joints that stand still in all runs, which tell nothing
    of them.
    """

    robot: Robot
    runs: tuple[Run, ...]
    band: Array
    encoder_torque: Array
    folds: tuple[tuple[int, slice], ...]
    thinning: int
    standing: frozenset[tuple[int, int]] = frozenset()
    lag: TorqueLag = IN_TIME
    silent: frozenset[int] = frozenset()
    still: frozenset[int] = frozenset()

    @property
    def joints(self) -> int:
        """Number of joints."""
        return self.robot.joints

    @property
    def cutoff(self) -> Array:
        """(n,) Hz, each joint's low-pass."""
        return self.band * max(filter_cutoff(run.logged.sample_rate) for run in self.runs)

    @cached_property
    def moved(self) -> NDArray[np.bool_]:
        """Which joints move in each run, (R, n)."""
        return np.array([run.used.sum(axis=0) >= SMALLEST_RUN for run in self.runs])

    @property
    def moved_alone(self) -> NDArray[np.bool_]:
        """Which joints move in one run and in no other, (R, n), at that run."""
        return np.asarray(self.moved & (self.moved.sum(axis=0) == 1))

    @property
    def by_itself(self) -> NDArray[np.bool_]:
        """Which joints (n,) of several only ever move while all others stand still."""
        together = self.moved & (self.moved.sum(axis=1, keepdims=True) > 1)
        return np.asarray((self.joints > 1) & self.moved.any(axis=0) & ~together.any(axis=0))

    def runs_with(self, joint: int | None, into: int | None = None) -> int:
        """The number of runs in which a joint moves, both of a pair; for the robot, its most moved joint."""
        if joint is None:
            return int(self.moved.sum(axis=0).max())
        return int(np.all(self.moved[:, [joint] if into is None else [joint, into]], axis=1).sum())

    def moves(self, joint: int | None, into: int | None = None) -> bool:
        """Whether a joint moves in some run, both of a pair in the same one; the robot does."""
        needed = [each for each in (joint, into) if each is not None]
        return bool(np.any(np.all(self.moved[:, needed], axis=1)))

    @property
    def sample_time(self) -> float:
        """Seconds between samples, of the run that has the fewest."""
        return 1 / min(run.logged.sample_rate for run in self.runs)

    @property
    def coulomb_smoothing(self) -> Array:
        """(n,) rad/s (m/s), w of Coulomb friction fc tanh(v / w), alike in all runs; 0 for fc sgn v."""
        smoothing = self.runs[0].logged.coulomb_smoothing
        return np.zeros(self.joints) if smoothing is None else smoothing

    @property
    def coulomb_lead(self) -> float:
        """Seconds by which Coulomb friction changes sign ahead of the joints, alike in all runs."""
        return self.runs[0].logged.coulomb_lead

    @property
    def zeros(self) -> Array:
        """(n,) rad, by which joints are known to read too much, alike in all runs."""
        known = self.runs[0].logged.zeros
        return np.zeros(self.joints) if known is None else known

    @property
    def torque_step(self) -> Array:
        """(n,) N·m, in which the coarsest log counts."""
        return np.max([run.torque_step for run in self.runs], axis=0)

    @property
    def position_step(self) -> Array:
        """(n,) rad (m), in which the coarsest log counts."""
        return np.max([run.position_step for run in self.runs], axis=0)

    def evenly(self, most: int) -> int:
        """One in how many of the runs' samples makes so many at most, evenly spread over all."""
        return -(-sum(len(run.time) for run in self.runs) // most)

    def thinned(self, every: int, *names: str) -> list[Any]:
        """One in so many samples of some of the runs' arrays, one run after the other."""
        return [np.concatenate([getattr(run, name)[::every] for run in self.runs]) for name in names]

    @property
    def nominal(self) -> Array:
        """(14 n,) standard parameters of the model as given."""
        return self.robot.parameters

    def linearised_at(
        self, parameters: Array, carried: Sequence[Array], beside: Sequence[Array], zeros: Array
    ) -> "Prepared":
        """The same runs with the effects linearised about other standard parameters (14 n,) and zeros (n,).

        carried, beside: a run's torque (N, n) N·m of effects that are known already, as of Logged.
        """
        runs = []
        for run, behind, known in zip(self.runs, carried, beside, strict=True):
            at = replace(run.logged, parameters=parameters, carried=behind, beside=known, zeros=zeros)
            runs.append(replace(run, logged=at))
        return replace(self, runs=tuple(runs))


def prepare(
    robot: Robot,
    recordings: Mapping[str, Recording],
    lag: TorqueLag = IN_TIME,
    highest: float | None = None,
) -> Prepared:
    """Filter every run and write its equations.

    lag: by which the recordings have their torque late. highest: Hz, no joint's band is wider; None for what
    the encoders leave. Raises InputError for runs that are too short, or all at rest.
    """
    if not recordings:
        raise InputError("diagnose", "logs", "at least one", 0)
    fast = fastest(robot.joints, list(recordings.values()))
    logs = [mended_log(name, recording, fast, lag) for name, recording in recordings.items()]
    widest = max(filter_cutoff(log.motion.sample_rate) for log in logs)
    motions, allowed = [log.motion for log in logs], min(widest, highest or widest)
    bands = joint_bands(robot.chain, robot.parameters, motions, allowed)
    thinning = _thinning(robot, logs, float(bands.cutoff.max()))
    speaks = np.any([np.ptp(log.recording.torque, axis=0) > 0 for log in logs], axis=0)
    runs = tuple(filtered_run(robot, log, bands.cutoff, thinning) for log in logs)
    runs = tuple(replace(run, used=run.used & speaks) for run in runs)
    if not any(run.used.any() for run in runs):
        expected = f"some joint faster than {DEAD_ZONE} rad/s (m/s): these logs cannot tell"
        raise InputError("logs", "joint/position", expected, "all at rest, or too short a move")
    each = -(-FEWEST_FOLDS // len(runs))
    folds = tuple((index, part) for index, run in enumerate(runs) for part in blocks(len(run.time), each))
    silent = frozenset(np.flatnonzero(~speaks).tolist())
    moved = np.sum([run.used.sum(axis=0) for run in runs], axis=0) >= SMALLEST_RUN
    still = frozenset(np.flatnonzero(~moved).tolist()) - silent
    share = bands.cutoff / widest
    return Prepared(
        robot, runs, share, bands.encoder_torque, folds, thinning, lag=lag, silent=silent, still=still
    )


def blocks(samples: int, count: int) -> list[slice]:
    """So many parts of a run, of equal length."""
    edges = np.linspace(0, samples, count + 1).astype(int).tolist()
    return [slice(*pair) for pair in itertools.pairwise(edges)]


def _thinning(robot: Robot, logs: Sequence[MendedLog], band: float) -> int:
    """One in how many samples is kept of these logs, low-passed at so many Hz."""
    rates = [log.motion.sample_rate for log in logs]
    lengths = [len(log.recording.time) for log in logs]
    kept = sum(n / decimation_step(rate, band) for n, rate in zip(lengths, rates, strict=True))
    return thinned_by(robot.joints, kept)


def thinned_by(joints: int, kept: float) -> int:
    """One in how many samples is kept, where the low-pass leaves so many of all runs."""
    return int(np.clip(np.ceil(kept * joints / MOST_KEPT), 1, THINNEST))
