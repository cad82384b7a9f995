"""Linearisation of effects at the loads and derivatives of the parameters fitted so far."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from identification.parameters import INERTIAL, PER_JOINT
from testbench.effects import effect

from ..data.run import Prepared
from ..model.base_regressor import BaseRegressor
from ..model.candidate import ZERO, Candidate
from ..model.candidates import candidate
from ..model.hypothesis import LATE, Design
from .delay import likeliest_delay
from .encoder_zeros import FAR_OFF, likeliest_zero
from .normal_equations import Fit, fitted_to, standard_values

Array = NDArray[np.float64]


def bends_parameters(each: Candidate) -> bool:
    """Whether re-identification takes it up, moving parameters that its own columns are taken at."""
    return each.family.swallowed and each.description.relinearised


def first_linearised(prepared: Prepared, seeks_zero: bool = True) -> Prepared:
    """The runs linearised at their re-identification, with a large encoder offset or a long delay if any."""
    hypothesis, fitted = fitted_to(BaseRegressor(prepared), [])
    values = fitted.values
    zeros = np.zeros(prepared.joints)
    if seeks_zero and (zero := likeliest_zero(hypothesis, fitted)) is not None:
        values, zeros[zero.joint] = zero.values, zero.offset
    elif abs(values[hypothesis.timing]) > LATE:
        # A delay may have bent all parameters.
        _, values = likeliest_delay(hypothesis, fitted)
    return _linearised(hypothesis, values, (), zeros)[0]


def linearised_anew(hypothesis: Design, fitted: Fit) -> tuple[Design, Fit]:
    """The hypothesis with the runs linearised at what was fitted, a delay at its own size; and its fit."""
    values, shapes = fitted.values, [each.member.shape for each in hypothesis.accepted]
    zeros = hypothesis.prepared.zeros.copy()
    for place, (each, own) in enumerate(zip(hypothesis.accepted, hypothesis.parts, strict=True)):
        if each.is_common_delay:
            delay, values = likeliest_delay(hypothesis, fitted)
            shapes[place] = {"difference": delay}
        if each.family.effect == ZERO and abs(offset := float(fitted.values[own][0])) > FAR_OFF:
            zeros[each.family.joint] = offset
    prepared, accepted = _linearised(hypothesis, values, shapes, zeros)
    return fitted_to(BaseRegressor(prepared), accepted)


def _linearised(
    hypothesis: Design, values: Array, shapes: Sequence[Mapping[str, float]], zeros: Array
) -> tuple[Prepared, list[Candidate]]:
    """The runs with loads and derivatives taken at a hypothesis's unknowns (p,), and its effects there.

    What the last link has more is part of the load. shapes: of the effects. zeros: (n,) rad, as of Logged.
    """
    prepared = hypothesis.prepared
    parameters = standard_values(prepared, values)
    for each, own in zip(hypothesis.accepted, hypothesis.parts, strict=True):
        if each.description.of_last_link:
            parameters[PER_JOINT * prepared.robot.chain.last :][:INERTIAL] += values[own]
    accepted, passed = list(hypothesis.accepted), []

    def again(there: Prepared, loads: bool) -> list[Array]:
        """The effects that load the gearboxes, or the others, recomputed; their torque, a run (N, n)."""
        passed.append(there)
        known = [np.zeros_like(run.logged.tau) for run in prepared.runs]
        for place, (each, own) in enumerate(zip(hypothesis.accepted, hypothesis.parts, strict=True)):
            if each.description.loads != loads:
                continue
            accepted[place] = replace(_again(there, each, shapes[place]), is_carried=loads)
            member = accepted[place].member
            if not each.description.of_last_link:
                for torque, columns in zip(known, member.columns, strict=True):
                    torque[:, list(member.rows)] += columns @ values[own]
        return known

    nothing = [np.zeros_like(run.logged.tau) for run in prepared.runs]
    # What the gearboxes carry is known before what depends on it.
    carried = again(prepared.linearised_at(parameters, nothing, nothing, zeros), loads=True)
    beside = again(prepared.linearised_at(parameters, carried, nothing, zeros), loads=False)
    # Little is asked again of the runs as they were linearised before, and on the way.
    for there in (prepared, *passed):
        for run in there.runs:
            run.logged.let_go()
    return prepared.linearised_at(parameters, carried, beside, zeros), accepted


def _again(prepared: Prepared, old: Candidate, shape: Mapping[str, float]) -> Candidate:
    """The same effect recomputed after the runs were linearised anew. shape: of the member."""
    if old.is_event:
        # A push's columns are of the motion alone.
        return old
    logged = [run.logged for run in prepared.runs]
    family = effect(old.family.effect).signature(logged, old.family.joint, old.family.into)
    member = family.at(shape)
    assert member is not None
    return candidate(prepared, family, member)
