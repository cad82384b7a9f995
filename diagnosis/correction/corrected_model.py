"""The corrected model of a diagnosis, by its fits."""

from ..decision.findings import Diagnosis
from ..fit.normal_equations import Fit, standard_values
from ..held_out.recurrence import Recurrence
from ..held_out.shrinkage import Kept
from ..model.hypothesis import Design
from .correction_document import Corrected, Term


def corrected_model(diagnosis: Diagnosis) -> Corrected:
    """The corrected model of a diagnosis."""
    return corrected_by(diagnosis.parameters_only[1], diagnosis.final, diagnosis.recurrence, diagnosis.kept)


def corrected_by(only: Fit, final: tuple[Design, Fit], again: Recurrence | None, kept: Kept) -> Corrected:
    """The corrected model by the fit of parameters alone and that with the effects.

    again: a push that every run has. kept: how much of what was fitted.
    """
    hypothesis, fitted = final
    prepared = hypothesis.prepared
    robot, logged = prepared.robot, prepared.runs[0].logged
    terms = [
        Term(*accepted.place, dict(accepted.member.shape), fitted.values[part], accepted.is_carried)
        for accepted, part in zip(hypothesis.accepted, hypothesis.parts, strict=True)
        if not accepted.is_event
    ]
    # A push of one run says nothing of another's.
    if again is not None:
        terms.append(Term(*again.pushed.place, dict(again.pushed.member.shape), again.coefficients))
    return Corrected(
        chain=robot.chain,
        limits=robot.limits,
        nominal=robot.parameters,
        parameters=standard_values(prepared, only.values),
        parameters_timing=float(only.values[hypothesis.timing]),
        final=standard_values(prepared, fitted.values),
        final_timing=float(fitted.values[hypothesis.timing]),
        lag=prepared.lag,
        linearised=logged.parameters,
        coulomb_smoothing=prepared.coulomb_smoothing,
        coulomb_lead=prepared.coulomb_lead,
        zeros=prepared.zeros,
        body_rotation=logged.body_rotation,
        body_origin=logged.body_origin,
        terms=tuple(terms),
        kept=kept,
        band=prepared.cutoff,
    )
