"""report.html of a diagnosis of position servos."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import plotly.graph_objects as go

from identification.output_error.servo_run import ServoRun
from testbench.drives.identified import simulated
from testbench.files import write_text
from testbench.report.page import Tile, plot, rendered, time_stamp
from testbench.report.run_figures import bars_by_joint, by_joint

from . import words
from .findings import ServoDiagnosis


def write_servo_report(
    diagnosis: ServoDiagnosis, runs: Sequence[ServoRun], not_in_mjcf: Sequence[str], path: Path
) -> None:
    """Write report.html, whole or not at all. Two pages of one diagnosis differ in the time stamp only."""
    text = rendered(
        "servos.html",
        ("diagnosis.servos", "testbench.report"),
        time_stamp(),
        diagnosis=diagnosis,
        robot=diagnosis.found.robot,
        words=words,
        tiles=_tiles(diagnosis),
        gap=plot("gap", "", gap_by_joint(diagnosis)),
        motions=[plot(f"run-{index}", run.name, _run(diagnosis, run)) for index, run in enumerate(runs)],
        not_in_mjcf=not_in_mjcf,
    )
    write_text(text, path)


def _tiles(diagnosis: ServoDiagnosis) -> list[Tile]:
    tiles = [Tile(diagnosis.verdict, "verdict", diagnosis.verdict != "unknown")]
    if diagnosis.effects:
        tiles.append(Tile(f"{diagnosis.effects[0].probability:.0%}", "certain of the first effect"))
    for values, label in (
        (diagnosis.given, "position error, model as given"),
        (diagnosis.corrected, "after correction"),
    ):
        tiles.append(Tile(f"{words.milli(values)} mrad", label))
    return tiles


def gap_by_joint(diagnosis: ServoDiagnosis) -> go.Figure:
    """Position error of each joint by stage, mrad, and what the encoders' quanta leave."""
    bars = {
        "as given": diagnosis.given,
        "re-identified": diagnosis.parameters,
        "with the effects": diagnosis.corrected,
        "noise": diagnosis.noise,
    }
    in_milli = {name: 1e3 * values for name, values in bars.items()}
    return bars_by_joint(in_milli, diagnosis.found.robot.joint_names, "RMS, mrad")


def _run(diagnosis: ServoDiagnosis, run: ServoRun) -> go.Figure:
    """A run's position error over time, a panel a joint: by the model as given and as corrected."""
    found = diagnosis.found
    tables = {"as given": found.given, "corrected": found.identified}
    errors = {
        label: 1e3 * (simulated(found.limbs, table, run).position - run.position)
        for label, table in tables.items()
    }
    names = found.robot.joint_names
    return by_joint(np.arange(len(run.position)) / run.rate, errors, names, ("mrad",) * len(names))
