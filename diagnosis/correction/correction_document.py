"""The corrected model as plain numbers, all that predictions along another motion need; and its JSON."""

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
from testbench.json_values import plain
from testbench.robot import Limits
from testbench.torque_lag import TorqueLag

from ..data.run import CUTOFF
from ..held_out.shrinkage import Kept, everything

Array = NDArray[np.float64]

DOCUMENT, FORMAT, VERSION = "diagnosis.json", "gap-diagnosis", 1
LIMITS = ("lower", "upper", "velocity", "acceleration", "torque")
SHARES = ("parameters", "effects", "parameters_at_rest", "effects_at_rest")


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


def correction_document(model: Corrected) -> dict[str, Any]:
    """The corrected model as JSON-able values; null for the limits that the model does not set."""
    chain = model.chain
    return {
        "chain": chain_document(chain),
        "limits": plain({name: getattr(model.limits, name) for name in LIMITS}),
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
        "kept": plain(model.kept),
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
            limits=Limits(**{name: _array(values) for name, values in limits.items()}),
            nominal=_array(document["nominal"]),
            parameters=_array(document["parameters"]["standard"]),
            parameters_timing=float(document["parameters"]["timing"]),
            final=_array(effects["standard"]),
            final_timing=float(effects["timing"]),
            lag=TorqueLag(**document["lag"]),
            linearised=_array(effects["linearised_at"]),
            coulomb_smoothing=_array(document["coulomb_smoothing"]),
            coulomb_lead=float(document["coulomb_lead"]),
            zeros=_array(document["zeros"]),
            body_rotation=_array(document["last_body"]["rotation"]),
            body_origin=_array(document["last_body"]["origin"]),
            terms=tuple(
                Term(
                    effect=term["effect"],
                    joint=_index(chain, term["joint"]),
                    into=_index(chain, term["into"]),
                    shape={name: float(value) for name, value in term["shape"].items()},
                    coefficients=_array(term["coefficients"]),
                    is_carried=bool(term.get("carried", False)),
                )
                for term in effects["terms"]
            ),
            kept=_kept(document.get("kept"), chain.joints),
            band=_array(document.get("band", [CUTOFF] * chain.joints)),
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


def _array(values: Any) -> Array:
    return np.array(values, dtype=np.float64)


def _kept(document: Any, joints: int) -> Kept:
    """Shares of what was fitted; all of it where the document says none."""
    if document is None:
        return everything(joints)
    # Files of earlier versions keep the same share near rest.
    shares: dict[str, Any] = {
        name: _array(document.get(name, document[name.removesuffix("_at_rest")])) for name in SHARES
    }
    parameters, effects = float(document["parameters_whole"]), float(document["effects_whole"])
    return Kept(**shares, parameters_whole=parameters, effects_whole=effects)


def _shapes(model: Corrected) -> Iterator[tuple[str, Array, tuple[int, ...]]]:
    """Arrays of a corrected model that must be finite, by name, and the shapes that they must have."""
    n = model.chain.joints
    for name in SHARES:
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
    yield "timing", _array(timing), (5,)
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
