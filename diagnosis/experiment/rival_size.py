"""Likely size of a rival effect: as fitted, as fitted in another's place, or as is typical."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from testbench.effects import effect
from testbench.effects.size import typical_values

from ..decision.findings import Diagnosis
from ..fit.likelihood import weigh
from ..fit.normal_equations import fitted_to
from ..fit.score import Stage
from ..model.candidates import candidate
from ..model.gram import Bank
from .rivals import Open, Rival

Array = NDArray[np.float64]

LITTLE = 1e-3


@dataclass(frozen=True)
class Sized:
    """A rival at one size. shape: of its family's member. coefficients: (k,) of that member's columns."""

    shape: dict[str, float]
    coefficients: Array


def sized(diagnosis: Diagnosis, open_: Open, rival: Rival) -> Sized | None:
    """A rival at its likely size; None where it has none.

    A named effect's is the one fitted; its rivals' is what is fitted in its place, and what is not observable
    is taken at a typical size.
    """
    if not open_.confused:
        return _typical(diagnosis, rival)
    return _fitted(diagnosis, rival) or _in_place_of(diagnosis, open_.rivals[0], rival)


def _fitted(diagnosis: Diagnosis, rival: Rival) -> Sized | None:
    hypothesis, fitted = diagnosis.final
    for accepted, part in zip(hypothesis.accepted, hypothesis.parts, strict=True):
        if accepted.place == (rival.effect, rival.joint, rival.into):
            return Sized(dict(accepted.member.shape), fitted.values[part])
    return None


def _in_place_of(diagnosis: Diagnosis, first: Rival, rival: Rival) -> Sized | None:
    """The rival as it is fitted where the first one is left out, by the measure of the diagnosis."""
    hypothesis = diagnosis.final[0]
    prepared, base = hypothesis.prepared, hypothesis.base
    rest = [each for each in hypothesis.accepted if each.place != (first.effect, first.joint, first.into)]
    logged = [run.logged for run in prepared.runs]
    family = effect(rival.effect).signature(logged, rival.joint, rival.into)
    members = [candidate(prepared, family, member) for member in family.members]
    weighed = weigh(Stage.of(base, rest), Bank(base, members)) if members else []
    if not weighed:
        return None
    best = weighed[0].candidate
    coefficients = fitted_to(base, [*rest, best])[1].values[-best.count :]
    # A rival whose signs forbid it to imitate has no size of its own.
    return Sized(dict(best.member.shape), coefficients) if np.any(coefficients != 0) else None


def _typical(diagnosis: Diagnosis, rival: Rival) -> Sized | None:
    """The middle of the family's grid, its coefficients such that its size comes out typical."""
    logged = diagnosis.prepared.runs[0].logged.as_predicted()
    family = effect(rival.effect).signature([logged], rival.joint, rival.into)
    if not family.members:
        return None
    member = family.members[len(family.members) // 2]
    wanted = typical_values(effect(rival.effect).DESCRIPTION, diagnosis.robot, rival.joint)
    covariance = np.zeros((member.count + len(family.refine),) * 2)
    # So little that a gain's size is still straight in its coefficient.
    unit = np.clip(np.full(member.count, LITTLE), member.lower, member.upper)
    once, twice = (family.parameters(member, factor * unit, covariance) for factor in (1.0, 2.0))
    size = 1.0
    for name, quantity in once.items():
        value, doubled = quantity.value, twice[name].value
        if name in wanted and name not in member.shape and isinstance(value, float):
            if not (isinstance(doubled, float) and value * doubled > 0 and value != doubled):
                continue
            # A stiffness goes with the inverse of its column's coefficient.
            size = float(abs(wanted[name] / value) ** (1 / np.log2(doubled / value)))
            break
    return Sized(dict(member.shape), np.clip(size * unit, member.lower, member.upper))
