"""Runs ready for fitting: one of them filtered and decimated, and all of a robot together."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d

from identification.models import Preprocessing
from identification.springs import spring_torque
from testbench.effects.columns import Window
from testbench.effects.logged import Logged
from testbench.robot import Robot
from testbench.torque_lag import IN_TIME, TorqueLag

from .decimation import DecimatingFilter, filtered, filtered_in_parts, filtered_windows

Array = NDArray[np.float64]

# Hz, the widest band in which gaps are analysed.
CUTOFF = Preprocessing.cutoff
# Samples that a run needs, and that count of a joint that moves in it.
SMALLEST_RUN = 40
# rad/s (m/s): how slow a joint must be for its friction's sign to be unknown.
DEAD_ZONE = Preprocessing.dead_zone
# Beyond where a filter smears a wrong sign of friction little of it is left, with the other sign, but a slow
# turn lasts: samples of which more than this share may be wrong do not count.
MOST_SMEARED = 0.05


@dataclass(frozen=True)
class Run:
    """One run ready for fitting; M decimated samples, n joints, SI units at the joint.

    name: the log's. logged: full-rate signals with the model's prediction. filters: (n,) of each joint's
    torque and columns alike. kept: (M,) indices of the decimated samples. time: (M,) s. q, dq, ddq: (M, n).
    torque: (M, n), rows: a joint, (M, 14 (links - joint)) of the standard regressor, both filtered; links
    before it never load a joint. whole: (M, n) bool, away from what is made up. used: those of them that
    count, away from rest.
    smear: (n,) samples at full rate that each filter spreads what is near rest over. lost: how many samples
    of the log were held or spoiled, and are interpolated. torque_step, position_step: (n,) N·m and
    rad (m), that the log counts in.
    """

    name: str
    logged: Logged
    filters: tuple[DecimatingFilter, ...]
    kept: NDArray[np.int64]
    time: Array
    q: Array
    dq: Array
    ddq: Array
    torque: Array
    rows: tuple[Array, ...]
    whole: NDArray[np.bool_]
    used: NDArray[np.bool_]
    smear: NDArray[np.int64]
    lost: int
    torque_step: Array
    position_step: Array

    def by_model(self, parameters: Array) -> Array:
        """Filtered torque (M, n) N·m of standard parameters (14 n,)."""
        loading = self.logged.chain.loading
        return np.column_stack([rows @ parameters[loading(joint)] for joint, rows in enumerate(self.rows)])

    def away_from(self, joint: int, speed: float) -> NDArray[np.bool_]:
        """The samples (M,) not smeared with friction turning, at speeds up to this one, rad/s (m/s)."""
        return self.apart_from(np.abs(self.logged.turning[:, joint]) <= speed, joint)

    def apart_from(self, doubtful: NDArray[np.bool_], joint: int) -> NDArray[np.bool_]:
        """The samples (M,) that a joint's filter smears next to none of these (N,) into."""
        near = maximum_filter1d(doubtful, int(self.smear[joint]))[self.kept]
        own = self.filters[joint]
        spread = replace(own, taps=np.abs(own.taps))
        return ~near & (spread(doubtful[:, None].astype(np.float64))[:, 0] < MOST_SMEARED)

    def left_by(self, torque: Array) -> Array:
        """The part (M, n) N·m of the filtered torque that a model's at full rate (N, n) leaves."""
        rigid = torque - spring_torque(self.logged.chain.springs, self.logged.q)
        return self.torque - self.filtered(rigid, range(rigid.shape[1]))

    def filtered(self, columns: Array, joints: Sequence[int]) -> Array:
        """Columns (N, r, ...) of r joints at full rate, filtered and decimated like the torque."""
        return filtered([self.filters[joint] for joint in joints], columns)

    def filtered_in_parts(self, make: Callable[[slice], Array], joints: Sequence[int], count: int) -> Array:
        """The same of columns (N, r, k), k = ``count``, that are made of some samples at a time."""
        return filtered_in_parts([self.filters[joint] for joint in joints], make, self.logged.samples, count)

    def filtered_windows(self, windows: Sequence[Window], joints: Sequence[int], count: int) -> Array:
        """The same of an event's columns (N, r, k): k = ``count``, zero but in these windows."""
        filters = [self.filters[joint] for joint in joints]
        return filtered_windows(filters, windows, self.logged.samples, count)


@dataclass(frozen=True, eq=False)
class Prepared:
    """All runs, and the folds that are left out in turn.

    folds: per fold, the run's index and the samples (into its M) that belong to it. band: (n,) of the widest
    band, the share that each joint's filter leaves. encoder_torque: (n,) N·m RMS that encoders' noise
    seems to add there. thinning: one in so many is kept of the samples that hold what was passed. standing:
    pairs of joints whose shared drive stands still at times: what holds any of that does not count there.
    lag: by which the logs had their torque late; it is as of the positions here. silent: joints whose torque
    never changes, of which no sample counts. still: joints that stand still in all runs, of which nothing is
    determined.
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
    def largest_torque(self) -> Array:
        """(n,) N·m, the largest of each joint along the runs, as logged or as the model has it."""
        both = [[run.torque, run.by_model(self.nominal)] for run in self.runs]
        return np.max([np.abs(of_run).max(axis=(0, 1)) for of_run in both], axis=0)

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
        return joint is None or self.runs_with(joint, into) > 0

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


def filter_cutoff(sample_rate: float) -> float:
    """The low-pass of torque and columns at this sample rate, Hz."""
    return Preprocessing().at(sample_rate).cutoff
