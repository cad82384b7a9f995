"""diagnosis.json: what a diagnosis says, for machines."""

import json
import math
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from testbench.effects.signature import Quantity
from testbench.files import replacing
from testbench.torque_lag import TorqueLag

from ..correction.closed_loop_gap import ForwardGap
from ..correction.corrected_mjcf import Written
from ..correction.corrected_model import corrected_model, correction_document
from ..correction.file_error import FileError
from ..decision.findings import Diagnosis, NamedEffect, RankedCandidate
from ..experiment.discriminating_motion import NextExperiment
from ..held_out.differing_runs import Difference
from ..residual.shares import RegimeShare, Share

FORMAT, VERSION = "gap-diagnosis", 1


def write_diagnosis(
    diagnosis: Diagnosis,
    path: str | Path,
    written: Written | None = None,
    forward: ForwardGap | None = None,
    next_experiment: NextExperiment | None = None,
) -> None:
    """Write diagnosis.json, whole or not at all. What is unknown, or not finite, is null.

    written: corrected.xml. forward: the gap of the simulator run in closed loop. next_experiment: what to
    record next.
    """
    document = diagnosis_document(diagnosis, written, forward, next_experiment)
    text = json.dumps(document, ensure_ascii=False, indent=1, allow_nan=False)
    with replacing(path) as temporary:
        temporary.write_text(text + "\n", encoding="utf-8")


def diagnosis_document(
    diagnosis: Diagnosis,
    written: Written | None = None,
    forward: ForwardGap | None = None,
    next_experiment: NextExperiment | None = None,
) -> dict[str, Any]:
    """Content of diagnosis.json as plain JSON types; candidates sorted, likeliest first."""
    names, name = diagnosis.robot.joint_names, partial(_name, diagnosis)
    ranked = sorted(diagnosis.ranked, key=lambda each: (-each.probability, -each.score))
    return {
        "format": FORMAT,
        "format_version": VERSION,
        "robot": diagnosis.robot.name,
        "joint_names": list(names),
        "runs": [run.name for run in diagnosis.prepared.runs],
        "verdict": diagnosis.verdict,
        "sentence": diagnosis.sentence,
        "effects": [_effect(diagnosis, each) for each in diagnosis.effects],
        "candidates": [_candidate(diagnosis, each) for each in ranked],
        "not_observable": [
            {"effect": effect, "joint": name(joint)} for effect, joint in diagnosis.not_observable
        ],
        "where": [_where(diagnosis, each) for each in diagnosis.where],
        "gap": _gap(diagnosis),
        "forward": None if forward is None else _forward(forward),
        "next_experiment": None if next_experiment is None else _experiment(next_experiment),
        "not_in_mjcf": [] if written is None else list(written.lacks),
        "corrected_file": None if written is None else _file_error(written.error),
        "notes": list(diagnosis.notes),
        "differences": [_difference(each) for each in diagnosis.differences],
        "log_findings": [asdict(each) for each in diagnosis.log_findings],
        "late": _number(diagnosis.prepared.lag.seconds),
        "low_passed": _low_passed(diagnosis.prepared.lag),
        "noise_unseen": [names[joint] for joint in diagnosis.noise_unseen],
        "silent": [names[joint] for joint in sorted(diagnosis.prepared.silent)],
        "still": [names[joint] for joint in sorted(diagnosis.prepared.still)],
        "one_sine": [names[joint] for joint in sorted(diagnosis.one_sine)],
        "untold": [names[joint] for joint in diagnosis.untold],
        "mended": diagnosis.mended,
        "everywhere": [{"effect": effect, "joint": name(joint)} for effect, joint in diagnosis.everywhere],
        "correction": correction_document(corrected_model(diagnosis)),
    }


def _effect(diagnosis: Diagnosis, each: NamedEffect) -> dict[str, Any]:
    """One reported effect with its parameters."""
    return {
        "effect": each.effect,
        "joint": _name(diagnosis, each.joint),
        "probability": _number(each.probability),
        "law": each.law,
        "parameters": _parameters(each, _name(diagnosis, each.into)),
        "runs": [diagnosis.run_names[run] for run in each.runs],
        "confusable_with": list(each.confusable_with),
        "held_out_share": _number(each.held_out_share),
    }


def _candidate(diagnosis: Diagnosis, each: RankedCandidate) -> dict[str, Any]:
    """One candidate that was weighed, with the reason why it is not reported."""
    return {
        "effect": each.effect,
        "joint": _name(diagnosis, each.joint),
        "into": _name(diagnosis, each.into),
        "probability": _number(each.probability),
        "score": _number(each.score),
        "reason": each.reason,
    }


def _name(diagnosis: Diagnosis, joint: int | None) -> str | None:
    """A joint's name; None for the whole robot."""
    return None if joint is None else diagnosis.robot.joint_names[joint]


