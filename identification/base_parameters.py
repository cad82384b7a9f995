"""Base parameters: which combinations of standard parameters the torques can reveal.

Numerical method of Gautier (1991), "Numerical calculation of the base inertial parameters of
robots": the QR decomposition of the regressor at random states. Column j depends on the columns
before it when R_jj vanishes; its parameter is regrouped into theirs,
beta = X1 + R1^-1 R2 X2. The order puts YY, MZ and M last, so that the symbols that disappear
are those of Khalil's symbolic rules.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

from .chain import Chain
from .parameters import DEFAULT_GROUPS, PER_JOINT, SYMBOLS, group_columns, standard_parameters
from .regressor import regressor

Array = NDArray[np.float64]

RANDOM_STATES = 256
# A dependent column's R_jj is at rounding level, an independent one's orders above it.
RANK_TOLERANCE = 1e-9
COEFFICIENT_TOLERANCE = 1e-10


@dataclass(frozen=True)
class BaseParameters:
    """The identifiable combinations of a chain's standard parameters.

    columns: (b,) indices into the standard vector; the base regressor is these columns.
    projection: (b, 14 n); base values = projection @ standard values.
    names: b strings that spell the regrouping, such as "ZZ_1 + Ia_1 + YY_2".
    units: b strings.
    """

    columns: NDArray[np.int64]
    projection: Array
    names: tuple[str, ...]
    units: tuple[str, ...]

    @property
    def count(self) -> int:
        """Number of base parameters, b."""
        return len(self.columns)

    def values(self, standard: Array) -> Array:
        """Base values (b,) of a standard vector (14 n,)."""
        return self.projection @ standard


def base_parameters(chain: Chain, groups: Sequence[str] = DEFAULT_GROUPS, seed: int = 0) -> BaseParameters:
    """The base parameters of the chosen parameter groups, from random states of the chain.

    Raises InputError for a group that does not exist.
    """
    rng = np.random.default_rng(seed)
    shape = (RANDOM_STATES, chain.joints)
    q, dq, ddq = (rng.uniform(-np.pi, np.pi, shape) for _ in range(3))
    candidates = _regrouping_order(group_columns(chain.joints, groups))
    matrix = regressor(chain, q, dq, ddq, candidates).reshape(-1, len(candidates))
    scale = np.linalg.norm(matrix, axis=0)
    # A parameter that loads no joint at all drops out of every combination.
    seen = scale > RANK_TOLERANCE * scale.max()
    candidates, scale = candidates[seen], scale[seen]
    matrix = matrix[:, seen] / scale
    independent, dependent = _independent_columns(matrix)
    upper = np.asarray(np.linalg.qr(matrix[:, np.r_[independent, dependent]], mode="r"))
    b = len(independent)
    regrouping = solve_triangular(upper[:b, :b], upper[:b, b:])
    regrouping *= scale[dependent] / scale[independent, None]
    regrouping[np.abs(regrouping) < COEFFICIENT_TOLERANCE] = 0.0
    projection = np.zeros((b, PER_JOINT * chain.joints))
    projection[np.arange(b), candidates[independent]] = 1.0
    projection[:, candidates[dependent]] = regrouping
    order = np.argsort(candidates[independent])
    columns, projection = candidates[independent][order], projection[order]
    standard = standard_parameters(chain.is_slide)
    return BaseParameters(
        columns=columns,
        projection=projection,
        names=tuple(
            _name(row, int(column), [p.name for p in standard])
            for row, column in zip(projection, columns, strict=True)
        ),
        units=tuple(standard[column].unit for column in columns),
    )


def _regrouping_order(columns: NDArray[np.int64]) -> NDArray[np.int64]:
    """Columns with those last that should be regrouped into others: Ia, then YY, MZ, M."""
    rank = {"Ia": 1, "YY": 2, "MZ": 3, "M": 4}
    ranks = [rank.get(SYMBOLS[column % PER_JOINT], 0) for column in columns]
    return columns[np.argsort(ranks, kind="stable")]


def _independent_columns(matrix: Array) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Indices of columns independent of those before them, and of the rest (modified Gram-Schmidt)."""
    basis = np.empty((0, matrix.shape[0]))
    independent, dependent = [], []
    for index, column in enumerate(matrix.T):
        rest = column - basis.T @ (basis @ column)
        rest -= basis.T @ (basis @ rest)
        norm = float(np.linalg.norm(rest))
        if norm > RANK_TOLERANCE:
            basis = np.vstack([basis, rest / norm])
            independent.append(index)
        else:
            dependent.append(index)
    return np.array(independent, dtype=np.int64), np.array(dependent, dtype=np.int64)


def _name(row: Array, leader: int, names: list[str]) -> str:
    """The regrouping in standard parameters, its leading parameter first."""
    text = names[leader]
    for index in np.flatnonzero(row):
        if index == leader:
            continue
        factor = f"{abs(row[index]):.4g}"
        sign = "-" if row[index] < 0 else "+"
        text += f" {sign} {names[index]}" if factor == "1" else f" {sign} {factor} {names[index]}"
    return text
