"""The corrected model as plain numbers: all that is needed to predict torque along another motion."""

from collections.abc import Iterator
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.chain import Chain
from identification.errors import InputError
from identification.parameters import PER_JOINT
from testbench.chain_json import chain_document, read_chain
from testbench.effects import effects as catalogue
from testbench.robot import Limits, Robot
from testbench.torque_lag import TorqueLag

from ..data.run import CUTOFF
from ..decision.findings import Diagnosis
from ..fit.normal_equations import Fit
from ..held_out.recurring_push import Recurrence
from ..held_out.shrinkage import Kept, everything
from ..model.hypothesis import Design

Array = NDArray[np.float64]

LIMITS = ("lower", "upper", "velocity", "acceleration", "torque")


@dataclass(frozen=True)
class Term:
    """One effect of the corrected model: a member of its family, and the coefficients (k,) of its columns.

    joint, into: indices, None as in the catalogue. shape: the member's. is_carried: as of Candidate.
    """

    effect: str
    joint: int | None
    into: int | None
    shape: dict[str, float]
    coefficients: Array
    is_carried: bool = False


@dataclass(frozen=True)
class Corrected:
    """The model as given, re-identified, and with the effects; standard parameters (14 n,) each.

    chain, limits: of the model as given. nominal: as given. parameters: re-identified alone. final:
    beside the effects. lag: by which the logs have their torque late; parameters_timing, final_timing:
    and what is left of that beside them.
    linearised: (14 n,) that the effects' columns are taken at; zeros: (n,) rad, likewise, as of Logged.
    coulomb_smoothing, coulomb_lead: (n,) rad/s (m/s) and s, of Coulomb friction in what was re-identified, as
    of Logged. body_rotation (3, 3), body_origin (3,) m: the last body's frame in the last link's.
    kept: how much of what was fitted the torque has. band: (n,) Hz, below which the fit is of each joint.
    """

    chain: Chain
    limits: Limits
    nominal: Array
    parameters: Array
    parameters_timing: float
    final: Array
    final_timing: float
    lag: TorqueLag
    linearised: Array
    coulomb_smoothing: Array
    coulomb_lead: float
    zeros: Array
    body_rotation: Array
    body_origin: Array
    terms: tuple[Term, ...]
    kept: Kept
    band: Array


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
    parameters, parameters_timing = _standard(robot, only)
    with_effects, final_timing = _standard(robot, fitted)
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
        parameters=parameters,
        parameters_timing=parameters_timing,
        final=with_effects,
        final_timing=final_timing,
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


def _standard(robot: Robot, fitted: Fit) -> tuple[Array, float]:
    """Standard parameters (14 links,) and timing, s, of a fit."""
    count = len(robot.parameters)
    return robot.parameters + fitted.values[:count], float(fitted.values[count])


def correction_document(model: Corrected) -> dict[str, Any]:
    """The corrected model as JSON-able values; null for the limits that the model does not set."""
    chain = model.chain
    return {
        "chain": chain_document(chain),
        "limits": {
            name: [v if np.isfinite(v) else None for v in getattr(model.limits, name).tolist()]
            for name in LIMITS
        },
        "nominal": model.nominal.tolist(),
        "coulomb_smoothing": model.coulomb_smoothing.tolist(),
        "coulomb_lead": model.coulomb_lead,
        "lag": asdict(model.lag),
        "zeros": model.zeros.tolist(),
        "parameters": {"standard": model.parameters.tolist(), "timing": model.parameters_timing},
        "effects": {
            "standard": model.final.tolist(),
            "timing": model.final_timing,
            "linearised_at": model.linearised.tolist(),
            "terms": [
                {
                    "effect": term.effect,
                    "joint": _name(chain, term.joint),
                    "into": _name(chain, term.into),
                    "shape": term.shape,
                    "coefficients": term.coefficients.tolist(),
                    "carried": term.is_carried,
                }
                for term in model.terms
            ],
        },
        "kept": {
            "parameters": model.kept.parameters.tolist(),
            "effects": model.kept.effects.tolist(),
            "parameters_at_rest": model.kept.parameters_at_rest.tolist(),
            "effects_at_rest": model.kept.effects_at_rest.tolist(),
            "parameters_whole": model.kept.parameters_whole,
            "effects_whole": model.kept.effects_whole,
        },
        "band": model.band.tolist(),
        "last_body": {"rotation": model.body_rotation.tolist(), "origin": model.body_origin.tolist()},
        "units": "SI at the joint; 14 standard parameters a joint, timing in s, band in Hz",
    }