def _where(diagnosis: Diagnosis, each: Share) -> dict[str, Any]:
    """One joint's share of the gap, and the regimes that it follows."""
    robot = diagnosis.robot
    return {
        "joint": robot.joint_names[each.joint],
        "share": _number(each.share),
        "regime": each.regime,
        "gap_rms": _number(each.gap_rms),
        "noise_rms": _number(each.noise_rms),
        "unit": robot.units()[each.joint],
        "regimes": [_regime(part) for part in each.regimes],
    }


def _gap(diagnosis: Diagnosis) -> dict[str, Any]:
    """RMS torque error of each joint, by stage."""
    gap, units, stages = diagnosis.gap, diagnosis.robot.units(), ("nominal", "parameters", "effects")
    return {
        "unit": units[0] if len(set(units)) == 1 else "N·m (N for a slide joint)",
        "joint_names": list(diagnosis.robot.joint_names),
        "nominal": _numbers(gap.nominal),
        "parameters": _numbers(gap.parameters),
        "effects": _numbers(gap.effects),
        "noise_floor": _numbers(gap.noise_floor),
        # Between models that are alike to the noise there is nothing to close.
        "closed": None if diagnosis.verdict == "none" else _number(gap.closed),
        "band": _numbers(diagnosis.prepared.cutoff),
        "over_all_frequencies": {stage: _numbers(gap.over_all(getattr(gap, stage))) for stage in stages},
        "intervals": None if gap.intervals is None else _intervals(gap.intervals),
    }


def _difference(each: Difference) -> dict[str, Any]:
    """How one run differs from the others."""
    return {
        "run": each.run,
        "kind": each.kind,
        "mass": None if each.mass is None else _quantity(each.mass),
        "offsets": _numbers(each.offsets),
        "gains": None if each.gains is None else _numbers(each.gains),
        "friction": None if each.friction is None else [_numbers(part) for part in each.friction],
        "deviations": None if each.deviations is None else _numbers(each.deviations),
    }


def _low_passed(lag: TorqueLag) -> dict[str, Any] | None:
    """The low-pass that the logged torque has passed, corner in Hz; None for none."""
    return {"order": lag.order, "corner": _number(lag.corner)} if lag.order else None


def _regime(part: RegimeShare) -> dict[str, Any]:
    """One part of a joint's gap; interval: 90 %."""
    return {
        "aspect": part.aspect,
        "regime": part.regime,
        "share": _number(part.share),
        "interval": [_number(part.low), _number(part.high)],
        "expected": _number(part.expected),
        "rms": _number(part.rms),
        "cycles": _number(part.cycles),
    }


def _intervals(intervals: Any) -> dict[str, Any]:
    """90 % bounds, a pair a joint."""
    stages = ("nominal", "parameters", "effects")
    return {
        stage: [_numbers(pair) for pair in bounds.T] for stage, bounds in zip(stages, intervals, strict=True)
    }


def _parameters(each: NamedEffect, into: str | None) -> dict[str, Any]:
    values: dict[str, Any] = {} if into is None else {"into": into}
    return values | {key: _quantity(quantity) for key, quantity in each.parameters.items()}


def _quantity(quantity: Quantity) -> dict[str, Any]:
    return {"value": _plain(quantity.value), "std": _plain(quantity.std), "unit": quantity.unit}


def _forward(forward: ForwardGap) -> dict[str, Any]:
    """Per joint, closed loop on the logs' references: RMS of simulated less logged motion and torque."""
    return {
        "runs": list(forward.runs),
        "seconds": _number(forward.seconds),
        "motion": {stage: _numbers(values) for stage, values in forward.motion.items()},
        "torque": {stage: _numbers(values) for stage, values in forward.torque.items()},
        "failed": dict(forward.failed),
    }


def _file_error(error: FileError) -> dict[str, Any]:
    """Torque error a joint along these runs: by the model given, the diagnosis's laws, corrected.xml."""
    stages = {"nominal": error.given, "laws": error.laws, "file": error.file}
    return {"torque": {stage: _numbers(values) for stage, values in stages.items()}}


def _experiment(experiment: NextExperiment) -> dict[str, Any]:
    return {
        "why": experiment.why,
        "separates": list(experiment.separates),
        "file": experiment.file,
        "separation": _number(experiment.separation),
        "separation_now": _number(experiment.separation_now),
    }


def _plain(value: float | tuple[float, ...]) -> float | list[float | None] | None:
    return [_number(v) for v in value] if isinstance(value, tuple) else _number(value)


def _numbers(values: Any) -> list[float | None]:
    return [_number(value) for value in np.asarray(values).tolist()]


def _number(value: float | None) -> float | None:
    """JSON has no NaN and no infinity."""
    return None if value is None or not math.isfinite(value) else float(value)
