"""Runs that differ: one carries a tool, or has other offsets or other friction, as on another day or warm.

Fitted as runs of one robot they bend its parameters. Each run is given a payload on the last link, offsets,
or friction, of its own beside the parameters of all; what explains most of what is left goes first, until
nothing explains much. Its torque is taken off that run, which is then one of the robot's like the others.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from identification.parameters import COULOMB, INERTIAL, PER_JOINT, VISCOUS
from testbench.effects import effect
from testbench.effects.signature import Quantity

from ..data.preparation import Prepared, Run
from ..fit.linearisation import PAYLOAD
from ..fit.normal_equations import Fit, fitted_to, normal_of
from ..model.base_regressor import ground
from ..model.candidates import Candidate, candidate
from ..model.effect_sizes import is_plausible
from ..model.hypothesis import Design, scaled_precision
from .known_payload import known_payload

Array = NDArray[np.float64]

OFFSETS, FRICTION = "offsets", "friction"
# A run differs where this share of the weighted squares that all runs leave goes with it, and this many
# standard deviations of its payload's mass, or of its offsets together.
SHARE, SURELY = 0.4, 8.0
# And a mass is of this share of the arm's links, an offset or Coulomb friction of this share of the joint's
# torque, at least.
LEAST_MASS, LEAST_OFFSET = 0.005, 0.02
# Of the weighted squares at least this share is noise, not what one run has of its own.
LEAST_LEFT = 0.01
# A drive's gain is reported where it is known this well, relative.
TOLD = 0.05


@dataclass(frozen=True)
class Difference:
    """A payload, torque offsets, or friction, that one run has and the others have not.

    run: its name. kind: PAYLOAD, OFFSETS or FRICTION. mass: kg, of a payload. offsets: (n,) N·m, zero but of
    OFFSETS. friction: (2, n) N·m·s/rad and N·m, viscous and Coulomb beyond that of the others; of FRICTION.
    gains, deviations: (n,) of the drives by a payload of known mass, relative, true = (1 + gain) reported.
    """

    run: str
    kind: str
    mass: Quantity | None
    offsets: Array
    gains: Array | None = None
    deviations: Array | None = None
    friction: Array | None = None


@dataclass(frozen=True)
class _Own:
    """A run's own columns, filtered (M, n, k) and at full rate (N, n, k), with what they explain."""

    index: int
    kind: str
    whole: Array
    coefficients: Array
    covariance: Array
    share: float
    payload: Candidate | None


def without_differences(
    prepared: Prepared, masses: Mapping[str, float] | None = None
) -> tuple[Prepared, tuple[Difference, ...]]:
    """The runs with what one has and others have not taken off its torque, and what that is.

    masses: kg, of payloads that are known to be in a run and in no other, by its name.
    """
    found: list[Difference] = []
    payload = _payload(prepared)
    for index, run in enumerate(prepared.runs):
        if masses and run.name in masses:
            known = known_payload(prepared, index, payload, masses[run.name])
            torque = known.reported * (np.asarray(payload.member.columns[index]) @ known.coefficients)
            prepared = _with_run(prepared, index, _taken_off(run, torque))
            mass = Quantity(masses[run.name], 0.0, "kg")
            zeros = np.zeros(prepared.joints)
            found.append(Difference(run.name, PAYLOAD, mass, zeros, known.gains, known.deviations))
    while len(found) < len(prepared.runs) - 1:
        taken = {each.run for each in found}
        best = _most(prepared, payload, taken)
        if best is None:
            break
        run = prepared.runs[best.index]
        found.append(_in_numbers(run, best))
        prepared = _with_run(prepared, best.index, _taken_off(run, best.whole @ best.coefficients))
    return prepared, tuple(found)


def in_words(differences: Sequence[Difference], names: Sequence[str], units: Sequence[str]) -> list[str]:
    """A sentence a run that differs. names, units: of the joints."""
    said = []
    for each in differences:
        if each.mass is not None and each.gains is not None and each.deviations is not None:
            told = [
                f"{names[j]} {1 + each.gains[j]:.3f} ± {each.deviations[j]:.1g}"
                for j in np.flatnonzero(each.deviations < TOLD).tolist()
            ]
            by = f"true over reported torque is {', '.join(told)}" if told else "it tells no drive's gain"
            said.append(f"By the {each.mass.value:g} kg that {each.run} carries, {by}.")
            continue
        if each.mass is not None:
            said.append(
                f"{each.run} carries {each.mass.value:.3g} ± {each.mass.std:.1g} kg that other runs do not; "
                "it is taken off before the fit."
            )
            continue
        if each.friction is not None:
            largest = int(np.argmax(np.abs(each.friction[1])))
            more = f"{each.friction[1, largest]:+.3g} {units[largest]} at {names[largest]}"
            said.append(
                f"{each.run} has other friction than other runs, Coulomb {more}, as warm or cold joints "
                "have; it is taken off before the fit."
            )
            continue
        largest = int(np.argmax(np.abs(each.offsets)))
        said.append(
            f"{each.run} has other offsets of torque than other runs, {each.offsets[largest]:.3g} "
            f"{units[largest]} at {names[largest]}; they are taken off before the fit."
        )
    return said


def _payload(prepared: Prepared) -> Candidate:
    family = effect(PAYLOAD).signature([run.logged for run in prepared.runs], None, None)
    return candidate(prepared, family, family.members[0])


