"""Runs that differ: some carry a tool, or have other offsets or other friction, as on another day or warm.

Fitted as runs of one robot they bend its parameters. All runs but one are given a payload on the last link,
offsets, or friction, of their own beside the parameters of all; what explains most of what is left goes
first, until nothing explains much. Its torque is taken off those runs, which then are of the same robot.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from identification.parameters import COULOMB, MASS, PER_JOINT, VISCOUS
from testbench.effects import effect
from testbench.effects.signature import Quantity

from ..data.run import Prepared, Run
from ..fit.normal_equations import Fit, fitted_to
from ..model.base_regressor import BaseRegressor
from ..model.candidate import Candidate
from ..model.candidates import candidate
from ..model.effect_sizes import SMALLEST_TORQUE, is_plausible
from ..model.hypothesis import Design, scaled_precision
from .difference import FRICTION, OFFSETS, PAYLOAD, Difference
from .known_payload import known_payloads

Array = NDArray[np.float64]

# Runs differ where this share of the weighted squares that all runs leave goes with what they have of their
# own, and each by this many standard deviations of its payload's mass, or of an offset.
SHARE, SURELY = 0.4, 8.0
# Of the weighted squares at least this share is noise, not what one run has of its own.
LEAST_LEFT = 0.01


@dataclass(frozen=True)
class _Columns:
    """Columns of one kind that each run may have of its own, and their products.

    payload: of PAYLOAD alone. cross: a run, (p, k) with the parameters' columns. own: a run, (k, k), with the
    prior. right: a run, (k,) with the residual. shows: a run, (k,) of those of which it shows anything.
    """

    kind: str
    payload: Candidate | None
    cross: tuple[Array, ...]
    own: tuple[Array, ...]
    right: tuple[Array, ...]
    shows: tuple[NDArray[np.bool_], ...]


@dataclass(frozen=True)
class _Own:
    """Coefficients (k,) of some runs, by their index, with covariances, and the share that they explain."""

    columns: _Columns
    coefficients: Mapping[int, Array]
    covariance: Mapping[int, Array]
    share: float


def without_differences(
    prepared: Prepared, masses: Mapping[str, float] | None = None
) -> tuple[Prepared, tuple[Difference, ...]]:
    """The runs with what some have and others have not taken off their torque, and what that is.

    masses: kg, of payloads that are known to be in a run, and in no run that is not among them, by its name.
    """
    found: list[Difference] = []
    payload, stated = _payload(prepared), masses or {}
    if known := {k: stated[run.name] for k, run in enumerate(prepared.runs) if run.name in stated}:
        carried = known_payloads(BaseRegressor(prepared), payload, known)
        for (index, kilograms), coefficients in zip(known.items(), carried.coefficients, strict=True):
            torque = carried.reported * (np.asarray(payload.member.columns[index]) @ coefficients)
            prepared = _without(prepared, index, torque)
            name, mass = prepared.runs[index].name, Quantity(kilograms, 0.0, "kg")
            zeros = np.zeros(prepared.joints)
            found.append(Difference(name, PAYLOAD, mass, zeros, carried.gains, None, carried.deviations))
    while True:
        taken = {each.run for each in found}
        able = [index for index, run in enumerate(prepared.runs) if run.name not in taken]
        best = _most(prepared, payload, able) if len(able) > 1 else None
        if best is None:
            return prepared, tuple(found)
        for index in sorted(best.coefficients):
            run = prepared.runs[index]
            found.append(_in_numbers(run, best, index))
            torque = _whole(run, index, best.columns.kind, payload) @ best.coefficients[index]
            prepared = _without(prepared, index, torque)


def _payload(prepared: Prepared) -> Candidate:
    family = effect(PAYLOAD).signature([run.logged for run in prepared.runs], None, None)
    return candidate(prepared, family, family.members[0])


def _most(prepared: Prepared, payload: Candidate, able: Sequence[int]) -> _Own | None:
    """The differences of one kind that explain most of all runs' residuals, of those large and certain."""
    hypothesis, fitted = fitted_to(BaseRegressor(prepared), [])
    matrix = hypothesis.weighted(fitted.weights)[0].sum(axis=0)
    matrix[np.diag_indices_from(matrix)] += scaled_precision(hypothesis, fitted.prior_scales)
    total = float(sum(np.sum(fitted.weights * r**2) for r in fitted.residual))
    tried = []
    for kind in (PAYLOAD, OFFSETS, FRICTION):
        columns = _columns(hypothesis, fitted, kind, payload)
        shown = [index for index in able if columns.shows[index].any()]
        # One run is like the robot, where none is known to be.
        if len(able) == len(prepared.runs) and len(shown) > 1:
            shown.remove(_reference(columns, _fitted(columns, matrix, total, shown)))
        own = _fitted(columns, matrix, total, shown)
        large = [index for index in shown if _is_large(hypothesis.base, own, index)]
        if large and len(large) < len(shown):
            own = _fitted(columns, matrix, total, large)
        if large and own.share > SHARE and all(_is_large(hypothesis.base, own, index) for index in large):
            tried.append(own)
    return max(tried, key=lambda own: own.share, default=None)


