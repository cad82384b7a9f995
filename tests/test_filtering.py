import numpy as np
import pytest

from identification.errors import InputError
from identification.filtering import central_difference, noise_gain, require_cutoff, zero_phase_lowpass
from identification.rloess import rloess

RATE = 1000.0


def test_lowpass_has_no_phase_and_the_gain_of_two_passes():
    time = np.arange(8000) / RATE
    for frequency in (2.0, 20.0, 40.0):
        # |H|² of a Butterworth filter under the bilinear transform, once a pass.
        gain = 1 / (1 + (np.tan(np.pi * frequency / RATE) / np.tan(np.pi * 20.0 / RATE)) ** 8)
        wave = np.sin(2 * np.pi * frequency * time)[:, None]
        middle = slice(2000, 6000)
        out = zero_phase_lowpass(wave, RATE, 20.0)[middle, 0]
        assert np.allclose(out, gain * wave[middle, 0], atol=1e-6)


def test_noise_gain_is_what_white_noise_keeps():
    samples = 200_000
    noise = np.random.default_rng(1).normal(size=(samples, 1))
    kept = zero_phase_lowpass(noise, RATE, 20.0).std()
    # The filtered noise has about 2 * 20 / 1000 independent samples a sample: its std has this error.
    tolerance = 4 / np.sqrt(2 * samples * 0.04)
    assert kept == pytest.approx(noise_gain(RATE, 20.0), rel=tolerance)


def test_noise_gain_of_slow_noise_is_nearly_one():
    slow = np.exp(-1 / (RATE * 1.0))
    assert 0.99 < noise_gain(RATE, 20.0, slow) <= 1.0


def test_central_difference_is_of_eighth_order_and_of_second_at_the_ends():
    inner, ends = [], []
    for rate in (50.0, 100.0):
        time = np.arange(0, 1, 1 / rate)
        difference = central_difference(np.sin(19 * time)[:, None], rate)[:, 0]
        error = np.abs(difference - 19 * np.cos(19 * time))
        inner.append(error[4:-4].max())
        ends.append(error[[0, -1]].max())
    assert inner[0] / inner[1] == pytest.approx(2**8, rel=0.1)
    assert 3 < ends[0] / ends[1] < 5


def test_central_difference_is_exact_to_a_thousandth_far_up_a_slow_log():
    rate, frequency = 125.0, 18.75
    time = np.arange(400) / rate
    speed = 2 * np.pi * frequency
    difference = central_difference(np.sin(speed * time)[:, None], rate)[4:-4, 0]
    assert np.abs(difference / speed - np.cos(speed * time[4:-4])).max() < 1.1e-3


def test_a_run_shorter_than_the_stencil_is_differentiated_all_the_same():
    assert central_difference(np.arange(5.0)[:, None], 10.0) == pytest.approx(10.0)


@pytest.mark.parametrize(("cutoff", "samples"), [(-1.0, 5000), (600.0, 5000), (20.0, 300), (np.nan, 5000)])
def test_filters_that_cannot_work_are_refused(cutoff, samples):
    with pytest.raises(InputError, match="expected"):
        require_cutoff(cutoff, RATE, samples)


def _rloess_by_polyfit(y, half):
    """The same definition written the long way: one weighted polynomial fit a sample and pass."""
    robust = np.ones(len(y))
    smooth = y
    for _ in range(6):
        smooth = np.empty(len(y))
        for k in range(len(y)):
            m = np.arange(max(0, k - half), min(len(y), k + half + 1))
            weight = (1 - (np.abs(m - k) / (half + 1)) ** 3) ** 3 * robust[m]
            keep = weight > 0
            smooth[k] = np.polyfit(m[keep] - k, y[m][keep], 2, w=np.sqrt(weight[keep]))[2]
        residual = np.abs(y - smooth)
        robust = np.clip(1 - (residual / (6 * np.median(residual))) ** 2, 0, None) ** 2
    return smooth


def test_rloess_equals_an_independent_implementation():
    rng = np.random.default_rng(2)
    y = np.sin(np.arange(300) / 20) + 0.1 * rng.normal(size=300)
    y[rng.integers(0, 300, 8)] += 3.0
    assert np.abs(rloess(y[:, None], 31)[:, 0] - _rloess_by_polyfit(y, 15)).max() < 1e-9


def test_rloess_ignores_outliers_and_keeps_a_parabola():
    t = np.linspace(-1, 1, 200)
    clean = 3 * t**2 - t
    spoiled = clean.copy()
    spoiled[[20, 100, 101, 170]] += 5.0
    assert np.abs(rloess(spoiled[:, None], 41)[:, 0] - clean).max() < 1e-6
