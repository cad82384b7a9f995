"""Gain errors of the drives, from a run with a payload of known mass beside runs without it.

A drive that reports tau / (1 + e) reports the payload's torque by the same factor s = 1 / (1 + e), and a
known mass says how large that torque is. Each joint has base parameters of its own here, which take up its
gain; what they leave between the runs is s_j Z_j c, with the mass among the payload's ten parameters c known:

    min over s, c of sum_j w_j |y_j - X_j theta_j - s_j Z_j c|², c_mass = m.

Gautier & Briot, "Global identification of joint drive gains and dynamic parameters of robots", ASME J. Dyn.
Sys., Meas., Control 136(5), 2014.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from identification.parameters import MASS

from ..data.preparation import Prepared
from ..model.base_regressor import ground
from ..model.candidates import Candidate
from ..model.hypothesis import INDEPENDENT

Array = NDArray[np.float64]

# Deviation of a drive's gain, where nothing determines it.
GAIN = 0.15
# Of the base columns' squares, against those that one joint alone does not tell.
RIDGE = 1e-9


@dataclass(frozen=True)
class KnownPayload:
    """A payload of known mass and what the drives report of it.

    coefficients: (10,) of the payload in the last link's frame. reported: (n,) shares of its torque. gains:
    (n,) relative, true = (1 + gain) reported; deviations: (n,), of the gains.
    """

    coefficients: Array
    reported: Array
    gains: Array
    deviations: Array


def known_payload(prepared: Prepared, index: int, payload: Candidate, mass: float) -> KnownPayload:
    """The payload of one run and the gains of all drives. index: of the run. payload: of all runs."""
    parts = [_of_joint(prepared, index, payload, joint) for joint in range(prepared.joints)]
    widths, free = 1 / np.sqrt(payload.precision), np.arange(len(payload.precision)) != MASS
    roots, targets = zip(*parts, strict=True)

    def parameters(unknowns: Array) -> Array:
        found = np.full(len(widths), mass)
        found[free] = widths[free] * unknowns[prepared.joints :]
        return found

    def left(unknowns: Array) -> Array:
        own = parameters(unknowns)
        shares = unknowns[: prepared.joints]
        rest = [s * (r @ own) - t for s, r, t in zip(shares, roots, targets, strict=True)]
        return np.concatenate([*rest, (shares - 1) / GAIN, unknowns[prepared.joints :]])

    start = np.concatenate([np.ones(prepared.joints), np.zeros(int(free.sum()))])
    solved = least_squares(left, start, x_scale="jac", method="trf", ftol=1e-14, xtol=1e-12, gtol=1e-12)
    shares, coefficients = solved.x[: prepared.joints], parameters(solved.x)
    jacobian = np.asarray(solved.jac, dtype=np.float64)
    covariance = np.linalg.pinv(jacobian.T @ jacobian, hermitian=True)
    deviations = np.sqrt(np.diag(covariance)[: prepared.joints])
    return KnownPayload(coefficients, shares, 1 / shares - 1, deviations / shares**2)


def _of_joint(prepared: Prepared, index: int, payload: Candidate, joint: int) -> tuple[Array, Array]:
    """L (m, k) and t (m,) of |L c - t|², a joint's squares beside its own base parameters, in its noise."""
    base = ground(prepared)
    used = [run.used[:, joint] for run in prepared.runs]
    x = np.concatenate([base.columns(run, joint)[u] for run, u in enumerate(used)])
    y = np.concatenate([own[u, joint] for own, u in zip(base.gap, used, strict=True)])
    z = np.concatenate([(k == index) * payload.filtered[k][u, joint] for k, u in enumerate(used)])
    x = x[:, np.any(x != 0, axis=0)]
    size = np.sqrt(np.sum(x**2, axis=0))
    basis, values, _ = np.linalg.svd(x / size, full_matrices=False)
    basis = basis[:, values > np.sqrt(RIDGE) * values[0]] if len(values) else basis
    left, rest = z - basis @ (basis.T @ z), y - basis @ (basis.T @ y)
    rotated, known, turned = np.linalg.svd(left, full_matrices=False)
    seen = known > np.sqrt(RIDGE) * max(float(known.max(initial=0.0)), float(np.finfo(float).tiny))
    target = rotated[:, seen].T @ rest
    # What is left beside the payload is the noise, of which one sample in 1 / INDEPENDENT is of its own.
    noise = np.sum((rest - rotated[:, seen] @ target) ** 2) / max(INDEPENDENT * len(rest), 1.0)
    weight = 1 / np.sqrt(max(float(noise), float(np.finfo(float).tiny)))
    return weight * known[seen, None] * turned[seen], weight * target
