"""Standard parameters that a real arm could have, nearest to an estimate of its base parameters.

Every link's 4 x 4 pseudo-inertia positive definite (Wensing, Kim & Slotine 2018), armature and
friction not negative. What the torques cannot tell is drawn to the model as given, by the entropic
divergence tr(P0^-1 P) - log det P of Lee, Wensing & Park (2020), "Geometric robot dynamic
identification: a convex programming approach". In the scaling P = L X L' with P0 = L L' of the model
as given it reads tr X - log det X, and all unknowns of the semidefinite programme are near one.
"""

import warnings
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .base_parameters import BaseParameters
from .errors import InputError
from .estimate import Estimate
from .parameters import INERTIAL, OFFSET, PER_JOINT, pseudo_inertia

Array = NDArray[np.float64]

# The prior weighs as much as a deviation of this many squared standard deviations: next to nothing.
PRIOR_WEIGHT = 1e-3
# Smallest eigenvalue of a pseudo-inertia, relative to that of the model as given.
MARGIN = 1e-3
# A model's own pseudo-inertia is lifted to this share of its largest eigenvalue before it scales.
NOMINAL_FLOOR = 1e-6
# Beyond this the data need not be trusted more; it keeps the programme well scaled on exact data. Where the
# solver gives up, they are trusted less.
LARGEST_INFORMATION = (1e5, 1e3, 1e2, 1e1)


def nearest_consistent(base: BaseParameters, values: Array, root_information: Array, nominal: Array) -> Array:
    """The consistent standard vector (14 n,) that minimises |R (P theta - values)|² and a faint prior.

    values: (b,). root_information: (b, b), R with R'R the inverse of their covariance.
    nominal: (14 n,) of the model as given. Where ``values`` themselves are consistent the answer has
    exactly these base values. Links without mass in the model stay so; parameters that no base
    parameter holds keep 0 (friction, armature) or the model's value (inertia).
    Raises InputError when the programme has no solution.
    """
    unknowns = _unknowns(base, values, nominal)
    matrix = root_information @ base.projection @ unknowns.basis
    target = root_information @ (values - base.projection @ unknowns.fixed)
    solution = _first_solved(matrix, target, unknowns)
    # Where no constraint binds, only the prior keeps it from the values: undo that.
    mapping = base.projection @ unknowns.basis
    missing = values - base.projection @ (unknowns.fixed + unknowns.basis @ solution)
    moved = solution + np.linalg.lstsq(mapping, missing, rcond=None)[0]
    chosen = moved if _is_consistent(moved, unknowns) else solution
    return unknowns.fixed + unknowns.basis @ chosen


def consistent_standard_parameters(estimate: Estimate, nominal: Array) -> Array:
    """A consistent standard vector (14 n,) for an estimate: its own, or the nearest to its values."""
    if estimate.standard is not None:
        return estimate.standard
    std = np.maximum(estimate.std, np.finfo(float).tiny)
    correlation = estimate.covariance / np.outer(std, std)
    root = np.linalg.cholesky(np.linalg.inv(correlation)).T / std
    return nearest_consistent(estimate.base, estimate.values, root, nominal)


@dataclass(frozen=True)
class _Unknowns:
    """The programme's unknowns x: theta = fixed + basis @ x.

    The first 16 x are the entries of each free link's scaled pseudo-inertia X; then come scaled
    joint parameters. links: how many X. signed: which of the joint parameters may be negative.
    start: what the joint parameters are in the model as given.
    """

    fixed: Array
    basis: Array
    links: int
    signed: NDArray[np.bool_]
    start: Array


def _unknowns(base: BaseParameters, values: Array, nominal: Array) -> _Unknowns:
    involved = np.any(base.projection != 0, axis=0)
    fixed = np.zeros_like(nominal)
    columns: list[Array] = []
    links, signed, start = 0, [], []
    # A scale for what the model as given has no value for.
    guess = np.linalg.lstsq(base.projection, values, rcond=None)[0]
    for first in range(0, len(nominal), PER_JOINT):
        inertial = slice(first, first + INERTIAL)
        fixed[inertial] = nominal[inertial]
        if np.any(involved[inertial]) and nominal[first + INERTIAL - 1] > 0:
            fixed[inertial] = 0.0
            block = np.zeros((len(nominal), 16))
            block[inertial] = _from_scaled(nominal[inertial])
            columns.append(block)
            links += 1
    for index in np.flatnonzero(involved):
        if index % PER_JOINT < INERTIAL:
            continue
        scale = max(abs(nominal[index]), abs(guess[index]), 1e-9)
        columns.append(scale * np.eye(len(nominal))[:, [index]])
        signed.append(index % PER_JOINT == OFFSET)
        start.append(nominal[index] / scale)
    return _Unknowns(fixed, np.hstack(columns), links, np.array(signed, dtype=bool), np.array(start))


