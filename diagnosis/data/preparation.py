"""From logs to equations: every run filtered once, with what the given model says along it."""

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d

from identification.band import joint_bands
from identification.differentiation import differentiate
from identification.errors import InputError
from identification.filtering import decimation_step
from identification.models import POSITION_BAND, Preprocessing
from identification.parameters import PER_JOINT
from identification.regressor import regressor
from identification.signals import Signals
from identification.springs import spring_torque
from testbench.effects.columns import Window
from testbench.effects.logged import Logged, body_in_link
from testbench.log import Recording
from testbench.robot import Robot
from testbench.torque_lag import IN_TIME, TorqueLag

from .decimation import (
    DecimatingFilter,
    decimating_filters,
    filtered,
    filtered_in_parts,
    filtered_windows,
    parts,
)
from .mended_log import MendedLog, fastest, mended_log
from .moving_joints import is_moving

Array = NDArray[np.float64]

# The widest band in which gaps are analysed; how slow a joint must be for its friction's sign to be unknown.
CUTOFF = 20.0
DEAD_ZONE = 0.02
# The filter smears a wrong sign over half a cut-off period to either side. Beyond that little of it is left,
# with the other sign, but a slow turn lasts: samples of which more than this share may be wrong do not count.
REACH_PERIODS, MOST_SMEARED = 0.5, 0.05
SMALLEST_RUN = 40
# And it smears what was made up where samples are missing: between stamps this share of a cut-off period,
# and so many steps, apart.
LONGEST_STEP, STEPS = 0.15, 1.6
# So many samples are kept of what the low-pass leaves, but one in so many at least.
MOST_KEPT, THINNEST = 150_000, 3
# Samples whose torque by the model is taken at once.
AT_ONCE = 1 << 12
# Where there are fewer runs, blocks of each stand in for them.
FEWEST_FOLDS = 3


