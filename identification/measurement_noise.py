"""Encoder noise, read off the raw positions and carried through the pipeline to the equations.

What the low-pass takes from a position is noise: a motion has nothing up there. Its spread, divided
by the share of white noise that the low-pass takes, is the noise of the encoder. A seeded
realisation of that noise, sent through the very differentiation and filters that the data went
through, shows what it does to velocity, acceleration and regressor, whatever the method.
"""

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from .differentiation import differentiate
from .filtering import ORDER, edge_samples, zero_phase_lowpass
from .models import observe
from .observations import POSITION_BAND, Preprocessing
from .problem import Problem
from .signals import Motion, Signals

Array = NDArray[np.float64]

# Torque noise is at least this share of the residual variance, however noisy the encoders.
SMALLEST_TORQUE_SHARE = 0.01


def position_noise_std(motion: Motion, preprocessing: Preprocessing) -> Array:
    """Standard deviation of the white part of the measured positions, (n,) rad (m)."""
    rate = motion.sample_rate
    cutoff = POSITION_BAND * preprocessing.at(rate).cutoff
    removed = motion.position - zero_phase_lowpass(motion.position, rate, cutoff)
    edge = edge_samples(rate, cutoff)
    sections = signal.butter(ORDER, cutoff, fs=rate, output="sos")
    _, response = signal.freqz_sos(sections, worN=1 << 12, fs=rate)
    gain = np.sqrt(np.mean((1 - np.abs(response) ** 2) ** 2))
    return np.std(removed[edge:-edge], axis=0) / gain


def state_noise(motion: Motion, preprocessing: Preprocessing, seed: int = 0) -> tuple[Signals, Array]:
    """The differentiated motion, and what encoder noise does to it in the band of the equations.

    Returns the Signals and the covariance of each joint's (q, dq, ddq) errors, (n, 3, 3).
    """
    rate = motion.sample_rate
    settings = preprocessing.at(rate)
    band = POSITION_BAND * settings.cutoff
    signals = differentiate(motion, settings.differentiation, band)
    shaken = differentiate(_shaken(motion, preprocessing, seed), settings.differentiation, band)
    errors = [
        zero_phase_lowpass(after - before, rate, settings.cutoff)
        for after, before in ((shaken.q, signals.q), (shaken.dq, signals.dq), (shaken.ddq, signals.ddq))
    ]
    edge = max(signals.trim, edge_samples(rate, settings.cutoff))
    inside = np.stack(errors, axis=2)[edge:-edge]
    return signals, np.einsum("tja,tjb->jab", inside, inside) / len(inside)


def regressor_noise(problem: Problem, weights: Array, seed: int = 0) -> tuple[Array, Array]:
    """What encoder noise does to the regressor: mean error covariances of a used row.

    weights: (e,), multiplied into each equation's rows. Returns the covariance of a weighted row,
    over all rows, (b, b), and those of each equation's unweighted rows, (e, b, b).
    """
    b = problem.base.count
    sums, counts = np.zeros((problem.equations, b, b)), np.zeros(problem.equations)
    for index, motion in enumerate(problem.motions):
        before = observe(problem.chain, problem.base, motion, problem.preprocessing)
        moved = _shaken(motion, problem.preprocessing, seed + index)
        after = observe(problem.chain, problem.base, moved, problem.preprocessing)
        used = before.used & after.used
        for equation in range(problem.equations):
            u = used[:, equation]
            error = after.regressor[u, equation] - before.regressor[u, equation]
            sums[equation] += error.T @ error
            counts[equation] += u.sum()
    each = sums / np.maximum(counts, 1)[:, None, None]
    share = counts / counts.sum()
    return np.einsum("e,eab->ab", share * weights**2, each), each


def torque_variance(residual: Array, from_encoders: Array) -> Array:
    """The part of residual variances that encoder noise leaves to the torque, same shape."""
    return np.maximum(residual - from_encoders, SMALLEST_TORQUE_SHARE * residual)


def _shaken(motion: Motion, preprocessing: Preprocessing, seed: int) -> Motion:
    """The motion with one more realisation of its own encoder noise on it."""
    noise = np.random.default_rng(seed).standard_normal(motion.position.shape)
    std = position_noise_std(motion, preprocessing)
    return Motion(motion.position + std * noise, motion.torque, motion.sample_rate)
