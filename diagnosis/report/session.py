"""session.rrd of a diagnosis: residuals before and after beside the moving arm, and the evidence.

Entities; all runs share the timeline ``time``, seconds since the start of each:

    summary                                        text
    <run>/floor, <run>/path/{measured,reference}   3D
    <run>/arm/measured/<body>, .../reference/...   3D, poses over time
    <run>/joints/<joint>/residual/{before,after}   re-identified alone, and with the effects
    <run>/joints/<joint>/effects/<effect>          torque of each named effect
    <run>/joints/<joint>/position                  of the joint
    evidence                                       probability of each candidate
"""

from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from testbench.recording import (
    APPLICATION,
    JOINT_COLOURS,
    MEASURED,
    PREDICTED,
    log_scene,
    log_series,
    opening_layout,
    scene_view,
)
from testbench.session_file import session_file

from ..decision.findings import Diagnosis
from ..experiment.discriminating_motion import NextExperiment
from . import words

# The first two joints' colours are those of the residuals.
BEFORE, AFTER, EFFECT_COLOURS = PREDICTED, MEASURED, JOINT_COLOURS[2:]


def write_session(
    diagnosis: Diagnosis, path: str | Path, next_experiment: NextExperiment | None = None
) -> None:
    """Write the Rerun recording of a diagnosis, whole or not at all."""
    order = diagnosis.runs_by_gap
    layout = opening_layout(*(_run_tab(diagnosis, index) for index in order))
    with session_file(path, APPLICATION, diagnosis.robot.name, layout) as stream:
        stream.send_recording_name(f"{diagnosis.robot.name}, diagnosis")
        text = rr.TextDocument(_markdown(diagnosis, next_experiment), media_type="text/markdown")
        stream.log("summary", text, static=True)
        if shown := diagnosis.likeliest[: words.MOST_CANDIDATES]:
            bars = rr.BarChart(np.array([100 * each.probability for each in shown]))
            stream.log("evidence", bars, static=True)
        for index in order:
            run, root = diagnosis.prepared.runs[index].logged, _root(diagnosis, index)
            log_scene(stream, root, diagnosis.robot, run.time, run.q, run.reference_position)
            _log_joints(stream, diagnosis, index)


def _root(diagnosis: Diagnosis, index: int) -> str:
    return rr.escape_entity_path_part(diagnosis.prepared.runs[index].name)


def _joint_root(diagnosis: Diagnosis, index: int, joint: int) -> str:
    name = rr.escape_entity_path_part(diagnosis.robot.joint_names[joint])
    return f"{_root(diagnosis, index)}/joints/{name}"


def _log_joints(stream: rr.RecordingStream, diagnosis: Diagnosis, index: int) -> None:
    """Residuals before and after, each named effect's torque, and the position of every joint."""
    run, robot = diagnosis.prepared.runs[index], diagnosis.robot
    before, after = diagnosis.parameters_only[1].residual[index], diagnosis.final[1].residual[index]
    laws = [diagnosis.torque_of(each)[index] for each in diagnosis.effects]
    for joint, unit in enumerate(robot.units()):
        root, used = _joint_root(diagnosis, index, joint), run.used[:, joint]
        for name, residual, colour in (("before", before, BEFORE), ("after", after, AFTER)):
            # Samples at rest do not count; NaN marks them here.
            values = np.where(used, residual[:, joint], np.nan)
            log_series(stream, f"{root}/residual/{name}", f"{name} [{unit}]", colour, run.time, values)
        for number, (each, law) in enumerate(zip(diagnosis.effects, laws, strict=True)):
            if not np.any(law[:, joint]):
                continue
            label = f"{words.labelled(robot, each)} [{unit}]"
            path = f"{root}/effects/{number + 1}_{each.effect}"
            colour = EFFECT_COLOURS[number % len(EFFECT_COLOURS)]
            log_series(stream, path, label, colour, run.time, law[:, joint])
        length = "m" if robot.chain.is_slide[joint] else "rad"
        log_series(stream, f"{root}/position", f"position [{length}]", MEASURED, run.time, run.q[:, joint])


def _markdown(diagnosis: Diagnosis, next_experiment: NextExperiment | None) -> str:
    """Verdict, effects, the gap a joint and the candidates in the order of the bars."""
    robot, gap = diagnosis.robot, diagnosis.gap
    lines = [f"**{diagnosis.sentence}**", ""]
    for each in diagnosis.effects:
        label = words.labelled(robot, each)
        lines.append(
            f"- {label}: {100 * each.probability:.0f} %; {words.parameters(each, diagnosis.run_names)}"
        )
    lines += ["", "| joint | unit | as given | re-identified | with effects | noise |", "|---" * 6 + "|"]
    for joint, (name, unit) in enumerate(zip(robot.joint_names, robot.units(), strict=True)):
        stages = (gap.nominal, gap.parameters, gap.effects, gap.noise_floor)
        lines.append(f"| {name} | {unit} | " + " | ".join(f"{s[joint]:.3g}" for s in stages) + " |")
    lines += ["", "Evidence, in the order of the bars:", ""]
    for number, one in enumerate(diagnosis.likeliest[: words.MOST_CANDIDATES]):
        label = words.labelled(robot, one)
        reason = f", {one.reason}" if one.reason else ""
        lines.append(f"{number}. {label}: {100 * one.probability:.0f} %{reason}")
    if next_experiment is not None:
        lines += ["", f"**Next:** {next_experiment.why}"]
    return "\n".join(lines)


def _run_tab(diagnosis: Diagnosis, index: int) -> rrb.Horizontal:
    names = diagnosis.robot.joint_names
    residuals = rrb.Grid(
        *(
            rrb.TimeSeriesView(origin=f"{_joint_root(diagnosis, index, joint)}/residual", name=name)
            for joint, name in enumerate(names)
        ),
        grid_columns=1 if len(names) == 1 else 2,
        name="Residuals before and after",
    )
    shown = {joint for each in diagnosis.effects for joint in (each.joint, each.into)}
    joints = [
        rrb.Vertical(
            rrb.TimeSeriesView(
                origin=_joint_root(diagnosis, index, joint),
                contents=["+ $origin/residual/**"],
                name="Residual before and after",
            ),
            rrb.TimeSeriesView(
                origin=_joint_root(diagnosis, index, joint),
                contents=["+ $origin/effects/**"],
                name="Torque of the named effects",
            ),
            rrb.TimeSeriesView(origin=f"{_joint_root(diagnosis, index, joint)}/position", name="Position"),
            name=names[joint] + (" (named)" if joint in shown else ""),
        )
        for joint in range(len(names))
    ]
    has_reference = diagnosis.prepared.runs[index].logged.reference_position is not None
    scene = scene_view(diagnosis.robot, _root(diagnosis, index), has_reference)
    findings = rrb.Tabs(
        rrb.TextDocumentView(origin="summary", name="Findings"),
        rrb.BarChartView(origin="evidence", name="Evidence, %"),
        active_tab=0,
    )
    return rrb.Horizontal(
        rrb.Vertical(scene, findings, row_shares=[3, 2]),
        rrb.Tabs(residuals, *joints, active_tab=0),
        column_shares=[2, 3],
        name=diagnosis.prepared.runs[index].name,
    )