def read_correction(document: Any, source: object) -> Corrected:
    """The inverse of ``correction_document``. Raises InputError, naming ``source``, for anything else."""
    try:
        # Files of earlier versions keep all that was fitted, at all frequencies.
        chain, effects = read_chain(document["chain"]), document["effects"]
        unlimited = {"lower": -np.inf}
        limits = {
            name: [unlimited.get(name, np.inf) if v is None else v for v in document["limits"][name]]
            for name in LIMITS
        }
        read = Corrected(
            chain=chain,
            limits=Limits(**{name: np.array(values, dtype=np.float64) for name, values in limits.items()}),
            nominal=np.array(document["nominal"], dtype=np.float64),
            parameters=np.array(document["parameters"]["standard"], dtype=np.float64),
            parameters_timing=float(document["parameters"]["timing"]),
            final=np.array(effects["standard"], dtype=np.float64),
            final_timing=float(effects["timing"]),
            lag=TorqueLag(**document["lag"]),
            linearised=np.array(effects["linearised_at"], dtype=np.float64),
            coulomb_smoothing=np.array(document["coulomb_smoothing"], dtype=np.float64),
            coulomb_lead=float(document["coulomb_lead"]),
            zeros=np.array(document["zeros"], dtype=np.float64),
            body_rotation=np.array(document["last_body"]["rotation"], dtype=np.float64),
            body_origin=np.array(document["last_body"]["origin"], dtype=np.float64),
            terms=tuple(
                Term(
                    effect=term["effect"],
                    joint=_index(chain, term["joint"]),
                    into=_index(chain, term["into"]),
                    shape={name: float(value) for name, value in term["shape"].items()},
                    coefficients=np.array(term["coefficients"], dtype=np.float64),
                    is_carried=bool(term.get("carried", False)),
                )
                for term in effects["terms"]
            ),
            kept=_kept(document.get("kept"), chain.joints),
            band=np.array(document.get("band", [CUTOFF] * chain.joints), dtype=np.float64),
        )
        for name, values, shape in _shapes(read):
            if values.shape != shape or not np.isfinite(values).all():
                raise ValueError(f"{name} of shape {values.shape} instead of {shape}, or not finite")
        if read.lag.order not in (0, 1, 2):
            raise ValueError(f"a low-pass of order {read.lag.order!r}")
        unknown = [term.effect for term in read.terms if term.effect not in catalogue()]
        if unknown:
            raise ValueError(f"the effects {unknown}")
    except (KeyError, TypeError, ValueError, AttributeError, IndexError, OverflowError) as error:
        expected = "the corrected model as diagnose writes it"
        raise InputError(source, "correction", expected, f"{type(error).__name__}: {error}") from None
    return read


def _kept(document: Any, joints: int) -> Kept:
    """Shares of what was fitted; all of it where the document says none."""
    if document is None:
        return everything(joints)
    return Kept(
        parameters=np.array(document["parameters"], dtype=np.float64),
        effects=np.array(document["effects"], dtype=np.float64),
        # Files of earlier versions keep the same share near rest.
        parameters_at_rest=np.array(
            document.get("parameters_at_rest", document["parameters"]), dtype=np.float64
        ),
        effects_at_rest=np.array(document.get("effects_at_rest", document["effects"]), dtype=np.float64),
        parameters_whole=float(document["parameters_whole"]),
        effects_whole=float(document["effects_whole"]),
    )


def _shapes(model: Corrected) -> Iterator[tuple[str, Array, tuple[int, ...]]]:
    """Arrays of a corrected model that must be finite, by name, and the shapes that they must have."""
    n = model.chain.joints
    for name in ("parameters", "effects", "parameters_at_rest", "effects_at_rest"):
        yield f"kept {name}", getattr(model.kept, name), (n,)
    yield "band", model.band, (n,)
    for name in LIMITS:
        yield name, np.nan_to_num(getattr(model.limits, name), posinf=0.0, neginf=0.0), (n,)
    for name in ("nominal", "parameters", "final", "linearised"):
        yield name, getattr(model, name), (PER_JOINT * model.chain.links,)
    for name in ("coulomb_smoothing", "zeros"):
        yield name, getattr(model, name), (n,)
    yield "last_body", model.body_rotation, (3, 3)
    yield "last_body", model.body_origin, (3,)
    timing = [model.parameters_timing, model.final_timing, model.coulomb_lead]
    timing += [model.lag.delay, model.lag.time_constant]
    yield "timing", np.array(timing, dtype=np.float64), (5,)
    for term in model.terms:
        yield (
            term.effect,
            np.array([*term.shape.values(), *term.coefficients.ravel()]),
            (len(term.shape) + len(term.coefficients),),
        )


def _name(chain: Chain, joint: int | None) -> str | None:
    return None if joint is None else chain.joint_names[joint]


def _index(chain: Chain, name: str | None) -> int | None:
    return None if name is None else chain.joint_names.index(name)
