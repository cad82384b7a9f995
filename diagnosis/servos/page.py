"""report.html of a diagnosis of position servos."""

from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import plotly.graph_objects as go
from markupsafe import Markup
from plotly.offline import get_plotlyjs
from plotly.subplots import make_subplots

from identification.output_error.servo_run import ServoRun
from testbench.drives.effects import drive_effects
from testbench.drives.identified import simulated
from testbench.files import replacing
from testbench.report.page import Tile, page_environment, plot
from testbench.report.style import MUTED, PREDICTED, TEMPLATE, envelope

from . import words
from .findings import ServoDiagnosis

POINTS = 900
STAGES = (("as given", "#9aa3ad"), ("re-identified", "#f0a860"), ("with the effects", "#1f77b4"))


def write_servo_report(
    diagnosis: ServoDiagnosis, runs: Sequence[ServoRun], not_in_mjcf: Sequence[str], path: Path
) -> None:
    """Write report.html, whole or not at all. Two pages of one diagnosis differ in the time stamp only."""
    found, effects = diagnosis.found, drive_effects()
    text = (
        page_environment("diagnosis.servos", "testbench.report")
        .get_template("servos.html")
        .render(
            robot=found.robot.name,
            model=found.robot.described,
            created=datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
            runs=list(diagnosis.runs),
            sentence=words.sentence(diagnosis),
            tiles=_tiles(diagnosis),
            where=diagnosis.where,
            effects=[
                {
                    "title": words.title(each),
                    "law": each.law,
                    "probability": 100 * each.probability,
                    "confusable": ", ".join(effects[name].title for name in each.confusable_with),
                }
                for each in diagnosis.effects
            ],
            candidates=[
                {
                    "label": words.labelled(each.effect, each.joint),
                    "probability": 100 * each.probability,
                    "score": each.score,
                    "reason": each.reason,
                }
                for each in diagnosis.candidates
            ],
            unknown=100 * diagnosis.unknown,
            beside=words.beside(diagnosis),
            gap=plot("gap", "", gap_by_joint(diagnosis)),
            motions=[plot(f"run-{index}", run.name, _run(diagnosis, run)) for index, run in enumerate(runs)],
            experiment=diagnosis.experiment,
            not_in_mjcf=list(not_in_mjcf),
            notes=words.notes(diagnosis),
            plotly=Markup(get_plotlyjs()),
        )
    )
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def _tiles(diagnosis: ServoDiagnosis) -> list[Tile]:
    tiles = [Tile(diagnosis.verdict, "verdict", diagnosis.verdict != "unknown")]
    if diagnosis.effects:
        tiles.append(Tile(f"{diagnosis.effects[0].probability:.0%}", "certain of the first effect"))
    for values, label in (
        (diagnosis.given, "position error, model as given"),
        (diagnosis.corrected, "after correction"),
    ):
        tiles.append(Tile(f"{1e3 * np.sqrt(np.mean(values**2)):.3g} mrad", label))
    return tiles


def gap_by_joint(diagnosis: ServoDiagnosis) -> go.Figure:
    """Position error of each joint by stage, mrad, and what the encoders' quanta leave."""
    names = list(diagnosis.found.robot.joint_names)
    stages = (diagnosis.given, diagnosis.parameters, diagnosis.corrected)
    figure = go.Figure(layout={"template": TEMPLATE, "height": 320, "barmode": "group"})
    for (name, colour), values in zip(STAGES, stages, strict=True):
        figure.add_bar(x=names, y=1e3 * values, name=name, marker_color=colour)
    figure.add_scatter(
        x=names, y=1e3 * diagnosis.noise, name="noise", mode="markers", marker={"color": "#1b7f4d"}
    )
    figure.update_yaxes(title="RMS, mrad")
    return figure


def _run(diagnosis: ServoDiagnosis, run: ServoRun) -> go.Figure:
    """A run's position error over time, a row a joint: by the model as given and as corrected."""
    found = diagnosis.found
    time = np.arange(len(run.position)) / run.rate
    errors = [
        1e3 * (simulated(found.limbs, table, run).position - run.position)
        for table in (found.given, found.identified)
    ]
    names = found.robot.joint_names
    figure = make_subplots(len(names), 1, shared_xaxes=True, vertical_spacing=0.02)
    for joint, name in enumerate(names):
        kept = envelope(POINTS, *(error[:, joint] for error in errors))
        for error, label, colour in zip(errors, ("as given", "corrected"), (MUTED, PREDICTED), strict=True):
            figure.add_scatter(
                x=time[kept], y=error[kept, joint], name=label, line={"color": colour, "width": 1},
                showlegend=joint == 0, row=joint + 1, col=1,
            )  # fmt: skip
        figure.update_yaxes(title={"text": name, "font": {"size": 10}}, row=joint + 1, col=1)
    figure.update_xaxes(title="s", row=len(names), col=1)
    figure.update_layout(template=TEMPLATE, height=110 * len(names) + 80)
    return figure