@dataclass(frozen=True)
class Run:
    """One run ready for fitting; M decimated samples, n joints, SI units at the joint.

    name: the log's. logged: full-rate signals with the model's prediction. filters: (n,) of each joint's
    torque and columns alike. kept: (M,) indices of the decimated samples. time: (M,) s. q, dq, ddq: (M, n).
    torque: (M, n), rows: a joint, (M, 14 (n - joint)) of the standard regressor, both filtered; links before
    it never load a joint. whole: (M, n) bool, away from what is made up. used: those of them that count, away
    from rest.
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
        out = np.empty_like(self.torque)
        for first in range(0, len(out), AT_ONCE):
            part = slice(first, first + AT_ONCE)
            dense = np.zeros((*out[part].shape, len(parameters)))
            for joint, rows in enumerate(self.rows):
                dense[:, joint, -rows.shape[1] :] = rows[part]
            out[part] = dense @ parameters
        return out

    def away_from(self, joint: int, speed: float) -> NDArray[np.bool_]:
        """The samples (M,) not smeared with friction turning, at speeds up to this one, rad/s (m/s)."""
        return self.apart_from(np.abs(self.logged.turning[:, joint]) <= speed, joint)

    def apart_from(self, doubtful: NDArray[np.bool_], joint: int) -> NDArray[np.bool_]:
        """The samples (M,) that a joint's filter smears next to none of these (N,) into."""
        near = maximum_filter1d(doubtful, int(self.smear[joint]))[self.kept]
        own = self.filters[joint]
        spread = replace(own, taps=np.abs(own.taps))
        return ~near & (spread(doubtful[:, None].astype(np.float64))[:, 0] < MOST_SMEARED)

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
    seems to add there. thinning: one in so many is kept of the samples that hold what was passed. held:
    joints that bristles hold, so that their samples near rest count, too. standing: pairs of joints whose
    shared drive stands still at times: what holds any of that does not count there. lag: by which the logs
    had their torque late; it is as of the positions here. silent: joints whose torque never changes, of which
    no sample counts. still: joints that stand still in all runs, which tell nothing of them.
    """

    robot: Robot
    runs: tuple[Run, ...]
    band: Array
    encoder_torque: Array
    folds: tuple[tuple[int, slice], ...]
    thinning: int
    held: frozenset[int] = frozenset()
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


def filter_cutoff(sample_rate: float) -> float:
    """The low-pass of torque and columns at this sample rate, Hz."""
    return Preprocessing(CUTOFF).at(sample_rate).cutoff


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
    runs = tuple(_run(robot, log, bands.cutoff, thinning) for log in logs)
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


def _run(robot: Robot, log: MendedLog, bands: Array, thinning: int) -> Run:
    """One run filtered. bands: (n,) Hz. thinning: as of ``Prepared``."""
    recording, rate = log.recording, log.motion.sample_rate
    cutoff = filter_cutoff(rate)
    try:
        signals = differentiate(log.motion, "butterworth_central", POSITION_BAND * cutoff)
    except InputError as error:
        raise error.located(log.name) from None
    samples = len(signals.q)
    cutoffs = np.minimum(bands, cutoff)
    filters = decimating_filters(rate, cutoffs, thinning)
    kept = filters[0].kept(samples)
    if len(kept) < SMALLEST_RUN:
        needed = 2 * filters[0].reach + SMALLEST_RUN * filters[0].step
        lowest = float(cutoffs.min())
        raise InputError(log.name, "time", f"at least {needed} samples for a {lowest:.3g} Hz filter", samples)
    logged = _logged(robot, recording, signals, rate, POSITION_BAND * cutoff)
    run = Run(
        name=log.name,
        logged=logged,
        filters=filters,
        kept=kept,
        time=kept / rate,
        q=signals.q[kept],
        dq=signals.dq[kept],
        ddq=signals.ddq[kept],
        torque=filtered(filters, signals.tau - spring_torque(robot.chain.springs, signals.q)),
        rows=_regressor_rows(robot, signals, filters, len(kept)),
        whole=np.ones((len(kept), robot.joints), bool),
        used=np.ones((len(kept), robot.joints), bool),
        smear=_smear(rate, cutoffs),
        lost=log.lost,
        torque_step=log.torque_step,
        position_step=log.position_step,
    )
    # A reader faster than the robot holds every sample, and loses none by it.
    step = max(1 / rate, float(np.median(np.diff(log.stamps))))
    made_up = _between(log.stamps, logged.time, max(LONGEST_STEP / cutoff, STEPS * step))
    whole = np.column_stack([run.apart_from(made_up, j) for j in range(robot.joints)])
    used = np.column_stack([run.away_from(j, DEAD_ZONE) for j in range(robot.joints)])
    return replace(run, whole=whole, used=whole & used & is_moving(log.motion, run.q, log.position_step))


def _logged(robot: Robot, recording: Recording, signals: Signals, rate: float, cutoff: float) -> Logged:
    """Signals of a run at the full rate beside its model. cutoff: Hz, of the positions."""
    body_rotation, body_origin = body_in_link(robot, robot.joints - 1)
    return Logged(
        chain=robot.chain,
        parameters=robot.parameters,
        nominal=robot.parameters,
        limits=robot.limits,
        time=recording.time[0] + np.arange(len(signals.q)) / rate,
        sample_rate=rate,
        cutoff=cutoff,
        q=signals.q,
        dq=signals.dq,
        ddq=signals.ddq,
        tau=signals.tau,
        temperature=recording.temperature,
        torque_command=recording.torque_command,
        reference_position=recording.reference_position,
        reference_velocity=recording.reference_velocity,
        reference_acceleration=recording.reference_acceleration,
        body_rotation=body_rotation,
        body_origin=body_origin,
    )


def _regressor_rows(
    robot: Robot, signals: Signals, filters: Sequence[DecimatingFilter], kept: int
) -> tuple[Array, ...]:
    """Rows of the standard regressor, as of ``Run``, made and filtered a part at a time. kept: M."""
    count = PER_JOINT * robot.joints
    found = tuple(np.empty((kept, count - PER_JOINT * joint)) for joint in range(robot.joints))
    for decimated, part in parts(filters[0], len(signals.q)):
        rows = regressor(robot.chain, signals.q[part], signals.dq[part], signals.ddq[part])
        for joint, own in enumerate(found):
            filters[joint].into(rows[:, joint, PER_JOINT * joint :], own[decimated])
    return found


def _smear(rate: float, cutoffs: Array) -> NDArray[np.int64]:
    """Samples (n,) over which the low-pass of each joint spreads what is near rest."""
    return 2 * np.round(REACH_PERIODS * rate / cutoffs).astype(int) + 1


def near_rest(logged: Logged, cutoffs: Array) -> NDArray[np.bool_]:
    """The samples (N, n) near rest, as far as a low-pass of these corners (n,) Hz spreads them."""
    slow = np.abs(logged.turning) <= DEAD_ZONE
    columns = zip(slow.T, _smear(logged.sample_rate, cutoffs).tolist(), strict=True)
    return np.column_stack([maximum_filter1d(each, samples) for each, samples in columns])


def _between(stamps: Array, time: Array, longest: float) -> NDArray[np.bool_]:
    """The instants (N,) s that lie between stamps (S,) s further apart than the longest step, s."""
    late = np.flatnonzero(np.diff(stamps) > longest)
    found = np.zeros(len(time), bool)
    for first, last in zip(stamps[late], stamps[late + 1], strict=True):
        found |= (time > first) & (time < last)
    return found
