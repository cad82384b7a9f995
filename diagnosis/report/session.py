"""session.rrd of a diagnosis: residuals before and after beside the moving arm, and the evidence.

Entities; all runs share the timeline ``time``, seconds since the start of each:

    summary                                        text
    <run>/floor, <run>/path/measured               3D
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
from numpy.typing import NDArray

from testbench.recording import (
    APPLICATION,
    MEASURED,
    POSE_RATE,
    PREDICTED,
    REFERENCE,
    TIMELINE,
    log_series,
    stride,
    time_column,
)
from testbench.scene import body_poses, log_floor, log_motion, log_robot, reach
from testbench.session_file import session_file

from ..decision.findings import Diagnosis
from ..experiment.discriminating_motion import NextExperiment
from . import words
from .signature import partial_residual

Array = NDArray[np.float64]

BEFORE, AFTER = PREDICTED, MEASURED
EFFECT_COLOURS = (
    (44, 160, 44),
    (214, 39, 40),
    (148, 103, 189),
    (140, 86, 75),
    (227, 119, 194),
    (23, 190, 207),
)
MOST_CANDIDATES = 12


def write_session(
    diagnosis: Diagnosis, path: str | Path, next_experiment: NextExperiment | None = None
) -> None:
    """Write the Rerun recording of a diagnosis, whole or not at all."""
    order = _by_gap(diagnosis)
    with session_file(path, APPLICATION, diagnosis.robot.name, _layout(diagnosis, order)) as stream:
        stream.send_recording_name(f"{diagnosis.robot.name}, diagnosis")
        text = rr.TextDocument(_markdown(diagnosis, next_experiment), media_type="text/markdown")
        stream.log("summary", text, static=True)
        _log_evidence(stream, diagnosis)
        for index in order:
            _log_scene(stream, diagnosis, index)
            _log_joints(stream, diagnosis, index)


def _by_gap(diagnosis: Diagnosis) -> list[int]:
    """Indices of the runs, the one with the largest gap first."""
    weights = diagnosis.final[1].weights
    gaps = [float(np.mean(r**2 @ weights)) for r in diagnosis.parameters_only[1].residual]
    return [int(index) for index in np.argsort(-np.array(gaps), kind="stable")]


def _root(diagnosis: Diagnosis, index: int) -> str:
    return rr.escape_entity_path_part(diagnosis.prepared.runs[index].name)


def _joint_root(diagnosis: Diagnosis, index: int, joint: int) -> str:
    name = rr.escape_entity_path_part(diagnosis.robot.joint_names[joint])
    return f"{_root(diagnosis, index)}/joints/{name}"


def _log_scene(stream: rr.RecordingStream, diagnosis: Diagnosis, index: int) -> None:
    """The floor, the arm as measured, its reference as a ghost where there is one, the way of the tool."""
    model, root = diagnosis.robot.model, _root(diagnosis, index)
    logged = diagnosis.prepared.runs[index].logged
    stream.log(root, rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    log_floor(stream, f"{root}/floor", model)
    every = stride(logged.sample_rate, POSE_RATE)
    time = time_column(logged.time[::every] - logged.time[0])
    for name, q in (("measured", logged.q), ("reference", logged.reference_position)):
        if q is None:
            continue
        log_robot(stream, f"{root}/arm/{name}", model, ghost=name == "reference")
        poses = body_poses(model, diagnosis.robot.chain.link_positions(q[::every]))
        position, orientation, tool = poses
        log_motion(stream, f"{root}/arm/{name}", model, time, position, orientation)
        if name == "measured":
            way = rr.LineStrips3D([tool], colors=[REFERENCE], radii=[0.002 * reach(model)])
            stream.log(f"{root}/path/{name}", way, static=True)


def _log_joints(stream: rr.RecordingStream, diagnosis: Diagnosis, index: int) -> None:
    """Residuals before and after, each named effect's torque, and the position of every joint."""
    run, robot = diagnosis.prepared.runs[index], diagnosis.robot
    before, after = diagnosis.parameters_only[1].residual[index], diagnosis.final[1].residual[index]
    laws = [partial_residual(diagnosis, each)[0][index] for each in diagnosis.effects]
    for joint, unit in enumerate(robot.units()):
        root, used = _joint_root(diagnosis, index, joint), run.used[:, joint]
        for name, residual, colour in (("before", before, BEFORE), ("after", after, AFTER)):
            # Samples at rest do not count; NaN marks them here.
            values = np.where(used, residual[:, joint], np.nan)
            log_series(stream, f"{root}/residual/{name}", f"{name} [{unit}]", colour, run.time, values)
        for number, (each, law) in enumerate(zip(diagnosis.effects, laws, strict=True)):
            if not np.any(law[:, joint]):
                continue
            label = f"{words.labelled(robot, each.effect, each.joint, each.into)} [{unit}]"
            path = f"{root}/effects/{number + 1}_{each.effect}"
            colour = EFFECT_COLOURS[number % len(EFFECT_COLOURS)]
            log_series(stream, path, label, colour, run.time, law[:, joint])
        length = "m" if robot.chain.is_slide[joint] else "rad"
        log_series(stream, f"{root}/position", f"position [{length}]", MEASURED, run.time, run.q[:, joint])


