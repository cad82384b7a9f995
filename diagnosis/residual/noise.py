"""Noise floor of the torque residual, estimated from the logs themselves.

Where the reference repeats, what differs between repetitions is noise and what repeats is misfit.
Elsewhere the spectrum of torque's noise, where it is seen alone, is continued into the band of the motion.
What the residual has more of there is encoders' noise differentiated twice, which the low-pass takes off.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from identification.band import NOISE, QUIET

from ..data.run import Run
from ..model.base_regressor import BaseRegressor

Array = NDArray[np.float64]

# Repetition is exact in a reference that a controller follows; logs may have rounded it to single precision.
REPEATS = float(np.finfo(np.float32).eps)
# Where only noise is left: above this multiple of the low-pass; so many frequencies at least.
ABOVE, FEWEST = 1.5, 8
# Hz, the lowest corner of a drive's noise, and how many are tried beside none.
CORNER, CORNERS = 5.0, 40
# s, and samples at least, of a segment: in most of them no friction turns. And the longest, of a residual.
SEGMENT, SHORTEST, LONGEST = 0.15, 64, 512
# A torque that repeats more often than this was not measured in between.
HELD = 4
# From this mean misfit of its logarithm on a density falls as no noise does: the log was low-passed before.
LOW_PASSED = 0.7


@dataclass(frozen=True)
class Noise:
    """Noise floor of each joint's torque after the parallel filter, over all runs.

    rms: (n,) N·m. seen: (n,) bool, whether it is seen apart from the motion; it is not in a log that was
    low-passed.
    """

    rms: Array
    seen: NDArray[np.bool_]


def noise(base: BaseRegressor) -> Noise:
    """Noise floor of the runs of a base regressor, from the noise of torque sensors and encoders."""
    prepared = base.prepared
    squares = [_repetition(run) for run in prepared.runs]
    known = [s for s in squares if s is not None]
    if known:
        return Noise(np.sqrt(np.mean(known, axis=0)), np.ones(prepared.joints, bool))
    found = [_quiet_band(run) for run in prepared.runs]
    of_torque = np.mean([square for square, _ in found], axis=0)
    seen = np.all([each for _, each in found], axis=0)
    # Where a low-pass has taken it off, no drive of an arm is known to better.
    least = np.where(seen, 0.0, NOISE) * base.torque_rms
    return Noise(np.maximum(np.sqrt(of_torque + prepared.encoder_torque**2), least), seen)


def _repetition(run: Run) -> Array | None:
    """Mean square of the noise (n,) from a reference that repeats; None where it does not."""
    reference = run.logged.reference_position
    if reference is None:
        return None
    period = _period(reference)
    if period is None:
        return None
    # Whole steps of the decimated grid only.
    step = run.filters[0].step
    if period % step:
        return None
    lag = period // step
    difference = run.torque[lag:] - run.torque[:-lag]
    if len(difference) < max(lag, 20):
        return None
    # Friction near rest need not repeat exactly: the median of squares is not moved by it.
    return np.median(difference**2, axis=0) / 0.4549364 / 2


def _period(reference: Array) -> int | None:
    """Samples after which a reference repeats, or None."""
    samples = len(reference)
    centred = reference - reference.mean(axis=0)
    size = float(np.abs(centred).max())
    if size == 0:
        return None
    spectrum = np.fft.rfft(centred, 2 * samples, axis=0)
    correlation = np.fft.irfft(np.sum(np.abs(spectrum) ** 2, axis=1))[: samples // 2 + 1]
    peaks, _ = signal.find_peaks(correlation / np.maximum(samples - np.arange(len(correlation)), 1))
    for peak in peaks:
        for lag in range(max(int(peak) - 2, 1), int(peak) + 3):
            if lag < samples and np.abs(reference[lag:] - reference[:-lag]).max() < REPEATS * max(size, 1.0):
                return lag
    return None


def _quiet_band(run: Run) -> tuple[Array, NDArray[np.bool_]]:
    """Mean square (n,) of the torque's noise below the cut-off, from how its spectrum falls beyond motion's.

    And whether it is seen there (n,): where the log was low-passed what the residual has stands for it.
    """
    rate, samples = run.logged.sample_rate, run.logged.samples
    short = min(max(SHORTEST, round(SEGMENT * rate)), samples)
    measured = _measured(run.logged.tau)
    frequency, torque = _density(run.logged.tau, measured, rate, short)
    _, residual = _density(run.logged.residual, measured, rate, short)
    density = np.minimum(torque, residual)
    of_each = [_continued(run, joint, frequency, own) for joint, own in enumerate(density.T)]
    found, misfit = np.array(of_each).T
    seen = (misfit <= LOW_PASSED) & (measured.sum(axis=0) >= short)
    if not seen.all():
        frequency, density = _density(run.logged.residual, measured, rate, min(LONGEST, samples))
        for joint in np.flatnonzero(~seen).tolist():
            found[joint], _ = _continued(run, joint, frequency, density[:, joint])
    # What a log counts in it has rounded, by a twelfth of the step's square.
    passed = np.array([float(np.sum(each.taps**2)) for each in run.filters])
    return np.maximum(found, run.torque_step**2 / 12 * passed), seen


def _measured(torque: Array) -> NDArray[np.bool_]:
    """The samples (N, n) that are not one value repeated more than HELD times, as held or zeroed ones are."""
    found = np.ones(torque.shape, bool)
    for joint, column in enumerate(torque.T):
        edges = np.concatenate([[0], np.flatnonzero(np.diff(column)) + 1, [len(column)]])
        lengths = np.diff(edges)
        found[:, joint] = np.repeat(lengths <= HELD, lengths)
    return found


def _density(values: Array, measured: NDArray[np.bool_], rate: float, length: int) -> tuple[Array, Array]:
    """Frequencies (F,) Hz and density (F, n), the median over segments of so many samples that were measured.

    measured: (N, n); where hardly any were, all samples count. Reversals of friction are broadband but rare,
    as seams are where samples were left out: the median is not moved by them.
    """
    # A joint at a time: all its segments are held at once.
    of_each = [signal.welch(own, rate, nperseg=length, average="median") for own in values.T]
    frequency, density = of_each[0][0], np.column_stack([own for _, own in of_each])
    for joint in np.flatnonzero(~measured.all(axis=0)).tolist():
        kept = values[measured[:, joint], joint]
        if len(kept) >= length:
            _, density[:, joint] = signal.welch(kept, rate, nperseg=length, average="median")
    return frequency, density


def _continued(run: Run, joint: int, frequency: Array, density: Array) -> tuple[float, float]:
    """The mean square that passes a joint's filter, and by how much the density's logarithm is missed.

    A first-order spectrum s / (1 + (f / f_c)²) is fitted to the logarithm of the density (F,) between the
    motion's band and the top of what was recorded, and continued downwards: noise of drives is coloured.
    """
    rate, taps = run.logged.sample_rate, run.filters[joint].taps
    seen = (frequency >= ABOVE * run.logged.cutoff / 2) & (frequency <= QUIET[1] * rate)
    if seen.sum() < FEWEST:
        return float(density[-1] * rate / 2 * np.sum(taps**2)), 0.0
    own = np.log(np.maximum(density[seen], 1e-300))
    corners = np.append(np.geomspace(CORNER, rate, CORNERS), np.inf)
    shapes = [-np.log1p((frequency[seen] / corner) ** 2) for corner in corners]
    levels = [float(np.median(own - shape)) for shape in shapes]
    misfit = [
        float(np.mean(np.abs(own - shape - level))) for shape, level in zip(shapes, levels, strict=True)
    ]
    best = int(np.argmin(misfit))
    # What the filter lets pass, on a grid that resolves its band.
    length = 1 << int(np.ceil(np.log2(4 * len(taps))))
    passed = np.abs(np.fft.rfft(taps, length)) ** 2
    continued = np.exp(levels[best]) / (1 + (np.fft.rfftfreq(length, 1 / rate) / corners[best]) ** 2)
    return float(np.sum(continued * passed) * rate / length), misfit[best]
