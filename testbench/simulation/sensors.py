"""What the robot's sensors make of the truth: encoder, torque channel, noise."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.signal import lfilter

from identification.errors import InputError
from identification.kinematics import kernel

Array = NDArray[np.float64]


@dataclass(frozen=True)
class SensorOptions:
    """Imperfections of the sensors; each a scalar or one value a joint. All zero: ideal sensors.

    encoder_bits: counts a revolution of a hinge are 2^bits; 0 does not quantise.
    slide_resolution: m, quantum of a slide joint's encoder.
    position_noise: rad (m), standard deviation of white noise on the position before it is quantised.
    torque_noise: standard deviation of the torque noise as a fraction of the joint's torque limit.
    torque_correlation_time: s, of that noise as a first-order autoregressive process; 0: white.
    torque_bias: N·m (N), added to the reported torque.
    torque_delay: s, by which the reported torque is late; any fraction of a sample, negative: early.
    """

    encoder_bits: ArrayLike = 0
    slide_resolution: ArrayLike = 0.0
    position_noise: ArrayLike = 0.0
    torque_noise: ArrayLike = 0.0
    torque_correlation_time: ArrayLike = 0.0
    torque_bias: ArrayLike = 0.0
    torque_delay: ArrayLike = 0.0


def per_joint(value: ArrayLike, joints: int, field: str, lowest: float = -np.inf) -> Array:
    """A scalar or (n,) option as (n,). Raises InputError for another shape, NaN or a value too low."""
    try:
        array = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError("simulation", field, "a number, or one a joint", repr(value)) from None
    if array.shape not in ((), (joints,)):
        raise InputError("simulation", field, f"a number, or {joints} of them", f"shape {array.shape}")
    if not (np.isfinite(array) & (array >= lowest)).all():
        bound = "" if np.isinf(lowest) else f" of at least {lowest:g}"
        raise InputError("simulation", field, f"finite values{bound}", array.tolist())
    return np.broadcast_to(array, (joints,)).copy()


def encoder_quantum(options: SensorOptions, is_slide: NDArray[np.bool_]) -> Array:
    """Size of one encoder count at each joint (n,), rad (m); 0 where positions are not quantised."""
    bits = per_joint(options.encoder_bits, len(is_slide), "encoder_bits", 0)
    resolution = per_joint(options.slide_resolution, len(is_slide), "slide_resolution", 0)
    return np.where(is_slide, resolution, np.where(bits > 0, 2 * np.pi / 2.0**bits, 0.0))


@kernel
def encoder_reading(position: float, noise: float, quantum: float) -> float:
    """Noisy position rounded to whole counts; not rounded where the quantum is 0."""
    if quantum > 0.0:
        return quantum * np.rint((position + noise) / quantum)
    return position + noise


def white_noise(stream: np.random.SeedSequence, channel: int, shape: tuple[int, int]) -> Array:
    """Standard normal noise (N, n) of one channel of one run; depends on nothing but its arguments."""
    child = np.random.SeedSequence(stream.entropy, spawn_key=(*stream.spawn_key, channel))
    return np.random.Generator(np.random.PCG64(child)).standard_normal(shape)


def measured_torque(
    drive: Array, standard_normal: Array, rate: float, deviation: Array, options: SensorOptions
) -> Array:
    """The torque (N, n) that the drive reports.

    drive: (N, n) from ``centred_torque``. standard_normal: (N, n) white noise. deviation: (n,) N·m.
    """
    n = drive.shape[1]
    correlation = per_joint(options.torque_correlation_time, n, "torque_correlation_time", 0)
    noise = np.empty_like(standard_normal)
    for joint in range(n):
        pole = np.exp(-1 / (rate * correlation[joint])) if correlation[joint] > 0 else 0.0
        innovation = np.sqrt(1 - pole**2) * standard_normal[:, joint]
        # The first sample is drawn from the stationary distribution, so there is no transient.
        innovation[0] = standard_normal[0, joint]
        noise[:, joint] = lfilter([1.0], [1.0, -pole], innovation)
    return drive + deviation * noise + per_joint(options.torque_bias, n, "torque_bias")


def centred_torque(held: Array, before: Array, delay: Array, rate: float) -> Array:
    """Drive torque averaged over the control period centred on each sample's instant less ``delay``, (N, n).

    held: (N, n), row k is held from sample k to k + 1. before: (n,), held until sample 0. delay: (n,) s.
    Without delay row k is (held[k-1] + held[k]) / 2, the torque that pairs with the motion at sample k.
    """
    samples, joints = held.shape
    steps = np.vstack([before, held])
    out = np.empty_like(held)
    for joint in range(joints):
        end = 0.5 - delay[joint] * rate
        whole = int(np.floor(end))
        share = end - whole
        # The window of one period spans two held values: index k of ``steps`` ends at sample k.
        later = np.clip(np.arange(samples) + whole + 1, 0, samples)
        earlier = np.clip(np.arange(samples) + whole, 0, samples)
        out[:, joint] = (1 - share) * steps[earlier, joint] + share * steps[later, joint]
    return out