def _log_evidence(stream: rr.RecordingStream, diagnosis: Diagnosis) -> None:
    ranked = sorted(diagnosis.ranked, key=lambda each: (-each.probability, -each.score))[:MOST_CANDIDATES]
    if ranked:
        stream.log(
            "evidence", rr.BarChart(np.array([100 * each.probability for each in ranked])), static=True
        )


def _markdown(diagnosis: Diagnosis, next_experiment: NextExperiment | None) -> str:
    """Verdict, effects, the gap a joint and the candidates in the order of the bars."""
    robot, gap = diagnosis.robot, diagnosis.gap
    lines = [f"**{diagnosis.sentence}**", ""]
    for each in diagnosis.effects:
        label = words.labelled(robot, each.effect, each.joint, each.into)
        lines.append(
            f"- {label}: {100 * each.probability:.0f} %; {words.parameters(each, diagnosis.run_names)}"
        )
    lines += ["", "| joint | unit | as given | re-identified | with effects | noise |", "|---" * 6 + "|"]
    for joint, (name, unit) in enumerate(zip(robot.joint_names, robot.units(), strict=True)):
        stages = (gap.nominal, gap.parameters, gap.effects, gap.noise_floor)
        lines.append(f"| {name} | {unit} | " + " | ".join(f"{s[joint]:.3g}" for s in stages) + " |")
    ranked = sorted(diagnosis.ranked, key=lambda each: (-each.probability, -each.score))[:MOST_CANDIDATES]
    lines += ["", "Evidence, in the order of the bars:", ""]
    for number, one in enumerate(ranked):
        label = words.labelled(robot, one.effect, one.joint, one.into)
        reason = f", {one.reason}" if one.reason else ""
        lines.append(f"{number}. {label}: {100 * one.probability:.0f} %{reason}")
    if next_experiment is not None:
        lines += ["", f"**Next:** {next_experiment.why}"]
    return "\n".join(lines)


def _layout(diagnosis: Diagnosis, order: list[int]) -> rrb.Blueprint:
    """A tab a run, the loudest first: the arm and the findings beside the residuals."""
    return rrb.Blueprint(
        rrb.Tabs(*(_run_tab(diagnosis, index) for index in order), active_tab=0),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline=TIMELINE, play_state="playing", loop_mode="all"),
    )


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
    size = reach(diagnosis.robot.model)
    root = _root(diagnosis, index)
    scene = rrb.Spatial3DView(
        origin=root,
        contents=[f"+ {root}/arm/**", f"+ {root}/path/**", f"+ {root}/floor"],
        name="Measured, and its reference as a ghost" if has_reference else "Measured",
        line_grid=False,
        eye_controls=rrb.EyeControls3D(
            position=(1.15 * size, -1.1 * size, 0.9 * size),
            look_target=(0.0, 0.0, 0.38 * size),
            eye_up=(0.0, 0.0, 1.0),
        ),
    )
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
