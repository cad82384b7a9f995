"""One case judged: what a diagnosis said against what acts."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from identification.errors import InputError
from testbench.effects import effect, effects

# Figures of one case by name; what is unknown is None.
Row = dict[str, Any]

VERDICTS = ("none", "parameters", "effect", "unknown")
# The parameters that state how large an effect is; the first one where nothing is said here.
SIZES = {"base_tilt": ("roll", "pitch")}
# And what they are relative to.
PER = {"thermal_friction_drift": ("power",)}


def judge(answer: Mapping[str, Any], diagnosis: Mapping[str, Any], source: object = "diagnosis") -> Row:
    """The row of a case. answer: as it was sealed. diagnosis: a diagnosis.json.

    exact: the first effect named acts, there. right: exact, or the effect that acts is stated as
    confusable with the first one named at the same place, and the catalogue knows them as alike. wrong: an
    effect is named first that does not act and that is not stated as confusable with one that does. draws:
    every effect drawn for the case, with why it does not act or None.
    Raises InputError, naming ``source``, for a diagnosis that is none and for an answer of an older study.
    """
    verdict, named = _checked(diagnosis, source)
    if "rejected" not in answer:
        raise InputError(source, "rejected", "an answer that lists what was drawn and rejected", "none")
    acting = answer["effects"]
    first = named[0] if named else None
    exact = first is not None and any(_same(first, each) for each in acting)
    stated = first is not None and any(_stated(first, each) for each in acting)
    right = exact or (stated and any(_alike(first, each) for each in acting))
    known = answer["kind"] != "unknown"
    joint = acting[0]["joint"] if acting else None
    row: Row = {
        "case": answer["case"],
        "kind": answer["kind"],
        "robot": answer["robot"] + (" drawn" if answer["robot_error"] > 0 else ""),
        "background": answer["background"],
        "effect": acting[0]["effect"] if acting else None,
        "joint": joint,
        "law": acting[0]["law"] if acting else None,
        "severity": acting[0]["severity"] if acting else None,
        "acts": "; ".join(_label(each) for each in acting),
        "least_severity": min((each["severity"] for each in acting), default=None),
        "moved": min((each["moved"] for each in acting), default=None),
        "controller": answer["settings"]["controller"],
        "sample_rate": answer["settings"]["rate"],
        "runs": len(answer["settings"]["motions"]) - 1,
        "channels": " ".join(answer["settings"]["channels"]),
        "verdict": verdict,
        "named": "; ".join(_label(each) for each in named),
        "first": None if first is None else first["effect"],
        "first_joint": None if first is None else first["joint"],
        "probability": None if first is None else first["probability"],
        "confusable_with": None if first is None else " ".join(first["confusable_with"]),
        "exact": exact,
        "right": right,
        "effect_right": first is not None and any(first["effect"] == each["effect"] for each in acting),
        "joint_right": _joint_right(diagnosis, acting, first),
        "all_found": bool(acting) and known and all(any(_same(n, each) for n in named) for each in acting),
        "wrong": first is not None and not (exact or stated),
        "extra": sum(not any(_same(n, each) or _stated(n, each) for each in acting) for n in named),
        "calibration": [
            [n["probability"], any(_same(n, each) for each in acting)]
            for n in named
            if n["probability"] is not None
        ],
        "redrawn": answer["attempt"],
        "draws": [
            *([each["effect"], each["why"]] for each in answer["rejected"]),
            *([each["effect"], None] for each in acting),
        ],
        "where_joint": diagnosis["where"][0]["joint"] if diagnosis.get("where") else None,
    }
    return row | {"parameter_error": _parameter_error(named, acting)}


def closed(answer: Mapping[str, Any], errors: Mapping[str, Sequence[float]] | None) -> Row:
    """The gap on the hidden run, joints summed: by parameters, with the effects, at the floor, and its share.

    errors: RMS a joint by stage; None where a diagnosis leaves no corrected model.
    """
    if errors is None:
        return {"hidden_parameters": None, "hidden_effects": None, "hidden_floor": None, "closed": None}
    parameters, effects_left = (float(np.sum(errors[name])) for name in ("parameters", "effects"))
    least = float(np.sum(answer["floor"]))
    reducible = parameters - least
    return {
        "hidden_parameters": parameters,
        "hidden_effects": effects_left,
        "hidden_floor": least,
        "closed": (parameters - effects_left) / reducible if reducible > 0 else None,
    }


def _checked(diagnosis: Mapping[str, Any], source: object) -> tuple[str, list[dict[str, Any]]]:
    """Verdict and named effects. Raises InputError."""
    if not isinstance(diagnosis, Mapping) or diagnosis.get("format") != "gap-diagnosis":
        raise InputError(source, "format", "gap-diagnosis", "something else")
    verdict = diagnosis.get("verdict")
    if verdict not in VERDICTS:
        raise InputError(source, "verdict", "a verdict", repr(verdict), VERDICTS)
    named = []
    for each in diagnosis.get("effects", []) if verdict == "effect" else []:
        if not isinstance(each, Mapping) or each.get("effect") not in effects():
            raise InputError(source, "effects", "effects of the catalogue", repr(each)[:80], effects())
        named.append(
            {
                "effect": each["effect"],
                "joint": each.get("joint"),
                "into": each.get("parameters", {}).get("into"),
                "probability": each.get("probability"),
                "parameters": each.get("parameters", {}),
                "confusable_with": tuple(each.get("confusable_with", ())),
            }
        )
    return str(verdict), named


def _place(each: Mapping[str, Any]) -> frozenset[str]:
    """The joints of an effect; those of a pair have no order."""
    return frozenset(name for name in (each["joint"], each["into"]) if name is not None)


def _same(named: Mapping[str, Any], acting: Mapping[str, Any]) -> bool:
    return named["effect"] == acting["effect"] and _place(named) == _place(acting)


def _stated(named: Mapping[str, Any], acting: Mapping[str, Any]) -> bool:
    """Whether the acting effect is among those that the diagnosis cannot distinguish from the named one.

    An effect of the whole robot is alike wherever it is reported.
    """
    if acting["effect"] not in named["confusable_with"]:
        return False
    return not _place(named) or not _place(acting) or bool(_place(named) & _place(acting))


def _alike(named: Mapping[str, Any] | None, acting: Mapping[str, Any]) -> bool:
    """Whether the catalogue knows the two as hard to distinguish."""
    if named is None or acting["effect"] not in effects():
        return False
    pair = named["effect"], acting["effect"]
    return _stated(named, acting) and (
        pair[1] in effect(pair[0]).DESCRIPTION.confused_with
        or pair[0] in effect(pair[1]).DESCRIPTION.confused_with
    )


def _joint_right(
    diagnosis: Mapping[str, Any], acting: Sequence[Mapping[str, Any]], first: Mapping[str, Any] | None
) -> bool | None:
    """Whether the joint named first, or where the gap is largest, is one where something acts."""
    places = [_place(each) for each in acting]
    if not places or not all(places):
        return None
    where = diagnosis.get("where") or []
    reported = {where[0]["joint"]} if first is None and where else set() if first is None else _place(first)
    return any(bool(reported & place) for place in places)


def _parameter_error(named: Sequence[Mapping[str, Any]], acting: Sequence[Mapping[str, Any]]) -> float | None:
    """Relative error of the size of a single effect that is named, where its law is the signature's own."""
    if len(acting) != 1 or acting[0]["law"] is None:
        return None
    (true,) = acting
    if true["law"] != effect(true["effect"]).DESCRIPTION.laws[0]:
        return None
    first_size = effect(true["effect"]).DESCRIPTION.parameters[0].name
    sizes = SIZES.get(true["effect"], (first_size,))
    per = PER.get(true["effect"], ())
    for each in named:
        if not _same(each, true):
            continue
        try:
            reported = {name: float(each["parameters"][name]["value"]) for name in (*sizes, *per)}
            found, size = (
                np.array([values[name] for name in sizes]) / np.prod([values[name] for name in per])
                for values in (reported, true["values"])
            )
        except (KeyError, TypeError, ValueError):
            return None
        return float(np.linalg.norm(found - size) / np.linalg.norm(size))
    return None


def _label(each: Mapping[str, Any]) -> str:
    place = " and ".join(name for name in (each["joint"], each["into"]) if name is not None)
    return f"{each['effect']} at {place}" if place else str(each["effect"])
