"""report.html of a loop: what each round said, what was proposed, and what acts."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from identification.excitation.trajectory import Trajectory
from testbench.files import write_text
from testbench.report.page import Tile, plot, rendered, time_stamp
from testbench.robot import Robot

from . import figures, wording
from .outcome import Outcome, Round

SAMPLES = 2000


def write_page(found: Outcome, robot: Robot, motions: Sequence[Trajectory], path: Path) -> None:
    """Write the page, whole or not at all. motions: of each round, the first of those that it ran."""
    units = ["m" if slide else "rad" for slide in robot.chain.is_slide]
    proposed = found.follow == "proposed"
    text = rendered(
        "loop.html",
        ("studies.loop", "testbench.report"),
        time_stamp(),
        name=found.name,
        robot=found.robot,
        headline=wording.headline(found),
        tiles=_tiles(found),
        rounds=[_row(each) for each in found.rounds],
        acts=[wording.truth(*each) for each in zip(found.acts, found.values, strict=True)],
        found=[wording.estimated(each) for each in found.rounds[-1].document["effects"]],
        probabilities=plot("probabilities", "", figures.probabilities(found)),
        motions=[
            plot(
                f"motion-{number}",
                f"Run in round {number}" + (f", proposed after round {number - 1}" if proposed else ""),
                figures.motions(robot.joint_names, units, motions[0], motion, number),
            )
            for number, motion in enumerate(motions[1:], start=2)
        ],
        extents=[_extent(number, motion) for number, motion in enumerate(motions, start=1)],
        joints=[f"{name}, {unit}" for name, unit in zip(robot.joint_names, units, strict=True)],
    )
    write_text(text, path)


def _tiles(found: Outcome) -> list[Tile]:
    last = found.rounds[-1]
    tiles = [
        Tile("yes" if found.is_resolved else "no", "resolved", found.is_resolved),
        Tile("yes" if found.is_right else "no", "names what acts, at its joint", found.is_right),
        Tile(str(last.number), "rounds"),
        Tile(str(last.runs), "runs"),
    ]
    experiments = [each.document["next_experiment"] for each in found.rounds if each.proposes]
    if experiments:
        parts = [f"{experiments[0][key]:.2g}" for key in ("separation_now", "separation")]
        tiles.append(Tile(" → ".join(parts), "times the noise, first motion and proposed"))
    return tiles


def _row(each: Round) -> dict[str, Any]:
    experiment = each.document["next_experiment"]
    return {
        "number": each.number,
        "runs": each.runs,
        "said": wording.said(each),
        "why": "" if experiment is None else experiment["why"],
        "proposed": wording.proposed(each),
        "hidden": len(each.hidden),
        "folder": f"round_{each.number}",
    }


def _extent(number: int, motion: Trajectory) -> dict[str, Any]:
    """How far and how fast each joint goes: half its range, and its largest speed."""
    position, velocity, _ = motion.evaluate(np.linspace(0, motion.duration, SAMPLES))
    return {
        "label": f"round {number}",
        "seconds": motion.duration,
        "ranges": np.ptp(position, axis=0) / 2,
        "speeds": np.abs(velocity).max(axis=0),
    }
