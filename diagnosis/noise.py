"""What sensor noise alone leaves of a torque residual, from the logs themselves.

Where the reference repeats, what differs between repetitions is noise and what repeats is misfit.
Elsewhere the noise is taken as white below the band in which it is seen alone, which is a lower bound.
"""

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from .preparation import Prepared, Run

Array = NDArray[np.float64]

# Repetition is exact in a reference that a controller follows; logs may have rounded it.
REPEATS = 1e-9
# The band in which only noise is left, in multiples of the low-pass.
QUIET_BAND = (3.0, 8.0)


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
    step = run.filter.step
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
    """Mean square (n,) of white noise as dense as the torque's spectrum is in the quiet band."""
    rate = run.logged.sample_rate
    band_top = run.logged.cutoff / 2
    low, high = (min(m * band_top, share * rate) for m, share in zip(QUIET_BAND, (0.3, 0.45), strict=True))
    frequency, density = signal.welch(run.logged.tau, rate, nperseg=min(1024, len(run.logged.tau)), axis=0)
    quiet = (frequency >= low) & (frequency <= high)
    level = np.median(density[quiet], axis=0) if quiet.any() else density[-1]
    # Noise of this density, through the taps: variance = density * rate / 2 * sum taps².
    return level * rate / 2 * float(np.sum(run.filter.taps**2))
