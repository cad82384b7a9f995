"""Commanded motions of drawn robots; each returns (position, velocity, acceleration), (N, n)."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Motion = tuple[Array, Array, Array]

RAMP = 1.0  # s, to get going and to stop


def waves(
    rng: np.random.Generator,
    lower: Array,
    upper: Array,
    speed: Array,
    duration: float,
    rate: float,
    harmonics: int = 6,
    lowest: float = 0.1,
) -> Motion:
    """A random sum of sines about a random pose, at rest at both ends, within range and speed.

    lower, upper: (n,) rad (m). speed: (n,) rad/s (m/s). duration: s. rate: Hz. lowest: Hz, of the first
    harmonic.
    """
    n = len(lower)
    time = np.arange(round(duration * rate) + 1) / rate
    angle = 2 * np.pi * lowest * np.arange(1, harmonics + 1)
    size = rng.standard_normal((2, harmonics, n)) / np.sqrt(np.arange(1, harmonics + 1))[:, None]
    sine, cosine = np.sin(np.outer(time, angle)), np.cos(np.outer(time, angle))
    q = sine @ size[0] + cosine @ size[1]
    dq = (cosine * angle) @ size[0] - (sine * angle) @ size[1]
    ddq = -(sine * angle**2) @ size[0] - (cosine * angle**2) @ size[1]
    # A ramp up and down, with its first and second derivative.
    s, ds, dds = _step(np.minimum(time, duration - time) / RAMP)
    ds = ds / RAMP * np.where(time < duration / 2, 1.0, -1.0)
    s, ds, dds = s[:, None], ds[:, None], dds[:, None] / RAMP**2
    q, dq, ddq = s * q, ds * q + s * dq, dds * q + 2 * ds * dq + s * ddq
    room, reach = (upper - lower) / 2, np.abs(q).max(axis=0)
    scale = np.minimum(room * rng.uniform(0.6, 0.95, n) / reach, 0.9 * speed / np.abs(dq).max(axis=0))
    slack = room - scale * reach
    middle = (lower + upper) / 2 + slack * rng.uniform(-0.5, 0.5, n)
    return middle + scale * q, scale * dq, scale * ddq


def moves(
    rng: np.random.Generator,
    lower: Array,
    upper: Array,
    speed: Array,
    duration: float,
    rate: float,
    rest: float = 0.3,
) -> Motion:
    """Quintic moves of all joints at once between random poses, with rests of ``rest`` s."""
    n, total = len(lower), round(duration * rate) + 1
    q, dq, ddq = np.zeros((3, total, n))
    pose, start = rng.uniform(lower, upper), 0
    while start < total:
        target = rng.uniform(lower, upper)
        # The quintic's peak speed is 15/8 of its mean.
        seconds = max(float((15 / 8 * np.abs(target - pose) / (0.9 * speed)).max()), 0.5)
        steps = round(seconds * rate)
        left = total - start
        if steps > left:
            q[start:] = pose
            break
        s, ds, dds = (x[:, None] for x in _step(np.arange(steps) / steps))
        seconds = steps / rate
        q[start : start + steps] = pose + s * (target - pose)
        dq[start : start + steps] = ds / seconds * (target - pose)
        ddq[start : start + steps] = dds / seconds**2 * (target - pose)
        pause = min(round(rest * rate), left - steps)
        q[start + steps : start + steps + pause] = target
        pose, start = target, start + steps + pause
    return q, dq, ddq


def _step(x: Array) -> tuple[Array, Array, Array]:
    """The quintic smooth step from 0 at 0 to 1 at 1 and beyond, with two derivatives."""
    x = np.clip(x, 0.0, 1.0)
    return (
        x**3 * (10 - 15 * x + 6 * x**2),
        30 * x**2 * (1 - x) ** 2,
        60 * x * (1 - x) * (1 - 2 * x),
    )
