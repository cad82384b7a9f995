"""What sensor noise alone leaves of a torque residual, from the logs themselves.

Where the reference repeats, what differs between repetitions is noise and what repeats is misfit.
Elsewhere the spectrum of the noise, where it is seen alone, is continued into the band of the motion.
"""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from .preparation import Prepared, Run

Array = NDArray[np.float64]

# Repetition is exact in a reference that a controller follows; logs may have rounded it.
REPEATS = 1e-9
# Where only noise is left: above this multiple of the low-pass, below this share of the sample rate.
QUIET, HIGHEST, FEWEST = 1.5, 0.45, 8
# Hz, the lowest corner of a drive's noise, and how many are tried.
CORNER, CORNERS = 5.0, 40


@lru_cache(maxsize=2)
def noise_rms(prepared: Prepared) -> Array:
    """RMS (n,) N·m that noise leaves after the parallel filter, over all runs."""
    squares = [_repetition(run) for run in prepared.runs]
    known = [s for s in squares if s is not None]
    chosen = known if known else [_quiet_band(run) for run in prepared.runs]
    return np.sqrt(np.mean(chosen, axis=0))


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
    if len(difference) < 2 * lag // 2 or len(difference) < 20:
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


def _quiet_band(run: Run) -> Array:
    """Mean square (n,) of the noise below the cut-off, from how the residual's spectrum falls beyond it.

    A first-order spectrum s / (1 + (f / f_c)²) is fitted to the logarithm of the density between the motion's
    band and the top of what was recorded, and continued downwards: sensor noise of drives is coloured.
    """
    rate, band_top = run.logged.sample_rate, run.logged.cutoff / 2
    # Reversals of friction are broadband but rare: the median over segments is not moved by them.
    length = min(512, len(run.logged.residual))
    frequency, density = signal.welch(run.logged.residual, rate, nperseg=length, axis=0, average="median")
    seen = (frequency >= QUIET * band_top) & (frequency <= HIGHEST * rate)
    if seen.sum() < FEWEST:
        return density[-1] * rate / 2 * np.array([np.sum(each.taps**2) for each in run.filters])
    step = frequency[1] - frequency[0]
    found = np.empty(density.shape[1])
    for joint, own in enumerate(np.log(np.maximum(density[seen], 1e-300)).T):
        shapes = [-np.log1p((frequency / corner) ** 2) for corner in np.geomspace(CORNER, rate, CORNERS)]
        levels = [np.median(own - shape[seen]) for shape in shapes]
        misfit = [
            np.sum(np.abs(own - shape[seen] - level)) for shape, level in zip(shapes, levels, strict=True)
        ]
        best = int(np.argmin(misfit))
        # What the filter lets pass of a density at each frequency.
        passed = np.abs(np.fft.rfft(run.filters[joint].taps, 2 * (len(frequency) - 1))) ** 2
        found[joint] = np.sum(np.exp(levels[best] + shapes[best]) * passed) * step
    return found
