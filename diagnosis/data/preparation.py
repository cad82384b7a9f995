"""From logs to equations: every run filtered once, with what the given model says along it."""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d

from identification.band import joint_bands
from identification.chain import Chain
from identification.differentiation import differentiate
from identification.errors import InputError
from identification.filtering import decimation_step
from identification.models import POSITION_BAND
from identification.regressor import regressor
from identification.signals import Signals
from identification.springs import spring_torque
from testbench.effects.logged import Logged, body_in_link
from testbench.log import Recording
from testbench.robot import Limits, Robot
from testbench.torque_lag import IN_TIME, TorqueLag

from .decimation import DecimatingFilter, decimating_filters, filtered, parts
from .mended_log import MendedLog, mended_log, rate_for
from .moving_joints import is_moving
from .run import DEAD_ZONE, SMALLEST_RUN, Prepared, Run, filter_cutoff

Array = NDArray[np.float64]

# The filter smears a wrong sign over half a cut-off period to either side.
REACH_PERIODS = 0.5
# And it smears what was made up where samples are missing: between stamps this share of a cut-off period,
# and so many steps, apart.
LONGEST_STEP, STEPS = 0.15, 1.6
# So many samples are kept of what the low-pass leaves, but one in so many at least.
MOST_KEPT, THINNEST = 150_000, 3
# Where there are fewer runs, blocks of each stand in for them.
FEWEST_FOLDS = 3


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
    seconds = sum(len(each.time) / each.sample_rate for each in recordings.values())
    fast = rate_for(robot.joints, seconds)
    logs = [mended_log(name, recording, fast, lag) for name, recording in recordings.items()]
    widest = max(filter_cutoff(log.motion.sample_rate) for log in logs)
    motions, allowed = [log.motion for log in logs], min(widest, highest or widest)
    bands = joint_bands(robot.chain, robot.parameters, motions, allowed)
    thinning = _thinning(robot, logs, float(bands.cutoff.max()))
    speaks = np.any([np.ptp(log.recording.torque, axis=0) > 0 for log in logs], axis=0)
    runs = tuple(filtered_run(robot, log, bands.cutoff, thinning) for log in logs)
    runs = tuple(replace(run, used=run.used & speaks) for run in runs)
    if not any(run.used.any() for run in runs):
        expected = f"some joint faster than {DEAD_ZONE} rad/s (m/s): these logs hold no motion"
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


def filtered_run(robot: Robot, log: MendedLog, bands: Array, thinning: int) -> Run:
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
    logged = logged_along(robot.chain, robot.limits, robot.parameters, recording, signals, rate)
    body_rotation, body_origin = body_in_link(robot, robot.chain.last)
    logged = replace(logged, body_rotation=body_rotation, body_origin=body_origin)
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


def logged_along(
    chain: Chain, limits: Limits, nominal: Array, recording: Recording, signals: Signals, rate: float
) -> Logged:
    """Signals of a run at the full rate beside a model. nominal: (14 n,). rate: Hz, of the signals."""
    return Logged(
        chain=chain,
        parameters=nominal,
        nominal=nominal,
        limits=limits,
        time=recording.time[0] + np.arange(len(signals.q)) / rate,
        sample_rate=rate,
        cutoff=POSITION_BAND * filter_cutoff(rate),
        q=signals.q,
        dq=signals.dq,
        ddq=signals.ddq,
        tau=signals.tau,
        temperature=recording.temperature,
        torque_command=recording.torque_command,
        reference_position=recording.reference_position,
        reference_velocity=recording.reference_velocity,
        reference_acceleration=recording.reference_acceleration,
    )


def _regressor_rows(
    robot: Robot, signals: Signals, filters: Sequence[DecimatingFilter], kept: int
) -> tuple[Array, ...]:
    """Rows of the standard regressor, as of ``Run``, made and filtered a part at a time. kept: M."""
    moved = [robot.chain.loading(joint) for joint in range(robot.joints)]
    found = tuple(np.empty((kept, own.stop - own.start)) for own in moved)
    for decimated, part in parts(filters[0], len(signals.q)):
        rows = regressor(robot.chain, signals.q[part], signals.dq[part], signals.ddq[part])
        for joint, own in enumerate(found):
            filters[joint].into(rows[:, joint, moved[joint]], own[decimated])
    return found


def _smear(rate: float, cutoffs: Array) -> NDArray[np.int64]:
    """Samples (n,) over which the low-pass of each joint spreads what is near rest."""
    return 2 * np.round(REACH_PERIODS * rate / cutoffs).astype(int) + 1


def samples_near_rest(logged: Logged, cutoffs: Array) -> NDArray[np.bool_]:
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
