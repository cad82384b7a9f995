"""session.rrd: one identification as a Rerun recording with an opening layout.

Entities, all on the timeline ``time`` (seconds since the start of each run):

    summary, parameters/table                      text
    parameters/chart/...                           estimates against truth, 2D
    <run>/floor, <run>/path/{measured,reference}   3D
    <run>/arm/{measured,reference}/<body>          3D, poses over time
    <run>/joints/<joint>/position/{measured,reference}
    <run>/joints/<joint>/torque/{measured,predicted}
    <run>/joints/<joint>/residual/{residual,floor_upper,floor_lower}

<run> is ``validation_1``, ``fit_1`` and so on. Two recordings of the same result hold the same data, but not
the same bytes: Rerun (0.41) makes ids of rows and chunks of the time of writing, and writes the metadata of
columns in an order that differs even when the very same chunks are written twice.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from identification.estimate import TorqueFit

from .findings import headline, significant, torque_error
from .log import Recording
from .parameter_chart import log_parameters
from .results import IdentificationResult
from .robot import Robot
from .scene import body_poses, log_floor, log_motion, log_robot, reach
from .session_file import session_file

Array = NDArray[np.float64]

APPLICATION = "identification_testbench"
TIMELINE = "time"
PLOT_RATE, POSE_RATE = 100.0, 50.0

MEASURED, PREDICTED, REFERENCE, FLOOR = (31, 119, 180), (255, 127, 14), (225, 225, 225), (160, 160, 160)
# What is measured is drawn wide, so that it shows under what is laid over it.
WIDE, NARROW = 3.0, 1.2
# One colour a joint where several joints share a plot.
JOINT_COLOURS = (
    (31, 119, 180),
    (255, 127, 14),
    (44, 160, 44),
    (214, 39, 40),
    (148, 103, 189),
    (140, 86, 75),
    (227, 119, 194),
    (127, 127, 127),
    (188, 189, 34),
    (23, 190, 207),
)


@dataclass(frozen=True)
class _Run:
    """One run and where it lies in the recording."""

    root: str
    title: str
    fit: TorqueFit
    recording: Recording


def write_session(result: IdentificationResult, path: str | Path) -> None:
    """Write the Rerun recording of a result, whole or not at all."""
    runs = _runs(result)
    with session_file(path, APPLICATION, result.robot.name, _layout(result, runs)) as stream:
        stream.send_recording_name(f"{result.robot.name}, {result.estimate.estimator}")
        stream.log("summary", rr.TextDocument(_summary(result), media_type="text/markdown"), static=True)
        log_parameters(stream, "parameters", result)
        for run in runs:
            each = run.recording
            log_scene(stream, run.root, result.robot, each.time, each.position, each.reference_position)
            _log_joints(stream, run, result)


def _runs(result: IdentificationResult) -> tuple[_Run, ...]:
    """Validation runs first: they are what the result is judged by."""
    runs = []
    for role, fits, recordings in (
        ("validation", result.validations, result.validation_recordings),
        ("fit", result.fits, result.fit_recordings),
    ):
        for index, (fit, recording) in enumerate(zip(fits, recordings, strict=True)):
            runs.append(_Run(f"{role}_{index + 1}", f"{role.capitalize()}: {fit.name}", fit, recording))
    return tuple(runs)


def log_scene(
    stream: rr.RecordingStream, root: str, robot: Robot, time: Array, measured: Array, reference: Array | None
) -> None:
    """The floor, the arm as measured, its reference as a ghost, and the way of the tool.

    time: (N,) s, evenly spaced. measured, reference: positions (N, n).
    """
    model = robot.model
    stream.log(root, rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    log_floor(stream, f"{root}/floor", model)
    every = stride((len(time) - 1) / (time[-1] - time[0]), POSE_RATE)
    column = time_column(time[::every] - time[0])
    for name, q, colour, width in (
        ("measured", measured, MEASURED, 0.004),
        ("reference", reference, REFERENCE, 0.002),
    ):
        if q is None:
            continue
        log_robot(stream, f"{root}/arm/{name}", model, ghost=name == "reference")
        position, orientation, tool = body_poses(model, robot.chain.link_positions(q[::every]))
        log_motion(stream, f"{root}/arm/{name}", model, column, position, orientation)
        way = rr.LineStrips3D([tool], colors=[colour], radii=[width * reach(model)])
        stream.log(f"{root}/path/{name}", way, static=True)


def _log_joints(stream: rr.RecordingStream, run: _Run, result: IdentificationResult) -> None:
    """Position, torque and residual of every joint."""
    recording, fit = run.recording, run.fit
    every = stride(recording.sample_rate, PLOT_RATE)
    time = recording.time[::every] - recording.time[0]
    fit_every = stride(1 / float(np.median(np.diff(fit.time))), PLOT_RATE)
    fit_time = fit.time[::fit_every]
    floor = None if result.comparison is None else result.comparison.noise_floor
    units = zip(result.robot.units(), result.robot.chain.is_slide, strict=True)
    for joint, (unit, slide) in enumerate(units):
        name = result.robot.joint_names[joint]
        root = _joint_path(run, name)
        length = "m" if slide else "rad"
        log_series(
            stream,
            f"{root}/position/measured",
            f"measured [{length}]",
            MEASURED,
            time,
            recording.position[::every, joint],
        )
        if recording.reference_position is not None:
            reference = recording.reference_position[::every, joint]
            log_series(
                stream, f"{root}/position/reference", f"reference [{length}]", REFERENCE, time, reference
            )
        measured, predicted = fit.measured[::fit_every, joint], fit.predicted[::fit_every, joint]
        log_series(stream, f"{root}/torque/measured", f"measured [{unit}]", MEASURED, fit_time, measured)
        log_series(stream, f"{root}/torque/predicted", f"predicted [{unit}]", PREDICTED, fit_time, predicted)
        colour = JOINT_COLOURS[joint % len(JOINT_COLOURS)]
        # Samples at rest do not count; NaN marks them here.
        residual = np.where(fit.used[::fit_every, joint], measured - predicted, np.nan)
        log_series(
            stream, f"{root}/residual/residual", f"{name} residual [{unit}]", colour, fit_time, residual
        )
        if floor is not None:
            ends = fit_time[[0, -1]]
            for side, sign in (("upper", 2.0), ("lower", -2.0)):
                level = np.full(2, sign * floor[joint])
                legend = f"{'+' if sign > 0 else '−'}2 × noise floor [{unit}]"
                log_series(stream, f"{root}/residual/floor_{side}", legend, FLOOR, ends, level)


def log_series(
    stream: rr.RecordingStream, path: str, name: str, colour: tuple[int, int, int], time: Array, values: Array
) -> None:
    """One line of a plot, with gaps where values are NaN."""
    width = WIDE if path.endswith("/measured") else NARROW
    stream.log(path, rr.SeriesLines(names=[name], colors=[colour], widths=[width]), static=True)
    # A row without a value leaves the gap: unlike NaN, it compares equal to itself in "rerun rrd compare".
    known = np.isfinite(values)
    rows = rr.Scalars.columns(scalars=values[known]).partition(known.astype(np.int64))
    stream.send_columns(path, [time_column(time)], rows)


def time_column(time: Array) -> rr.TimeColumn:
    """Seconds (N,) as rows of the timeline."""
    # Rounded here, since Rerun cuts off what is below a nanosecond.
    return rr.TimeColumn(TIMELINE, duration=np.round(1e9 * time).astype("timedelta64[ns]"))


def stride(rate: float, wanted: float) -> int:
    """Every how many samples to show, so that no more than about ``wanted`` a second are left."""
    return max(1, round(rate / wanted))


def _joint_path(run: _Run, joint: str) -> str:
    return f"{run.root}/joints/{rr.escape_entity_path_part(joint)}"


def _summary(result: IdentificationResult) -> str:
    """The headline and the torque errors a joint, as Markdown."""
    shown = []
    for role, error in (("fit", torque_error(result.fits)), ("validation", torque_error(result.validations))):
        if error is not None:
            shown.append((f"RMS {role}", error.rms))
    if result.comparison is not None:
        shown.append(("noise floor", result.comparison.noise_floor))
    lines = [headline(result), "", f"| joint | unit | {' | '.join(heading for heading, _ in shown)} |"]
    lines.append("|---" * (2 + len(shown)) + "|")
    for joint, (name, unit) in enumerate(zip(result.robot.joint_names, result.robot.units(), strict=True)):
        cells = [name, unit, *(significant(values[joint], 3) for _, values in shown)]
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def _layout(result: IdentificationResult, runs: tuple[_Run, ...]) -> rrb.Blueprint:
    """A tab a run (the arm, the summary and its plots), and two for the parameters."""
    known = result.comparison is not None
    parameters = (
        rrb.Spatial2DView(
            origin="parameters/chart",
            name="Parameters against truth, ±2 σ bars" if known else "Parameters: ±2 σ bars over the value",
        ),
        rrb.TextDocumentView(origin="parameters/table", name="Table of parameters"),
    )
    return opening_layout(*(_run_tab(result, run) for run in runs), *parameters)


def opening_layout(*tabs: rrb.View | rrb.Horizontal) -> rrb.Blueprint:
    """The tabs, the first one open, and nothing of Rerun's own in their way."""
    return rrb.Blueprint(
        rrb.Tabs(*tabs, active_tab=0),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline=TIMELINE, play_state="playing", loop_mode="all"),
    )


