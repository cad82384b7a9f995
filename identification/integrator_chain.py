"""A position and its derivatives as a chain of integrators, followed by fixed gains along a log.

The state of one joint is x = [q, dq, ddq, ...], x[k+1] = F x[k] exactly where the highest derivative
holds, and the position is measured. Kalman filters in steady state and Luenberger observers differ
only in the gain K of the correction x += K (y - q).
"""

from math import factorial

import numpy as np
from numpy.typing import NDArray

from .kinematics import kernel

Array = NDArray[np.float64]


def transition(order: int, step: float) -> Array:
    """F (order, order): the state a time ``step`` later while its highest derivative holds."""
    row, column = np.indices((order, order))
    powers = np.array([step**power / factorial(power) for power in range(order)])
    return np.triu(powers[np.maximum(column - row, 0)])


def process_noise(order: int, step: float) -> Array:
    """(order, order): covariance gathered over ``step`` from unit white noise on the next derivative."""
    power = order - 1 - np.arange(order)
    factorials = np.array([factorial(p) for p in power])
    total = power[:, None] + power + 1
    return step**total / (total * np.outer(factorials, factorials))


def initial_state(position: Array, order: int, step: float, samples: int) -> Array:
    """(n, order): state one step before the first sample, of the polynomial through the first ``samples``.

    position: (N, n). The polynomial of degree order - 1 is fitted by least squares.
    """
    # Times in units of the fitted stretch keep the fit well conditioned.
    span = samples * step
    time = np.arange(1, samples + 1) * step / span
    powers = np.arange(order)
    coefficients = np.linalg.lstsq(time[:, None] ** powers, position[:samples], rcond=None)[0]
    factors = np.array([factorial(power) for power in range(order)]) / span**powers
    return np.ascontiguousarray(coefficients.T * factors)


@kernel
def follow(position: Array, transition: Array, gain: Array, start: Array) -> Array:
    """(N, n, order): x[k] = F x[k-1] + K (y[k] - (F x[k-1])_0) of each joint, from ``start`` (n, order)."""
    samples, joints = position.shape
    order = gain.size
    states = np.empty((samples, joints, order))
    predicted = np.empty(order)
    for joint in range(joints):
        before = start[joint]
        for k in range(samples):
            for i in range(order):
                predicted[i] = 0.0
                for j in range(i, order):
                    predicted[i] += transition[i, j] * before[j]
            error = position[k, joint] - predicted[0]
            for i in range(order):
                states[k, joint, i] = predicted[i] + gain[i] * error
            before = states[k, joint]
    return states


@kernel
def smooth_backward(states: Array, transition: Array, gain: Array) -> None:
    """Turn filtered ``states`` (N, n, order) into smoothed ones: x[k] += C (x[k+1] - F x[k]), from the end.

    gain: C (order, order), of the Rauch-Tung-Striebel smoother.
    """
    samples, joints, order = states.shape
    change = np.empty(order)
    for joint in range(joints):
        for k in range(samples - 2, -1, -1):
            for i in range(order):
                change[i] = states[k + 1, joint, i]
                for j in range(i, order):
                    change[i] -= transition[i, j] * states[k, joint, j]
            for i in range(order):
                for j in range(order):
                    states[k, joint, i] += gain[i, j] * change[j]