def _reference(columns: _Columns, own: _Own) -> int:
    """The run that the others differ from: the one that carries least, or that is nearest to the others."""
    indices = list(own.coefficients)
    if columns.kind == PAYLOAD:
        return min(indices, key=lambda index: own.coefficients[index][MASS])
    values = np.array([own.coefficients[index] for index in indices])
    scale = np.sqrt(np.mean([np.diag(own.covariance[index]) for index in indices], axis=0))
    apart = np.abs(values[:, None] - values) / np.maximum(scale, np.finfo(float).tiny)
    return indices[int(np.argmin(apart.sum(axis=(1, 2))))]


def _columns(hypothesis: Design, fitted: Fit, kind: str, payload: Candidate) -> _Columns:
    prepared, base = hypothesis.prepared, hypothesis.base
    n = prepared.joints
    parts: list[tuple[Array, Array, Array, NDArray[np.bool_]]] = []
    for index, run in enumerate(prepared.runs):
        z, precision = _of_run(run, index, kind, payload, n)
        z = z * run.used[:, :, None]
        k = z.shape[2]
        cross, own, right = np.zeros((base.parameters, k)), np.diag(precision).astype(float), np.zeros(k)
        for joint, weight in enumerate(fitted.weights):
            part = z[:, joint]
            cross[base.loading[joint]] += weight * (base.columns(index, joint).T @ part)
            own += weight * (part.T @ part)
            right += weight * (part.T @ fitted.residual[index][:, joint])
        parts.append((cross, own, right, np.diag(own) > precision))
    cross_, own_, right_, shows_ = zip(*parts, strict=True)
    return _Columns(kind, payload if kind == PAYLOAD else None, cross_, own_, right_, shows_)


def _of_run(run: Run, index: int, kind: str, payload: Candidate, n: int) -> tuple[Array, Array]:
    """Columns of a run's own, filtered (M, n, k), and their precision (k,)."""
    if kind == PAYLOAD:
        return payload.filtered[index], payload.precision
    if kind == FRICTION:
        filtered = (np.column_stack([rows[:, own] for rows in run.rows]) for own in (VISCOUS, COULOMB))
        return np.concatenate([values[:, :, None] * np.eye(n) for values in filtered], axis=2), np.zeros(
            2 * n
        )
    return np.broadcast_to(np.eye(n), (len(run.time), n, n)), np.zeros(n)


def _whole(run: Run, index: int, kind: str, payload: Candidate) -> Array:
    """The same at full rate, (N, n, k): too large to be kept of all runs."""
    n = run.logged.joints
    if kind == PAYLOAD:
        return np.asarray(payload.member.columns[index])
    if kind == FRICTION:
        each = (run.logged.dq, run.logged.direction)
        return np.concatenate([values[:, :, None] * np.eye(n) for values in each], axis=2)
    return np.broadcast_to(np.eye(n), (run.logged.samples, n, n))


