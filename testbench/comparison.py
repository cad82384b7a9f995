"""The estimate held against the ground truth of a simulated robot."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from identification.base_parameters import BaseParameters
from identification.chain import Chain
from identification.estimate import Estimate
from identification.filtering import noise_gain
from identification.models import Preprocessing
from identification.regressor import regressor

from .log import Recording
from .results import Comparison

Array = NDArray[np.float64]

# Samples whose regressor is held in memory at once.
CHUNK = 8192


def compare_with_truth(
    chain: Chain,
    estimate: Estimate,
    recordings: Sequence[Recording],
    noise_std: Array,
    noise_pole: float,
    preprocessing: Preprocessing,
) -> Comparison:
    """The Comparison of an estimate with the truth of the simulated runs it was fitted to.

    noise_std: (n,) N·m of the torque sensor's noise; noise_pole: of its first-order autoregressive
    colour, 0 for white. Each recording carries its truth.
    """
    truth = estimate.base.values(recordings[0].truth["parameters"])
    rate = recordings[0].sample_rate
    return Comparison(
        truth=truth,
        error=estimate.values - truth,
        cramer_rao=cramer_rao(chain, estimate.base, recordings, noise_std, noise_pole),
        noise_floor=noise_std * noise_gain(rate, preprocessing.at(rate).cutoff, noise_pole),
    )


def cramer_rao(
    chain: Chain, base: BaseParameters, recordings: Sequence[Recording], noise_std: Array, noise_pole: float
) -> Array:
    """Smallest standard deviation of any unbiased estimate from these runs, (b,).

    sqrt diag (W'S^-1 W)^-1 with W along the true motion at the full rate and S the covariance of
    the torque noise alone: a bound for an observer who knows the motion exactly. First-order
    autoregressive noise is whitened exactly. Zero where the torque is free of noise.
    """
    if not np.any(noise_std > 0):
        return np.zeros(base.count)
    information = np.zeros((base.count, base.count))
    innovation = noise_std * np.sqrt(1 - noise_pole**2)
    for recording in recordings:
        q, dq, ddq = (recording.truth[name] for name in ("position", "velocity", "acceleration"))
        for start in range(0, len(q), CHUNK):
            before = max(0, start - 1)
            part = slice(before, start + CHUNK)
            rows = regressor(chain, q[part], dq[part], ddq[part], base.columns)
            white = rows[start - before :] / innovation[:, None]
            if noise_pole > 0 and start > before:
                white -= noise_pole * rows[:-1] / innovation[:, None]
            elif noise_pole > 0:
                white[1:] -= noise_pole * rows[:-1] / innovation[:, None]
                white[0] *= np.sqrt(1 - noise_pole**2)
            flat = white.reshape(-1, base.count)
            information += flat.T @ flat
    scale = np.sqrt(np.diag(information))
    inverse = np.linalg.inv(information / np.outer(scale, scale))
    return np.sqrt(np.diag(inverse)) / scale
