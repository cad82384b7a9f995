"""The robot that could exist and is nearest to the model given, among those of an estimate's base parameters.

Could exist: every link's 4 x 4 pseudo-inertia positive definite (Wensing, Kim & Slotine 2018), friction not
negative, rotors and masses of a size that the model's own make likely. Nearest: by the log-det divergence
tr(P0^-1 P) - log det P of Lee, Wensing & Park (2020), "Geometric robot dynamic identification: a convex
programming approach", of each pseudo-inertia P from the model's P0, and y - log y of each rotor and friction
y in units of the model's. In the scaling P = L X L' with P0 = L L' it reads tr X - log det X. The sum is
convex and is its own barrier, so Newton's method in a trust region finds its minimum.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag, solve_triangular

from .base_parameters import BaseParameters
from .errors import InputError
from .parameters import ARMATURE, INERTIAL, MASS, OFFSET, PER_JOINT, pseudo_inertia

Array = NDArray[np.float64]

# Smallest eigenvalue of a pseudo-inertia, relative to that of the model as given.
MARGIN = 1e-2
# A model's own pseudo-inertia is lifted to this share of its largest eigenvalue before it scales.
NOMINAL_FLOOR = 1e-6
# Heaviest link over the model's heaviest, and lightest rotor over the model's own.
HEAVIEST, LIGHTEST_ROTOR = 1.5, 0.1
# A base parameter with less than this share of its value as deviation is determined by the data.
DETERMINED = 0.1
# Beyond this the data need not be trusted more; it keeps the Hessian well scaled on exact data.
LARGEST_INFORMATION = 1e4
# The misfit's weight grows to one by this factor, from where the model itself is next to the minimum, so that
# Newton's method always starts near; it ends where a step would gain less than this share of the cost.
FIRST_WEIGHT, STAGES = 1e-6, 13
CONVERGED, PASSES = 1e-9, 500
# Step lengths of the line search; along a bound the cost falls far beyond a full step.
LONGER, SHORTER = (2.0, 4.0), tuple(0.5**k for k in range(1, 20))
# Where a symmetric matrix has its entries.
ROWS, COLUMNS = np.triu_indices(4)


def nearest_consistent(base: BaseParameters, values: Array, root_information: Array, nominal: Array) -> Array:
    """The consistent standard vector (14 n,) nearest to the model among those with these base values.

    values: (b,). root_information: (b, b), R with R'R the inverse of their covariance. What is least is
    |R (P theta - values)|² / 2 + divergence; where that leads to a consistent vector of the very values, it
    is that. No link is heavier than HEAVIEST times the model's heaviest and no rotor lighter than
    LIGHTEST_ROTOR of the model's, unless it is a base parameter by itself that the data determine.
    nominal: (14 n,) of the model as given. Links without mass there stay so; parameters that no base
    parameter holds keep 0 (friction, armature) or the model's value (inertia). Raises InputError where no
    minimum is found.
    """
    unknowns = _unknowns(base, values, root_information, nominal)
    mapping = base.projection @ unknowns.basis
    target = values - base.projection @ unknowns.fixed
    solution = _minimum(root_information @ mapping, root_information @ target, unknowns)
    # Where no bound is in the way, only the divergence keeps it from the values: undo that.
    moved = solution + np.linalg.lstsq(mapping, target - mapping @ solution, rcond=None)[0]
    chosen = moved if np.isfinite(_divergence(moved, unknowns)) else solution
    return unknowns.fixed + unknowns.basis @ chosen


def consistent_standard_parameters(
    base: BaseParameters, values: Array, covariance: Array, nominal: Array
) -> Array:
    """The same for base values (b,) with a covariance (b, b)."""
    std = np.sqrt(np.maximum(np.diag(covariance), np.finfo(float).tiny))
    eigenvalues, vectors = np.linalg.eigh(covariance / np.outer(std, std))
    # Directions that the data fix beyond rounding would make the root singular.
    least = np.finfo(float).eps * len(std) * eigenvalues[-1]
    root = (vectors / np.sqrt(np.maximum(eigenvalues, least))).T / std
    return nearest_consistent(base, values, root, nominal)


@dataclass(frozen=True)
class _Unknowns:
    """The unknowns x, and what holds them: theta = fixed + basis @ x.

    The first 10 links x are the upper triangles of each free link's scaled pseudo-inertia X, less the margin;
    then come scaled joint parameters. start: (d,) of the model as given. free: (d,) bool, those without sign.
    weights: (d - 10 links,) of the joint parameters' divergence. caps: (c, d) and (c,): caps x < bounds.
    """

    fixed: Array
    basis: Array
    links: int
    start: Array
    free: NDArray[np.bool_]
    caps: Array
    bounds: Array


def _unknowns(base: BaseParameters, values: Array, root_information: Array, nominal: Array) -> _Unknowns:
    involved = np.any(base.projection != 0, axis=0)
    determined = _determined(base, values, root_information)
    fixed = np.zeros_like(nominal)
    # A scale for what the model as given has no value for.
    guess = np.linalg.lstsq(base.projection, values, rcond=None)[0]
    blocks, columns, start, free = [], [], [], []
    for first in range(0, len(nominal), PER_JOINT):
        inertial = slice(first, first + INERTIAL)
        fixed[inertial] = nominal[inertial]
        if np.any(involved[inertial]) and nominal[first + MASS] > 0:
            scaled = _from_scaled(nominal[inertial])
            fixed[inertial] = MARGIN * scaled[:, ROWS == COLUMNS].sum(axis=1)
            block = np.zeros((len(nominal), len(ROWS)))
            block[inertial] = (1 - MARGIN) * scaled
            blocks.append(block)
    for index in np.flatnonzero(involved):
        kind, given = index % PER_JOINT, nominal[index]
        if kind < INERTIAL:
            continue
        if kind == ARMATURE and given > 0 and not determined[index]:
            fixed[index] = LIGHTEST_ROTOR * given
        scale = given - fixed[index] if given > 0 else max(abs(given), abs(guess[index]), 1e-9)
        columns.append(scale * np.eye(len(nominal))[:, [index]])
        free.append(kind == OFFSET)
        start.append(given / scale if kind == OFFSET else 1.0)
    basis = np.hstack([*blocks, *columns])
    links = len(blocks)
    masses = np.arange(MASS, len(nominal), PER_JOINT)
    # Also masses that no base parameter holds: the pseudo-inertia's other entries draw them up.
    capped = masses[np.any(basis[masses] != 0, axis=1) & ~determined[masses]]
    given = nominal[capped]
    room = HEAVIEST * nominal[masses].max() - given
    return _Unknowns(
        fixed=fixed,
        basis=basis,
        links=links,
        start=np.concatenate([np.tile(np.eye(4)[ROWS, COLUMNS], links), start]),
        free=np.array(free, dtype=bool),
        caps=basis[capped] / room[:, None],
        bounds=1 + (given - fixed[capped]) / room,
    )


def _determined(base: BaseParameters, values: Array, root_information: Array) -> NDArray[np.bool_]:
    """Which standard parameters (14 n,) are base parameters by themselves that the data determine."""
    rows = np.linalg.pinv(base.projection)
    alone = np.isclose(np.einsum("pb,bp->p", rows, base.projection), 1.0, atol=1e-6)
    std = np.linalg.norm(np.linalg.lstsq(root_information.T, rows.T, rcond=None)[0], axis=0)
    return np.asarray(alone & (std < DETERMINED * (rows @ values)))


def _from_scaled(nominal: Array) -> Array:
    """(10, 10): inertial parameters of the pseudo-inertia L X L', linear in X's upper triangle."""
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
    scaled = np.einsum("kab,ac,bd->kcd", parameters, root, root)
    return np.where(ROWS == COLUMNS, 1.0, 2.0) * scaled[:, ROWS, COLUMNS]


def _minimum(matrix: Array, target: Array, unknowns: _Unknowns) -> Array:
    """The x of least |matrix x - target|² / 2 and divergence."""
    scale = min(1.0, LARGEST_INFORMATION / max(float(np.linalg.norm(matrix, 2)), np.finfo(float).tiny))
    # The triangular factor of the whole says the same in as many rows as there are unknowns.
    upper = scale * np.asarray(np.linalg.qr(np.column_stack([matrix, target]), mode="r"))
    x = unknowns.start
    for weight in np.geomspace(FIRST_WEIGHT, 1.0, STAGES):
        x = _newton(np.sqrt(weight) * upper, x, unknowns)
    return x


def _newton(upper: Array, x: Array, unknowns: _Unknowns) -> Array:
    """The x of least |upper (x, -1)|² / 2 and divergence, by Newton's method from within bounds."""
    rows, right = upper[:, :-1], upper[:, -1]

    def cost(at: Array) -> float:
        return 0.5 * float(np.sum((rows @ at - right) ** 2)) + _divergence(at, unknowns)

    now = cost(x)
    for _ in range(PASSES):
        left, (slope, curvature) = rows @ x - right, _derivatives(x, unknowns)
        root = _root(curvature)
        # Least squares, not the normal equations: the data's information spans many decades.
        wanted = -np.concatenate([left, np.linalg.solve(root, slope)])
        factor = np.asarray(np.linalg.qr(np.column_stack([np.vstack([rows, root.T]), wanted]), mode="r"))
        step = solve_triangular(factor[:-1, :-1], factor[:-1, -1])
        if -float(left @ (rows @ step) + slope @ step) < CONVERGED * max(1.0, now):
            return x
        length = next((each for each in (1.0, *SHORTER) if cost(x + each * step) < now), 0.0)
        if length == 0.0:
            return x
        if length == 1.0:
            length = min((1.0, *LONGER), key=lambda each: cost(x + each * step))
        x = x + length * step
        now = cost(x)
    raise InputError("identification", "estimate", "a robot that could exist near it", "none that was found")


