"""Every method against the response that its theory states, on sinusoids, noise and polynomials."""

import numpy as np
import pytest
from scipy import signal

from identification.differentiation import differentiate, differentiation_methods
from identification.differentiation.kalman_smoother import steady_state_gains
from identification.differentiation.observer import pole_speed
from identification.errors import InputError
from identification.integrator_chain import initial_state, process_noise, transition
from identification.signals import Motion

RATE, CUTOFF = 1000.0, 20.0
METHODS = sorted(differentiation_methods())
LINEAR = [name for name in METHODS if name != "rloess"]
ZERO_PHASE = [name for name in METHODS if name not in ("lowpass_causal", "observer")]


def run(method, position, rate=RATE, cutoff=CUTOFF):
    position = position.reshape(len(position), -1)
    return differentiate(Motion(position, np.ones_like(position), rate), method, cutoff)


def butterworth_squared(frequency, rate, cutoff):
    """|H|² of the order-4 Butterworth filter under the bilinear transform."""
    return 1 / (1 + (np.tan(np.pi * frequency / rate) / np.tan(np.pi * cutoff / rate)) ** 8)


def difference(frequency, rate):
    """Response of the central difference over nine samples: 2 j / T times the sum of its weights' sines."""
    angle = 2 * np.pi * frequency / rate
    weights = {1: 4 / 5, 2: -1 / 5, 3: 4 / 105, 4: -1 / 280}
    return 2j * rate * sum(weight * np.sin(k * angle) for k, weight in weights.items())


def response(method, frequency, rate=RATE, cutoff=CUTOFF):
    """Theoretical complex response (3, F) from measured position to q, dq, ddq."""
    frequency = np.asarray(frequency, dtype=float)
    z = np.exp(2j * np.pi * frequency / rate)
    if method in ("butterworth_central", "bandpass_central", "lowpass_causal"):
        if method == "lowpass_causal":
            low = signal.freqz(*signal.butter(4, cutoff, fs=rate), worN=frequency, fs=rate)[1]
        else:
            low = butterworth_squared(frequency, rate, cutoff)
        d = difference(frequency, rate)
        edge = 0.01 if method == "bandpass_central" else 0.0
        high = 1 / (1 + (edge / frequency) ** 4)
        return np.array([low, d * low * high, d**2 * low * high])
    if method == "kalman_smoother":
        # The steady-state smoother is the Wiener filter: Phi_x,q / (Phi_q,q + R).
        speed = 2 * np.pi * cutoff
        step = speed / rate
        out = []
        for point in z:
            to_state = np.linalg.inv(point * np.eye(4) - transition(4, step))
            spectrum = to_state @ process_noise(4, step) @ to_state.conj().T
            out.append(spectrum[:3, 0] / (spectrum[0, 0] + 1 / step) * speed ** np.arange(3))
        return np.array(out).T
    if method == "observer":
        # Three real poles at p seen from outside: w³ / (s + w)³ of the true acceleration, s = ln z rate.
        p = np.exp(-pole_speed(cutoff) / rate)
        gain = np.array([1 - p**3, 1.5 * (1 - p) ** 2 * (1 + p) * rate, (1 - p) ** 3 * rate**2])
        forward = transition(3, 1 / rate)
        closed = forward - np.outer(gain, forward[0])
        return np.array([np.linalg.solve(np.eye(3) - closed / point, gain) for point in z]).T
    half = round((1.936 * rate / cutoff - 1) / 2)
    offsets = np.arange(-half, half + 1)
    rows = np.linalg.pinv((offsets / rate)[:, None] ** np.arange(5.0))[:3]
    rows = rows * np.array([1, 1, 2])[:, None]
    return rows @ np.exp(2j * np.pi * np.outer(offsets, frequency) / rate)


@pytest.mark.parametrize("method", LINEAR)
def test_sinusoids_come_out_with_the_amplitude_and_phase_of_theory(method):
    time = np.arange(8000) / RATE
    frequency = np.array([0.5, 5.0, 15.0, 20.0, 40.0])
    wave = np.exp(2j * np.pi * np.outer(time, frequency))
    parts = [run(method, wave.real), run(method, wave.imag)]
    middle = slice(2000, 6000)
    for order, name in enumerate(("q", "dq", "ddq")):
        out = getattr(parts[0], name) + 1j * getattr(parts[1], name)
        measured = np.mean(out[middle] / wave[middle], axis=0)
        expected = response(method, frequency)[order]
        # A run of few slow periods carries end effects of the band-pass's lower edge: (0.01 / 0.5)².
        tolerance = 5e-4 if method == "bandpass_central" else 1e-6
        scale = (2 * np.pi * frequency) ** order
        assert np.abs(measured - expected).max() / scale.max() < tolerance
        assert np.all(np.abs(measured - expected) / scale < 10 * tolerance)


