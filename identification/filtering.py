"""Zero-phase filtering, central differences and decimation."""

import numpy as np
from numpy.typing import NDArray
from scipy import signal
from scipy.ndimage import correlate1d

from .errors import InputError

Array = NDArray[np.float64]

ORDER = 4
# Weights of the samples from four before to four after in a first derivative.
NINE_POINTS = np.array([1 / 280, -4 / 105, 1 / 5, -4 / 5, 0.0, 4 / 5, -1 / 5, 4 / 105, -1 / 280])
# An edge transient of the forward-backward filter has died out after this many cut-off periods.
EDGE_PERIODS = 2.0
# Samples kept per cut-off period after decimation: twice the Nyquist rate of what the filter passes.
SAMPLES_PER_CUTOFF = 4.0


def zero_phase_lowpass(x: Array, sample_rate: float, cutoff: float) -> Array:
    """Low-pass along axis 0 by a 4th-order Butterworth run forward and backward; same shape.

    cutoff: Hz, where the double pass leaves half the amplitude. The gain is |H|², the phase zero.
    """
    sections = signal.butter(ORDER, cutoff, fs=sample_rate, output="sos")
    padding = min(len(x) - 1, edge_samples(sample_rate, cutoff))
    return signal.sosfiltfilt(sections, x, axis=0, padtype="odd", padlen=padding)


def noise_gain(sample_rate: float, cutoff: float, pole: float = 0.0) -> float:
    """RMS of unit-variance noise after ``zero_phase_lowpass``: the root mean of |H|⁴ S over frequency.

    pole: of first-order autoregressive noise, 0 for white; S is its spectrum, of unit mean.
    """
    sections = signal.butter(ORDER, cutoff, fs=sample_rate, output="sos")
    # A dense grid: correlated noise has its power in the lowest few bins.
    frequency, response = signal.freqz_sos(sections, worN=1 << 16, fs=sample_rate)
    shift = np.exp(-2j * np.pi * frequency / sample_rate)
    spectrum = (1 - pole**2) / np.abs(1 - pole * shift) ** 2
    return float(np.sqrt(np.sum(np.abs(response) ** 4 * spectrum) / np.sum(spectrum)))


def edge_samples(sample_rate: float, cutoff: float) -> int:
    """Samples at each end that the zero-phase filter has spoiled."""
    return int(np.ceil(EDGE_PERIODS * sample_rate / cutoff))


def decimation_step(sample_rate: float, cutoff: float) -> int:
    """Keep every so-many-th sample after low-passing at ``cutoff`` without losing what it passed."""
    return max(1, int(sample_rate / (SAMPLES_PER_CUTOFF * cutoff)))


def central_difference(x: Array, sample_rate: float) -> Array:
    """Derivative along axis 0 by central differences over nine samples, eighth order; same shape.

    Fornberg, "Generation of finite difference formulas", Math. Comp. 51(184), 1988: exact to a thousandth up
    to 0.15 of the sample rate, where two samples miss a seventh. Second order in the last four of each end.
    """
    out = np.gradient(x, 1 / sample_rate, axis=0, edge_order=2)
    reach = len(NINE_POINTS) // 2
    if len(x) >= len(NINE_POINTS):
        inner = correlate1d(x, NINE_POINTS * sample_rate, axis=0)
        out[reach:-reach] = inner[reach:-reach]
    return out


def require_cutoff(cutoff: float, sample_rate: float, samples: int) -> None:
    """Raise InputError unless the cut-off suits the sample rate and the run is long enough for it."""
    if not 0 < cutoff < 0.45 * sample_rate:
        raise InputError(
            "filter",
            "cutoff",
            f"above 0 and below 0.45 of the sample rate ({0.45 * sample_rate:g} Hz)",
            f"{cutoff:g} Hz",
        )
    needed = 4 * edge_samples(sample_rate, cutoff)
    if samples < needed:
        raise InputError(
            "log",
            "time",
            f"at least {needed / sample_rate:.3g} s for a {cutoff:g} Hz filter",
            f"{samples / sample_rate:.3g} s",
        )
