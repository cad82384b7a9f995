"""diagnosis.json: what a diagnosis says, for machines."""

from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from testbench.files import write_json
from testbench.findings import torque_unit
from testbench.json_values import plain

from ..correction.corrected_mjcf import Written
from ..correction.corrected_model import corrected_model
from ..correction.correction_document import FORMAT, VERSION, correction_document
from ..correction.file_error import FileError
from ..correction.forward_gap import ForwardGap
from ..decision.findings import STAGES, Diagnosis, NamedEffect, RankedCandidate
from ..experiment.discriminating_motion import NextExperiment
from ..residual.shares import RegimeShare, Share


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
    write_json(diagnosis_document(diagnosis, written, forward, next_experiment), path)


def diagnosis_document(
    diagnosis: Diagnosis,
    written: Written | None = None,
    forward: ForwardGap | None = None,
    next_experiment: NextExperiment | None = None,
) -> dict[str, Any]:
    """Content of diagnosis.json as plain JSON types; candidates sorted, likeliest first."""
    names, name = diagnosis.robot.joint_names, partial(_name, diagnosis)
    prepared, lag = diagnosis.prepared, diagnosis.prepared.lag
    document = {
        "format": FORMAT,
        "format_version": VERSION,
        "robot": diagnosis.robot.name,
        "joint_names": names,
        "runs": diagnosis.run_names,
        "verdict": diagnosis.verdict,
        "sentence": diagnosis.sentence,
        "effects": [_effect(diagnosis, each) for each in diagnosis.effects],
        "candidates": [_candidate(diagnosis, each) for each in diagnosis.likeliest],
        "not_observable": [
            {"effect": effect, "joint": name(joint)} for effect, joint in diagnosis.not_observable
        ],
        "where": [_where(diagnosis, each) for each in diagnosis.where],
        "gap": _gap(diagnosis),
        "forward": forward,
        "next_experiment": None if next_experiment is None else _experiment(next_experiment),
        "not_in_mjcf": [] if written is None else written.lacks,
        "corrected_file": None if written is None else _file_error(written.error),
        "notes": diagnosis.notes,
        "differences": diagnosis.differences,
        "log_findings": diagnosis.log_findings,
        "late": lag.seconds,
        "low_passed": {"order": lag.order, "corner": lag.corner} if lag.order else None,
        "noise_unseen": [names[joint] for joint in np.flatnonzero(diagnosis.gap.unseen)],
        "silent": [names[joint] for joint in sorted(prepared.silent)],
        "still": [names[joint] for joint in sorted(prepared.still)],
        "one_sine": [names[joint] for joint in sorted(diagnosis.one_sine)],
        "too_little_motion": [names[joint] for joint in diagnosis.too_little_motion],
        "mended": diagnosis.mended,
        "everywhere": [{"effect": effect, "joint": name(joint)} for effect, joint in diagnosis.everywhere],
    }
    return plain(document) | {"correction": correction_document(corrected_model(diagnosis))}


def _name(diagnosis: Diagnosis, joint: int | None) -> str | None:
    """A joint's name; None for the whole robot."""
    return None if joint is None else diagnosis.robot.joint_names[joint]


def _effect(diagnosis: Diagnosis, each: NamedEffect) -> dict[str, Any]:
    """One reported effect with its parameters."""
    into = {} if each.into is None else {"into": _name(diagnosis, each.into)}
    return {
        "effect": each.effect,
        "joint": _name(diagnosis, each.joint),
        "probability": each.probability,
        "law": each.law,
        "parameters": into | each.parameters,
        "runs": [diagnosis.run_names[run] for run in each.runs],
        "confusable_with": each.confusable_with,
        "held_out_share": each.held_out_share,
    }


def _candidate(diagnosis: Diagnosis, each: RankedCandidate) -> dict[str, Any]:
    """One candidate that was weighed, with the reason why it is not reported."""
    return {
        "effect": each.effect,
        "joint": _name(diagnosis, each.joint),
        "into": _name(diagnosis, each.into),
        "probability": each.probability,
        "score": each.score,
        "reason": each.reason,
    }


def _where(diagnosis: Diagnosis, each: Share) -> dict[str, Any]:
    """One joint's share of the gap, and the regimes that it follows."""
    return {
        "joint": _name(diagnosis, each.joint),
        "share": each.share,
        "regime": each.regime,
        "gap_rms": each.gap_rms,
        "noise_rms": each.noise_rms,
        "unit": diagnosis.robot.units()[each.joint],
        "regimes": [_regime(part) for part in each.regimes],
    }


def _regime(part: RegimeShare) -> dict[str, Any]:
    """One part of a joint's gap; interval: 90 %."""
    return {
        "aspect": part.aspect,
        "regime": part.regime,
        "share": part.share,
        "interval": [part.low, part.high],
        "expected": part.expected,
        "rms": part.rms,
        "cycles": part.cycles,
    }


def _gap(diagnosis: Diagnosis) -> dict[str, Any]:
    """RMS torque error of each joint, by stage; intervals: 90 % bounds, a pair a joint."""
    gap = diagnosis.gap
    stages = {stage: getattr(gap, stage) for stage in STAGES}
    return {
        "unit": torque_unit(diagnosis.robot),
        "joint_names": diagnosis.robot.joint_names,
        **stages,
        "noise_floor": gap.noise_floor,
        # Between models that are alike to the noise there is nothing to close.
        "closed": None if diagnosis.verdict == "none" else gap.closed,
        "band": diagnosis.prepared.cutoff,
        "over_all_frequencies": {stage: gap.over_all(rms) for stage, rms in stages.items()},
        "intervals": {stage: bounds.T for stage, bounds in zip(STAGES, gap.intervals, strict=True)},
    }


def _file_error(error: FileError) -> dict[str, Any]:
    """Torque error a joint along these runs: by the model given, the diagnosis's laws, corrected.xml."""
    return {"torque": {"nominal": error.given, "laws": error.laws, "file": error.file}}


def _experiment(experiment: NextExperiment) -> dict[str, Any]:
    """The next experiment without its motion, which has a file of its own."""
    return {
        "why": experiment.why,
        "separates": experiment.separates,
        "file": experiment.file,
        "separation": experiment.separation,
        "separation_now": experiment.separation_now,
    }