def _most(prepared: Prepared, payload: Candidate, taken: set[str]) -> _Own | None:
    """The difference that explains most of all runs' residuals, of those that are large and certain."""
    hypothesis, fitted = fitted_to(prepared, [])
    tried = [
        _explained(hypothesis, fitted, index, kind, payload)
        for index, run in enumerate(prepared.runs)
        if run.name not in taken
        for kind in (PAYLOAD, OFFSETS, FRICTION)
    ]
    able = [own for own in tried if own is not None and own.share > SHARE and _is_large(prepared, own)]
    return max(able, key=lambda own: own.share, default=None)


def _explained(hypothesis: Design, fitted: Fit, index: int, kind: str, payload: Candidate) -> _Own | None:
    """Fit of a run's own payload, friction or offsets, besides the parameters shared by all runs.

    None where the run shows nothing of this kind.
    """
    prepared, base = hypothesis.prepared, ground(hypothesis.prepared)
    run, n = prepared.runs[index], hypothesis.prepared.joints
    if kind == PAYLOAD:
        whole, z = np.asarray(payload.member.columns[index]), payload.filtered[index]
        precision = payload.precision
    elif kind == FRICTION:
        each = (run.logged.dq, run.logged.direction)
        whole = np.concatenate([values[:, :, None] * np.eye(n) for values in each], axis=2)
        joints = PER_JOINT * np.arange(n)
        z = np.concatenate(
            [run.rows[:, np.arange(n), joints + own][:, :, None] * np.eye(n) for own in (VISCOUS, COULOMB)],
            axis=2,
        )
        precision = np.zeros(2 * n)
    else:
        whole = np.broadcast_to(np.eye(n), (run.logged.samples, n, n))
        z = np.broadcast_to(np.eye(n), (len(run.time), n, n))
        precision = np.zeros(n)
    z = z * run.used[:, :, None]
    k = z.shape[2]
    matrix = normal_of(hypothesis).weighted(fitted.weights)[0].sum(axis=0)
    matrix[np.diag_indices_from(matrix)] += scaled_precision(hypothesis, fitted.prior_scales)
    cross, own, right = np.zeros((base.parameters, k)), np.diag(precision).astype(float), np.zeros(k)
    for joint, weight in enumerate(fitted.weights):
        part = z[:, joint]
        cross[base.loading[joint]] += weight * (base.columns(index, joint).T @ part)
        own += weight * (part.T @ part)
        right += weight * (part.T @ fitted.residual[index][:, joint])
    shows = np.diag(own) > precision
    if not shows.any():
        return None
    cross, own, right = cross[:, shows], own[np.ix_(shows, shows)], right[shows]
    schur = own - cross.T @ np.linalg.solve(matrix, cross)
    covariance = np.linalg.pinv(schur, hermitian=True)
    coefficients = covariance @ right
    left = float(sum(np.sum(fitted.weights * r**2) for r in fitted.residual))
    found, full = np.zeros(k), np.zeros((k, k))
    found[shows], full[np.ix_(shows, shows)] = coefficients, covariance
    share = float(right @ coefficients) / max(left, 1e-300)
    # The weights take what it explains for noise.
    full *= max(1 - share, LEAST_LEFT)
    return _Own(index, kind, whole, found, full, share, payload if kind == PAYLOAD else None)


def _is_large(prepared: Prepared, own: _Own) -> bool:
    """Whether a payload could be one, or offsets or friction are not next to nothing, and that is sure."""
    if own.payload is not None:
        mass, deviation = own.coefficients[INERTIAL - 1], np.sqrt(own.covariance[INERTIAL - 1, INERTIAL - 1])
        links = float(prepared.nominal.reshape(prepared.joints, -1)[:, INERTIAL - 1].sum())
        sure = mass > max(SURELY * deviation, LEAST_MASS * links)
        return bool(sure) and is_plausible(prepared.robot, own.payload, own.coefficients)
    # Of friction, Coulomb's.
    n = prepared.joints
    deviations = np.sqrt(np.maximum(np.diag(own.covariance)[-n:], np.finfo(float).tiny))
    values = np.abs(own.coefficients[-n:])
    large = values > LEAST_OFFSET * ground(prepared).torque_rms
    return bool(np.any(large & (values > SURELY * deviations)))


def _in_numbers(run: Run, own: _Own) -> Difference:
    zeros = np.zeros(own.whole.shape[1])
    if own.kind == OFFSETS:
        return Difference(run.name, OFFSETS, None, own.coefficients)
    if own.kind == FRICTION:
        return Difference(run.name, FRICTION, None, zeros, friction=own.coefficients.reshape(2, -1))
    mass = float(own.coefficients[INERTIAL - 1])
    deviation = float(np.sqrt(own.covariance[INERTIAL - 1, INERTIAL - 1]))
    return Difference(run.name, PAYLOAD, Quantity(mass, deviation, "kg"), zeros)


def _with_run(prepared: Prepared, index: int, run: Run) -> Prepared:
    runs = [run if k == index else each for k, each in enumerate(prepared.runs)]
    return replace(prepared, runs=tuple(runs))


def _taken_off(run: Run, torque: Array) -> Run:
    """The run without the torque (N, n) of what it has of its own."""
    filtered = run.filtered(np.ascontiguousarray(torque), range(torque.shape[1]))
    return replace(run, torque=run.torque - filtered, logged=replace(run.logged, tau=run.logged.tau - torque))
