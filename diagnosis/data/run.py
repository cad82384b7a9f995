"""One run of a robot: its log filtered and decimated, and the samples of it that count."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d

from identification.chain import Chain
from identification.differentiation import differentiate
from identification.errors import InputError
from identification.models import POSITION_BAND, Preprocessing
from identification.regressor import regressor
from identification.signals import Signals
from identification.springs import spring_torque
from testbench.effects.columns import Window
from testbench.effects.logged import Logged, body_in_link
from testbench.log import Recording
from testbench.robot import Limits, Robot

from .decimation import (
    DecimatingFilter,
    decimating_filters,
    filtered,
    filtered_in_parts,
    filtered_windows,
    parts,
)
from .mended_log import MendedLog
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
# Samples whose torque by the model is taken at once.
AT_ONCE = 1 << 12


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
        out = np.empty_like(self.torque)
        for first in range(0, len(out), AT_ONCE):
            part = slice(first, first + AT_ONCE)
            dense = np.zeros((*out[part].shape, len(parameters)))
            for joint, rows in enumerate(self.rows):
                dense[:, joint, self.logged.chain.loading(joint)] = rows[part]
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


def filter_cutoff(sample_rate: float) -> float:
    """The low-pass of torque and columns at this sample rate, Hz."""
    return Preprocessing(CUTOFF).at(sample_rate).cutoff


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