def _root(curvature: Array) -> Array:
    """R with R R' the curvature (d, d), positive definite where rounding next to a bound leaves it less."""
    scale = np.sqrt(np.diag(curvature))
    eigenvalues, vectors = np.linalg.eigh(curvature / np.outer(scale, scale))
    rounding = len(scale) * np.finfo(float).eps * eigenvalues[-1]
    return scale[:, None] * vectors * np.sqrt(np.maximum(eigenvalues, rounding))


def _parts(x: Array, unknowns: _Unknowns) -> tuple[Array, Array, Array]:
    """Scaled pseudo-inertias (links, 4, 4), joint parameters, and shares of the room below the caps."""
    count = len(ROWS) * unknowns.links
    full = np.zeros((unknowns.links, 4, 4))
    full[:, ROWS, COLUMNS] = full[:, COLUMNS, ROWS] = x[:count].reshape(-1, len(ROWS))
    return full, x[count:], unknowns.bounds - unknowns.caps @ x


def _divergence(x: Array, unknowns: _Unknowns) -> float:
    """Divergence from the model; infinite beyond a bound."""
    full, joint, room = _parts(x, unknowns)
    positive = np.concatenate([joint[~unknowns.free], room])
    eigenvalues = np.linalg.eigvalsh(full).ravel()
    if np.any(positive <= 0) or np.any(eigenvalues <= 0):
        return np.inf
    from_start = (x - unknowns.start)[-len(joint) :][unknowns.free] if len(joint) else joint
    each = np.concatenate([positive, eigenvalues])
    return float(np.sum(each - np.log(each)) + 0.5 * np.sum(from_start**2))


def _derivatives(x: Array, unknowns: _Unknowns) -> tuple[Array, Array]:
    """Gradient (d,) and Hessian (d, d) of the divergence."""
    full, joint, room = _parts(x, unknowns)
    inverse = np.linalg.inv(full)
    twice = np.where(ROWS == COLUMNS, 1.0, 2.0)
    of_links = twice * (np.eye(4) - inverse)[:, ROWS, COLUMNS]
    # tr(X^-1 E_k X^-1 E_l) of the symmetric units E_k.
    one = inverse[:, ROWS[:, None], ROWS] * inverse[:, COLUMNS[:, None], COLUMNS]
    other = inverse[:, ROWS[:, None], COLUMNS] * inverse[:, COLUMNS[:, None], ROWS]
    bent = 0.5 * twice[:, None] * twice * (one + other)
    safe = np.where(unknowns.free, 1.0, joint)
    of_joints = np.where(unknowns.free, joint - unknowns.start[of_links.size :], 1 - 1 / safe)
    caps = unknowns.caps
    slope = np.concatenate([of_links.ravel(), of_joints]) - caps.T @ (1 - 1 / room)
    return slope, block_diag(*bent, np.diag(safe**-2)) + (caps.T * room**-2) @ caps
