"""Base parameters: which combinations of standard parameters the torques can reveal.

Numerical method of Gautier (1991), "Numerical calculation of the base inertial parameters of
robots": the QR decomposition of the regressor at random states. Column j depends on the columns
before it when R_jj vanishes; its parameter is regrouped into theirs,
beta = X1 + R1^-1 R2 X2. The order puts YY, MZ and M last, so that the symbols that disappear
are those of Khalil's symbolic rules. What vanishes but for a rounded right angle in the model (1.57
for pi / 2) counts as vanished: it is regrouped by least squares.
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
# R_jj over the column's size, about the sine of the angle by which axes miss being parallel or square: 0.3
# degrees. Angles rounded to 1.57 and 3.14 leave up to 0.0016, what is independent on real arms 0.11 and more.
RANK_TOLERANCE = 5e-3
# What is left of a column that is truly zero, against the largest.
ZERO_TOLERANCE = 1e-9
# A regrouped term that carries less of its column than this is rounding, the model's or ours.
COEFFICIENT_TOLERANCE = 1e-4


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
    candidates = _regrouping_order(group_columns(chain.links, groups))
    matrix = regressor(chain, q, dq, ddq, candidates).reshape(-1, len(candidates))
    scale = np.linalg.norm(matrix, axis=0)
    # A parameter that loads no joint at all drops out of every combination.
    seen = scale > ZERO_TOLERANCE * scale.max()
    candidates, matrix, scale = candidates[seen], matrix[:, seen] / scale[seen], scale[seen]
    standard = standard_parameters(chain.link_slides)
    share = _share_of_usual(scale, [standard[column].unit for column in candidates])
    independent, dependent = _independent_columns(matrix, share)
    upper = np.asarray(np.linalg.qr(matrix[:, np.r_[independent, dependent]], mode="r"))
    b = len(independent)
    regrouping = solve_triangular(upper[:b, :b], upper[:b, b:])
    regrouping[np.abs(regrouping) < COEFFICIENT_TOLERANCE] = 0.0
    # A small column that no other explains, as first moments' on a base that is all but level, drops out too.
    regrouping[:, np.linalg.norm(upper[b:, b:], axis=0) > 0.5] = 0.0
    regrouping *= scale[dependent] / scale[independent, None]
    projection = np.zeros((b, PER_JOINT * chain.links))
    projection[np.arange(b), candidates[independent]] = 1.0
    projection[:, candidates[dependent]] = regrouping
    order = np.argsort(candidates[independent])
    columns, projection = candidates[independent][order], projection[order]
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


def _share_of_usual(scale: Array, units: list[str]) -> Array:
    """Each column's norm over the RMS norm of the columns of its unit, at most 1; (c,)."""
    kinds = np.array(units)
    usual = [np.sqrt(np.mean(scale[kinds == unit] ** 2)) for unit in units]
    return np.minimum(scale / usual, 1.0)


def _independent_columns(matrix: Array, share: Array) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Indices of columns independent of those before them, and of the rest (modified Gram-Schmidt).

    matrix: columns of unit norm. share: (c,), their size against what is usual.
    """
    basis = np.empty((0, matrix.shape[0]))
    independent, dependent = [], []
    for index, column in enumerate(matrix.T):
        rest = column - basis.T @ (basis @ column)
        rest -= basis.T @ (basis @ rest)
        norm = float(np.linalg.norm(rest))
        if norm * share[index] > RANK_TOLERANCE:
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
