"""Gain errors of the drives, from runs with payloads of known masses beside runs without.

A drive that reports tau / (1 + e) reports the payload's torque by the same factor s = 1 / (1 + e), and a
known mass says how large that torque is. Each joint has base parameters of its own here, which take up its
gain; what they leave between the runs is s_j Z_jr c_r in run r, with the mass among the payload's ten
parameters c_r known:

    min over s, c of sum_j w_j |y_j - X_j theta_j - s_j sum_r Z_jr c_r|², c_r,mass = m_r.

Gautier & Briot, "Global identification of joint drive gains and dynamic parameters of robots", ASME J. Dyn.
Sys., Meas., Control 136(5), 2014.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from identification.parameters import MASS

from ..fit.bounded import SMALL_RIDGE
from ..model.base_regressor import BaseRegressor
from ..model.candidate import Candidate
from ..model.hypothesis import INDEPENDENT

Array = NDArray[np.float64]

# Deviation of a drive's gain, where nothing determines it.
GAIN = 0.15


@dataclass(frozen=True)
class KnownPayloads:
    """Payloads of known masses and what the drives report of them.

    coefficients: a run with a payload, (10,) in the last link's frame. reported: (n,) shares of their torque.
    gains: (n,) relative, true = (1 + gain) reported; deviations: (n,), of the gains.
    """

    coefficients: tuple[Array, ...]
    reported: Array
    gains: Array
    deviations: Array


def known_payloads(base: BaseRegressor, payload: Candidate, masses: Mapping[int, float]) -> KnownPayloads:
    """The payloads of some runs and the gains of all drives.

    payload: of all runs. masses: kg, by the run's index; the other runs carry nothing.
    """
    prepared, runs = base.prepared, tuple(masses)
    parts = [_of_joint(base, runs, payload, joint) for joint in range(prepared.joints)]
    widths, free = 1 / np.sqrt(payload.precision), np.arange(len(payload.precision)) != MASS
    roots, targets = zip(*parts, strict=True)
    known = np.array(list(masses.values()))

    def parameters(unknowns: Array) -> Array:
        found = np.repeat(known[:, None], len(widths), axis=1)
        found[:, free] = widths[free] * unknowns[prepared.joints :].reshape(len(runs), -1)
        return found

    def left(unknowns: Array) -> Array:
        own = parameters(unknowns).ravel()
        shares = unknowns[: prepared.joints]
        rest = [s * (r @ own) - t for s, r, t in zip(shares, roots, targets, strict=True)]
        return np.concatenate([*rest, (shares - 1) / GAIN, unknowns[prepared.joints :]])

    start = np.concatenate([np.ones(prepared.joints), np.zeros(len(runs) * int(free.sum()))])
    solved = least_squares(left, start, x_scale="jac", method="trf", ftol=1e-14, xtol=1e-12, gtol=1e-12)
    shares, coefficients = solved.x[: prepared.joints], parameters(solved.x)
    jacobian = np.asarray(solved.jac, dtype=np.float64)
    covariance = np.linalg.pinv(jacobian.T @ jacobian, hermitian=True)
    deviations = np.sqrt(np.diag(covariance)[: prepared.joints])
    return KnownPayloads(tuple(coefficients), shares, 1 / shares - 1, deviations / shares**2)


def _of_joint(
    base: BaseRegressor, runs: Sequence[int], payload: Candidate, joint: int
) -> tuple[Array, Array]:
    """L (m, 10 r) and t (m,) of |L c - t|², a joint's squares beside its base parameters, in its noise."""
    used = [run.used[:, joint] for run in base.prepared.runs]
    x = np.concatenate([base.columns(run, joint)[u] for run, u in enumerate(used)])
    y = np.concatenate([own[u, joint] for own, u in zip(base.gap, used, strict=True)])
    own_of = [payload.filtered[k][u, joint] for k, u in enumerate(used)]
    z = np.hstack([np.concatenate([(k == index) * own for k, own in enumerate(own_of)]) for index in runs])
    x = x[:, np.any(x != 0, axis=0)]
    size = np.sqrt(np.sum(x**2, axis=0))
    basis, values, _ = np.linalg.svd(x / size, full_matrices=False)
    # One joint alone does not determine all base parameters.
    basis = basis[:, values > np.sqrt(SMALL_RIDGE) * values[0]] if len(values) else basis
    left, rest = z - basis @ (basis.T @ z), y - basis @ (basis.T @ y)
    rotated, known, turned = np.linalg.svd(left, full_matrices=False)
    seen = known > np.sqrt(SMALL_RIDGE) * max(float(known.max(initial=0.0)), float(np.finfo(float).tiny))
    target = rotated[:, seen].T @ rest
    # What is left beside the payloads is the noise, of which one sample in 1 / INDEPENDENT is of its own.
    noise = np.sum((rest - rotated[:, seen] @ target) ** 2) / max(INDEPENDENT * len(rest), 1.0)
    weight = 1 / np.sqrt(max(float(noise), float(np.finfo(float).tiny)))
    return weight * known[seen, None] * turned[seen], weight * target
