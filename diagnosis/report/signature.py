"""The law of a named effect over the data that it explains."""

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray
from plotly.subplots import make_subplots

from testbench.report.style import (
    MUTED,
    POINTS,
    PREDICTED,
    TEMPLATE,
    add_line,
    binned_mean,
    envelope,
    single,
)

from ..data.run import Run
from ..decision.findings import Diagnosis, NamedEffect
from .reported_limit import reported_limit
from .words import labelled, place

Array = NDArray[np.float64]


def signature(diagnosis: Diagnosis, named: NamedEffect) -> go.Figure:
    """Plot of the residual without the effect over velocity, position and time, and of the fitted law.

    Of a limit that leaves nothing (flat_top.py), the torque itself.

    The residual before is the final model's with this effect's own torque put back, so that the points
    do not depend on what re-identified parameters would have absorbed.
    """
    if not named.candidate.shows:
        return reported_limit(diagnosis, named)
    joint = _shown_joint(diagnosis, named)
    robot, runs = diagnosis.robot, diagnosis.prepared.runs
    law = diagnosis.torque_of(named)
    before = [left + own for left, own in zip(diagnosis.final[1].residual, law, strict=True)]
    used = np.concatenate([run.used[:, joint] for run in runs])
    # A coupling's friction is on the summed speed of its two joints.
    moving = [joint] if named.into is None or named.joint is None else [named.joint, named.into]
    velocity = np.concatenate([run.dq[:, moving].sum(axis=1) for run in runs])[used]
    position = np.concatenate([run.q[:, joint] for run in runs])[used]
    left, torque = np.concatenate(before)[:, joint][used], np.concatenate(law)[:, joint][used]
    slide = robot.chain.is_slide[joint]
    panels = (
        (velocity, ("summed " if len(moving) > 1 else "") + "velocity, " + ("m/s" if slide else "rad/s")),
        (position, "position, " + ("m" if slide else "rad")),
    )
    figure = make_subplots(rows=1, cols=3, horizontal_spacing=0.07, column_widths=[0.3, 0.3, 0.4])
    for column, (x, axis) in enumerate(panels, start=1):
        _add_scatter(figure, column, x, left, torque)
        figure.update_xaxes(title=axis, row=1, col=column)
    run = int(np.argmax([np.sum(torque[:, joint] ** 2) for torque in law]))
    _add_history(figure, runs[run], joint, before[run][:, joint], law[run][:, joint])
    figure.update_xaxes(title=f"time in {runs[run].name}, s", row=1, col=3)
    figure.update_yaxes(title=f"{robot.joint_names[joint]}, {robot.units()[joint]}", row=1, col=1)
    return figure.update_layout(template=TEMPLATE, height=320, legend_y=1.03)


def _add_scatter(figure: go.Figure, column: int, x: Array, left: Array, torque: Array) -> None:
    """Residual and law (N,) over a quantity x (N,), with the means of both, in one panel."""
    every, where = slice(None, None, max(1, len(left) // POINTS)), {"row": 1, "col": column}
    for name, values, colour, opacity in (
        ("residual before", left, MUTED, 0.55),
        ("fitted law", torque, PREDICTED, 0.5),
    ):
        figure.add_scattergl(
            x=single(x[every]),
            y=single(values[every]),
            name=name,
            mode="markers",
            marker={"size": 3, "color": colour, "opacity": opacity},
            showlegend=column == 1,
            **where,
        )
    for y, colour, label in ((left, "#3c4650", "its mean"), (torque, "#c25a00", "the law's mean")):
        centres, means = binned_mean(x, y)
        add_line(figure, centres, means, label, colour, 2.0, showlegend=column == 1, **where)


def _add_history(figure: go.Figure, shown: Run, joint: int, left: Array, torque: Array) -> None:
    """Residual and law (M,) of one run over its time, in the third panel."""
    kept = envelope(POINTS, left, torque)
    for values, name, colour in ((left, "residual before", MUTED), (torque, "fitted law", PREDICTED)):
        masked = np.where(shown.used[:, joint], values, np.nan)[kept]
        add_line(figure, shown.time[kept], masked, name, colour, showlegend=False, row=1, col=3)


def caption(diagnosis: Diagnosis, named: NamedEffect) -> str:
    """Caption of a signature plot: the effect and its joint, and the joint whose torque is shown."""
    shown = diagnosis.robot.joint_names[_shown_joint(diagnosis, named)]
    at = place(diagnosis.robot, named.joint, named.into)
    return labelled(diagnosis.robot, named) + ("" if shown == at else f": torque of {shown}")


def _shown_joint(diagnosis: Diagnosis, named: NamedEffect) -> int:
    """The joint on which the effect's torque stands out most against what is left."""
    if named.joint is not None and named.joint in named.candidate.member.rows:
        return named.joint
    law = np.concatenate(diagnosis.torque_of(named))
    return int(np.argmax(np.mean(law**2, axis=0) * diagnosis.final[1].weights))