def _from_scaled(nominal: Array) -> Array:
    """(10, 16): inertial parameters of the pseudo-inertia L X L', linear in X's entries."""
    eigenvalues, vectors = np.linalg.eigh(pseudo_inertia(nominal))
    root = vectors * np.sqrt(np.maximum(eigenvalues, NOMINAL_FLOOR * eigenvalues[-1]))
    parameters = np.zeros((INERTIAL, 4, 4))
    # Of the pseudo-inertia's upper-left block S: the inertia is tr(S) 1 - S.
    for k, (row, column) in enumerate(((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))):
        if row == column:
            parameters[k, [0, 1, 2], [0, 1, 2]] = 1.0
            parameters[k, row, row] = 0.0
        else:
            parameters[k, row, column] = parameters[k, column, row] = -0.5
    for axis in range(3):
        parameters[6 + axis, axis, 3] = parameters[6 + axis, 3, axis] = 0.5
    parameters[9, 3, 3] = 1.0
    return np.einsum("kab,ac,bd->kcd", parameters, root, root).reshape(INERTIAL, 16)


def _first_solved(matrix: Array, target: Array, unknowns: _Unknowns) -> Array:
    """The programme's solution by as much information as the solver copes with."""
    largest = max(float(np.linalg.norm(matrix, 2)), np.finfo(float).tiny)
    # Where several would leave all of it, the same programme is not solved again.
    for scale in dict.fromkeys(min(1.0, information / largest) for information in LARGEST_INFORMATION):
        solution = _solve(scale * matrix, scale * target, unknowns)
        if solution is not None:
            return solution
    raise InputError(
        "identification",
        "estimator",
        "an estimate near physically consistent parameters",
        "a semidefinite programme that has no solution",
    )


def _solve(matrix: Array, target: Array, unknowns: _Unknowns) -> Array | None:
    """The semidefinite programme's solution x; None where the solver gives up."""
    # Slow to import, and only this estimator needs it.
    import cvxpy as cp

    count, links = matrix.shape[1], unknowns.links
    scaled = [cp.Variable((4, 4), symmetric=True) for _ in range(links)]
    joint = cp.Variable(count - 16 * links)
    x = cp.hstack([*(cp.vec(block, order="C") for block in scaled), joint])
    prior = cp.sum_squares(joint - unknowns.start)
    prior += sum(cp.trace(block) - cp.log_det(block) for block in scaled)
    # The triangular factor of the whole says the same in as many rows as there are unknowns.
    upper = np.asarray(np.linalg.qr(np.column_stack([matrix, target]), mode="r"))
    misfit = cp.sum_squares(upper[:, :-1] @ x - upper[:, -1])
    constraints = [block >> MARGIN * np.eye(4) for block in scaled]
    constraints.append(joint[np.flatnonzero(~unknowns.signed)] >= 0)
    programme = cp.Problem(cp.Minimize(misfit + PRIOR_WEIGHT * prior), constraints)
    with warnings.catch_warnings():
        # To its reduced tolerance it is still consistent, and the prior's faint pull is what suffers.
        warnings.filterwarnings("ignore", "Solution may be inaccurate")
        try:
            programme.solve(solver=cp.CLARABEL, max_threads=1)
        except cp.SolverError:
            return None
    if x.value is None:
        return None
    # The solver meets bounds to its tolerance only.
    joint_values = np.where(unknowns.signed, joint.value, np.maximum(joint.value, 0.0))
    return np.concatenate([x.value[: 16 * links], joint_values])


def _is_consistent(x: Array, unknowns: _Unknowns) -> bool:
    blocks = x[: 16 * unknowns.links].reshape(-1, 4, 4)
    blocks = 0.5 * (blocks + blocks.transpose(0, 2, 1))
    inertial = np.linalg.eigvalsh(blocks).min(initial=np.inf) >= MARGIN
    return bool(inertial and np.all((x[16 * unknowns.links :] >= 0) | unknowns.signed))