def _run_tab(result: IdentificationResult, run: _Run) -> rrb.Horizontal:
    names = result.robot.joint_names
    overview = rrb.Grid(
        *(
            rrb.TimeSeriesView(origin=f"{_joint_path(run, name)}/torque", name=f"{name}: torque")
            for name in names
        ),
        grid_columns=1 if len(names) == 1 else 2,
        name="Torque, all joints",
    )
    residuals = rrb.TimeSeriesView(
        origin=run.root,
        contents=[f"+ {_joint_path(run, name)}/residual/residual" for name in names],
        name="Residuals, all joints",
    )
    joints = [
        rrb.Vertical(
            rrb.TimeSeriesView(origin=f"{_joint_path(run, name)}/position", name="Position"),
            rrb.TimeSeriesView(origin=f"{_joint_path(run, name)}/torque", name="Torque"),
            rrb.TimeSeriesView(origin=f"{_joint_path(run, name)}/residual", name="Residual"),
            name=name,
        )
        for name in names
    ]
    return rrb.Horizontal(
        rrb.Vertical(
            scene_view(result.robot, run.root, run.recording.reference_position is not None),
            rrb.TextDocumentView(origin="summary", name="Summary"),
            row_shares=[3, 2],
        ),
        rrb.Tabs(overview, residuals, *joints, active_tab=0),
        column_shares=[2, 3],
        name=run.title,
    )


def scene_view(robot: Robot, root: str, has_reference: bool) -> rrb.Spatial3DView:
    """The view of what ``log_scene`` shows."""
    size = reach(robot.model)
    return rrb.Spatial3DView(
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
