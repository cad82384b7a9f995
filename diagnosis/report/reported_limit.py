"""The limit of a drive that reports what it gave: its torque over time, and how often it is how large."""

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from testbench.report.style import MUTED, POINTS, PREDICTED, TEMPLATE, add_line, envelope, single

from ..decision.findings import Diagnosis, NamedEffect

# Of the limit: samples are counted in such steps, and those of the last one below it are at it.
STEP = 0.02


def reported_limit(diagnosis: Diagnosis, named: NamedEffect) -> go.Figure:
    """Torque of the run that is at the limit most, and of all runs by size; the limit over both."""
    assert named.joint is not None
    robot, joint, limit = diagnosis.robot, named.joint, named.candidate.member.shape["limit"]
    torques = [run.logged.tau[:, joint] for run in diagnosis.prepared.runs]
    most = int(np.argmax([np.sum(np.abs(torque) > (1 - STEP) * limit) for torque in torques]))
    shown = diagnosis.prepared.runs[most]
    kept = envelope(POINTS, torques[most])
    figure = make_subplots(rows=1, cols=2, horizontal_spacing=0.09, column_widths=[0.6, 0.4])
    time, torque = (shown.logged.time - shown.logged.time[0])[kept], torques[most][kept]
    add_line(figure, time, torque, "reported torque", MUTED, row=1, col=1)
    for level in (-limit, limit):
        figure.add_hline(y=level, line={"color": PREDICTED, "width": 1.4, "dash": "dash"}, row=1, col=1)
    size = np.abs(np.concatenate(torques))
    edges = np.arange(0.0, max(float(size.max()) / limit, 1.0) + 2 * STEP, STEP) - STEP / 2
    counts, _ = np.histogram(size / limit, edges)
    figure.add_bar(
        x=single((edges[:-1] + STEP / 2) * limit),
        y=single(100 * counts / len(size)),
        marker_color=MUTED,
        showlegend=False,
        row=1,
        col=2,
    )
    figure.add_vline(x=limit, line={"color": PREDICTED, "width": 1.4, "dash": "dash"}, row=1, col=2)
    unit = robot.units()[joint]
    figure.update_xaxes(title=f"time in {shown.name}, s", row=1, col=1)
    figure.update_yaxes(title=f"{robot.joint_names[joint]}, {unit}", row=1, col=1)
    figure.update_xaxes(title=f"size of the torque, {unit}", row=1, col=2)
    figure.update_yaxes(title="samples, %", row=1, col=2)
    return figure.update_layout(template=TEMPLATE, height=320, legend_y=1.03, bargap=0.05)