@pytest.mark.parametrize("method", ZERO_PHASE)
def test_slow_motion_passes_undelayed(method):
    time = np.arange(8000) / RATE
    speed = 2 * np.pi * 1.0
    out = run(method, np.sin(speed * time) + 0.7)
    # RLOESS takes what is left of an edge transient in a noiseless run for outliers.
    kept = slice(500, len(time) - 500)
    # The filters' gain is low by (1 / 20)⁶ at most.
    assert np.abs(out.q[kept, 0] - 0.7 - np.sin(speed * time[kept])).max() < 1e-4
    assert np.abs(out.dq[kept, 0] / speed - np.cos(speed * time[kept])).max() < 1e-3
    assert np.abs(out.ddq[kept, 0] / speed**2 + np.sin(speed * time[kept])).max() < 3e-3


@pytest.mark.parametrize(
    ("method", "delay"),
    # Butterworth's group delay at rest is the sum of its 1 / pole; the triple pole's is 3 / w.
    [("lowpass_causal", 2.613 / (2 * np.pi * CUTOFF)), ("observer", 3 / pole_speed(CUTOFF))],
)
def test_causal_methods_delay_the_acceleration_and_not_the_torque(method, delay):
    time = np.arange(8000) / RATE
    speed = 2 * np.pi * 0.5
    out = run(method, np.sin(speed * time))
    kept = slice(1000, 7000)
    late = np.angle(np.mean(out.ddq[kept, 0] * np.exp(-1j * speed * time[kept])) / -(0.5 / 1j)) / -speed
    assert late == pytest.approx(delay, rel=0.05)
    assert np.array_equal(out.tau, np.ones((8000, 1)))


@pytest.mark.parametrize("method", LINEAR)
def test_white_noise_is_amplified_as_theory_says(method):
    samples, rate = 60_000, 1000.0
    noise = np.random.default_rng(3).normal(size=(samples, 2))
    out = run(method, noise)
    frequency = np.linspace(0.5, 499.5, 1000)
    kept = slice(out.trim, samples - out.trim)
    # About 2 cutoff / rate independent samples a sample: the deviation is known to this.
    tolerance = 4 / np.sqrt(2 * 2 * samples * 2 * CUTOFF / rate)
    for order, name in enumerate(("q", "dq", "ddq")):
        expected = np.sqrt(np.mean(np.abs(response(method, frequency)[order]) ** 2))
        assert getattr(out, name)[kept].std() == pytest.approx(expected, rel=tolerance)


def test_rloess_smooths_the_acceleration_alone():
    noise = np.random.default_rng(4).normal(size=(6000, 1))
    plain, robust = run("butterworth_central", noise), run("rloess", noise)
    kept = slice(plain.trim, 6000 - plain.trim)
    assert robust.ddq[kept].std() < plain.ddq[kept].std()
    assert np.array_equal(robust.q, plain.q)
    assert np.array_equal(robust.dq, plain.dq)


@pytest.mark.parametrize(
    ("method", "degree"),
    [
        ("butterworth_central", 2),
        ("rloess", 2),
        ("savitzky_golay", 4),
        ("kalman_smoother", 3),
        ("observer", 2),
    ],
)
def test_polynomials_are_differentiated_exactly(method, degree):
    time = np.linspace(-1, 1, 2001)
    polynomial = np.polynomial.Polynomial([0.3, -1.0, 2.0, -1.5, 0.8][: degree + 1])
    out = run(method, polynomial(time))
    # A low-pass continues a parabola bent the other way: that dies out at 0.38 * 2 pi cutoff.
    margin = 700 if method in ("butterworth_central", "rloess") else out.trim
    kept = slice(margin, len(time) - margin)
    # Rounding of positions near 1, differentiated twice.
    tolerance = 100 * np.finfo(float).eps * RATE**2 * 50
    for name, exact in (("q", polynomial), ("dq", polynomial.deriv()), ("ddq", polynomial.deriv(2))):
        assert np.abs(getattr(out, name)[kept, 0] - exact(time[kept])).max() < tolerance