def _fitted(columns: _Columns, matrix: Array, total: float, runs: Sequence[int]) -> _Own:
    """Joint fit of some runs' own coefficients, beside the parameters shared by all.

    matrix: (p, p) of the parameters' normal equations. total: weighted squares that these leave.
    """
    if not runs:
        return _Own(columns, {}, {}, 0.0)
    shows = [columns.shows[index] for index in runs]
    cross = np.hstack([columns.cross[index][:, seen] for index, seen in zip(runs, shows, strict=True)])
    own = block_diag(
        *(columns.own[index][np.ix_(seen, seen)] for index, seen in zip(runs, shows, strict=True))
    )
    right = np.concatenate([columns.right[index][seen] for index, seen in zip(runs, shows, strict=True)])
    covariance = np.linalg.pinv(own - cross.T @ np.linalg.solve(matrix, cross), hermitian=True)
    values = covariance @ right
    share = float(right @ values) / max(total, 1e-300)
    # The weights take what it explains for noise.
    covariance *= max(1 - share, LEAST_LEFT)
    coefficients: dict[int, Array] = {}
    covariances: dict[int, Array] = {}
    start = 0
    for index, seen in zip(runs, shows, strict=True):
        part = slice(start, start + int(seen.sum()))
        start = part.stop
        coefficients[index], covariances[index] = np.zeros(len(seen)), np.zeros((len(seen),) * 2)
        coefficients[index][seen] = values[part]
        covariances[index][np.ix_(seen, seen)] = covariance[part, part]
    return _Own(columns, coefficients, covariances, share)


def _is_large(base: BaseRegressor, own: _Own, index: int) -> bool:
    """Whether a payload could be one, or offsets or friction are not next to nothing, and that is sure."""
    prepared, coefficients, variances = base.prepared, own.coefficients[index], np.diag(own.covariance[index])
    if own.columns.payload is not None:
        # What is no less of the links' mass than an effect must be of the torque.
        mass, deviation = coefficients[MASS], np.sqrt(variances[MASS])
        links = float(prepared.nominal.reshape(-1, PER_JOINT)[:, MASS].sum())
        sure = mass > max(SURELY * deviation, SMALLEST_TORQUE * links)
        return bool(sure) and is_plausible(prepared.robot, own.columns.payload, coefficients)
    # Of friction, Coulomb's.
    n = prepared.joints
    deviations = np.sqrt(np.maximum(variances[-n:], np.finfo(float).tiny))
    values = np.abs(coefficients[-n:])
    large = values > SMALLEST_TORQUE * base.torque_rms
    return bool(np.any(large & (values > SURELY * deviations)))


def _in_numbers(run: Run, own: _Own, index: int) -> Difference:
    coefficients, kind = own.coefficients[index], own.columns.kind
    zeros = np.zeros(run.torque.shape[1])
    if kind == OFFSETS:
        return Difference(run.name, OFFSETS, None, coefficients)
    if kind == FRICTION:
        return Difference(run.name, FRICTION, None, zeros, friction=coefficients.reshape(2, -1))
    deviation = float(np.sqrt(own.covariance[index][MASS, MASS]))
    return Difference(run.name, PAYLOAD, Quantity(float(coefficients[MASS]), deviation, "kg"), zeros)


def _without(prepared: Prepared, index: int, torque: Array) -> Prepared:
    """The runs, one of them without the torque (N, n) N·m of what it has of its own."""
    runs = list(prepared.runs)
    run = runs[index]
    left = run.torque - run.filtered(np.ascontiguousarray(torque), range(torque.shape[1]))
    runs[index] = replace(run, torque=left, logged=replace(run.logged, tau=run.logged.tau - torque))
    return replace(prepared, runs=tuple(runs))
