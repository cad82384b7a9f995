"""diagnosis.json of position servos: the form of a diagnosis with torque, its gap in rad (m)."""

from typing import Any

from testbench.json_values import plain

from ..correction.correction_document import FORMAT, VERSION
from .findings import ServoDiagnosis
from .words import notes, sentence


def servo_document(diagnosis: ServoDiagnosis, not_in_mjcf: tuple[str, ...]) -> dict[str, Any]:
    """Content of diagnosis.json as plain JSON types. not_in_mjcf: what corrected.xml cannot carry."""
    robot, experiment = diagnosis.found.robot, diagnosis.experiment
    unit = "rad (m for a slide joint)" if robot.chain.is_slide.any() else "rad"
    document = {
        "format": FORMAT,
        "format_version": VERSION,
        "robot": robot.name,
        "joint_names": robot.joint_names,
        "runs": diagnosis.runs,
        "gap_of": "position in closed loop",
        "verdict": diagnosis.verdict,
        "sentence": sentence(diagnosis),
        "effects": diagnosis.effects,
        "candidates": diagnosis.candidates,
        "unknown": diagnosis.unknown,
        "where": [plain(each) | {"unit": unit} for each in diagnosis.where],
        "gap": {
            "unit": unit,
            "joint_names": robot.joint_names,
            "nominal": diagnosis.given,
            "parameters": diagnosis.parameters,
            "effects": diagnosis.corrected,
            "noise_floor": diagnosis.noise,
            "closed": diagnosis.closed,
        },
        "next_experiment": None if experiment is None else plain(experiment) | {"file": None},
        "not_in_mjcf": not_in_mjcf,
        "notes": notes(diagnosis),
    }
    return plain(document)