def test_observer_that_starts_wrong_forgets_it():
    time = np.arange(2000) / RATE
    position = 0.5 * time**2
    position[:50] += 0.3
    out = run("observer", position)
    # (1 + w t + (w t)²/2) exp(-w t) of the start is left after t.
    assert np.abs(out.ddq[400:] - 1.0).max() < 1e-6


def test_bandpass_costs_a_run_that_rests_at_its_ends_next_to_nothing():
    time = np.arange(10_001) / RATE
    speed = 2 * np.pi * 0.1
    out = run("bandpass_central", 0.4 - np.cos(speed * time))
    kept = slice(out.trim, len(time) - out.trim)
    # (edge / f)⁴ of the velocity, its mirror image being the same wave.
    lost = np.abs(out.dq[kept, 0] / speed - np.sin(speed * time[kept])).max()
    assert lost == pytest.approx(0.1**4, rel=0.05)


def test_bandpass_keeps_the_posture_and_drops_drift():
    rate, samples = 50.0, 60_000
    time = np.arange(samples) / rate
    motion = 0.5 * np.sin(2 * np.pi * 0.2 * time)
    drift = 0.4 * np.sin(2 * np.pi * 0.002 * time)
    out = run("bandpass_central", 1.0 + drift + motion, rate, 5.0)
    middle = slice(20_000, 40_000)
    assert np.abs(out.q[middle, 0] - (1.0 + drift + motion)[middle]).max() < 1e-6
    # Of the drift's velocity (0.002 / 0.01)⁴ is left.
    clean = run("bandpass_central", motion, rate, 5.0)
    left = np.abs(out.dq - clean.dq)[middle].max()
    assert left == pytest.approx(0.2**4 * 0.4 * 2 * np.pi * 0.002, rel=0.05)


@pytest.mark.parametrize("step", [1.5, 0.25, 0.01, 0.0025])
def test_smoother_gains_hold_the_riccati_equation(step):
    gain, _ = steady_state_gains(step)
    forward = transition(4, step)
    closed = forward - np.outer(gain, forward[0])
    poles = np.log(np.linalg.eigvals(closed).astype(complex)) / step
    # In continuous time they are Butterworth's poles of order 4, on the unit circle.
    assert np.allclose(np.abs(poles), 1.0, atol=0.02 * step**2 + 1e-6)


def test_initial_state_is_that_of_the_polynomial():
    time = np.arange(1, 101) * 0.01
    position = np.column_stack([1 + 2 * time - 3 * time**2, 0.5 - time])
    assert np.allclose(initial_state(position, 3, 0.01, 40), [[1, 2, -6], [0.5, -1, 0]], atol=1e-9)


@pytest.mark.parametrize("method", METHODS)
def test_columns_are_independent_and_units_drop_out(method):
    rng = np.random.default_rng(5)
    time = np.arange(3000) / RATE
    position = np.column_stack([np.sin(3 * time), np.cos(5 * time) + time])
    position += 1e-4 * rng.normal(size=position.shape)
    both = run(method, position)
    # A slide joint in mm.
    alone = run(method, 1000.0 * position[:, 1])
    for name in ("q", "dq", "ddq"):
        values = getattr(both, name)
        assert values.shape == (3000, 2)
        assert np.all(np.isfinite(values))
        one = 1e-3 * getattr(alone, name)[:, 0]
        assert np.abs(one - values[:, 1]).max() < 1e-6 * np.abs(values).max()
    assert both.sample_rate == RATE
    assert 0 < both.trim < 1000


@pytest.mark.parametrize("method", METHODS)
def test_any_usable_cutoff_works_and_others_are_refused(method):
    position = np.sin(np.arange(4000) / 50.0)
    for cutoff in (2.5, 440.0):
        out = run(method, position, cutoff=cutoff)
        assert np.all(np.isfinite(out.ddq))
    for cutoff in (0.0, 450.0, 0.5):
        with pytest.raises(InputError, match="expected"):
            run(method, position, cutoff=cutoff)


def test_method_that_does_not_exist_is_refused_with_the_names():
    with pytest.raises(InputError, match="kalman_smoother"):
        run("sobel", np.zeros(3000))
