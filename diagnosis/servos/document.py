"""diagnosis.json of position servos: the form of a diagnosis with torque, its gap in rad (m)."""

from typing import Any

import numpy as np

from testbench.effects.signature import Quantity

from .findings import ServoDiagnosis
from .words import notes, sentence

FORMAT, VERSION = "gap-diagnosis", 1


def servo_document(diagnosis: ServoDiagnosis, not_in_mjcf: tuple[str, ...]) -> dict[str, Any]:
    """Content of diagnosis.json as plain JSON types. not_in_mjcf: what corrected.xml cannot carry."""
    robot = diagnosis.found.robot
    slides = any(bool(each) for each in robot.chain.is_slide)
    unit = "rad (m for a slide joint)" if slides else "rad"
    experiment = diagnosis.experiment
    return {
        "format": FORMAT,
        "format_version": VERSION,
        "robot": robot.name,
        "joint_names": list(robot.joint_names),
        "runs": list(diagnosis.runs),
        "gap_of": "position in closed loop",
        "verdict": diagnosis.verdict,
        "sentence": sentence(diagnosis),
        "effects": [
            {
                "effect": each.effect,
                "joint": each.joint,
                "joints": list(each.joints),
                "probability": each.probability,
                "law": each.law,
                "parameters": {name: _quantity(quantity) for name, quantity in each.parameters.items()},
                "confusable_with": list(each.confusable_with),
                "held_out_share": _number(each.held_out_share),
            }
            for each in diagnosis.effects
        ],
        "candidates": [
            {
                "effect": each.effect,
                "joint": each.joint,
                "probability": each.probability,
                "score": _number(each.score),
                "reason": each.reason,
            }
            for each in diagnosis.candidates
        ],
        "unknown": diagnosis.unknown,
        "where": [
            {
                "joint": each.joint,
                "share": each.share,
                "regime": each.regime,
                "gap_rms": each.gap_rms,
                "noise_rms": each.noise_rms,
                "unit": unit,
            }
            for each in diagnosis.where
        ],
        "gap": _gap(diagnosis, unit),
        "next_experiment": None
        if experiment is None
        else {"why": experiment.why, "separates": list(experiment.separates), "file": None},
        "not_in_mjcf": list(not_in_mjcf),
        "notes": list(notes(diagnosis)),
    }


def _gap(diagnosis: ServoDiagnosis, unit: str) -> dict[str, Any]:
    """RMS position error of each joint in closed loop, by stage."""
    return {
        "unit": unit,
        "joint_names": list(diagnosis.found.robot.joint_names),
        "nominal": _numbers(diagnosis.given),
        "parameters": _numbers(diagnosis.parameters),
        "effects": _numbers(diagnosis.corrected),
        "noise_floor": _numbers(diagnosis.noise),
        "closed": _number(diagnosis.closed),
    }


def _quantity(quantity: Quantity) -> dict[str, Any]:
    value, std = (float(np.asarray(each)) for each in (quantity.value, quantity.std))
    return {"value": _number(value), "std": _number(std), "unit": quantity.unit}


def _numbers(values: np.ndarray) -> list[float | None]:
    return [_number(float(value)) for value in values]


def _number(value: float | None) -> float | None:
    """JSON has no NaN and no infinity."""
    return None if value is None or not np.isfinite(value) else value
