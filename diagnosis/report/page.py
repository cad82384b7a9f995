"""report.html of a diagnosis: one page that needs nothing but a browser."""

from pathlib import Path

from testbench.files import write_text
from testbench.findings import torque_unit
from testbench.report.page import Tile, plot, rendered, time_stamp

from ..correction.corrected_mjcf import Written
from ..correction.forward_gap import ForwardGap
from ..decision.findings import STAGES, Diagnosis
from ..experiment.discriminating_motion import NextExperiment
from . import figures, heat_map, notes, signature, words


def write_report(
    diagnosis: Diagnosis,
    path: str | Path,
    written: Written | None = None,
    forward: ForwardGap | None = None,
    next_experiment: NextExperiment | None = None,
) -> None:
    """Write report.html, whole or not at all. Two pages of one diagnosis differ in the time stamp only."""
    write_text(render(diagnosis, time_stamp(), written, forward, next_experiment), path)


def render(
    diagnosis: Diagnosis,
    created: str,
    written: Written | None = None,
    forward: ForwardGap | None = None,
    next_experiment: NextExperiment | None = None,
) -> str:
    """The page as text."""
    densest = words.where(diagnosis)
    any_likely = any(each.probability >= words.LEAST_SHOWN for each in diagnosis.ranked)
    return rendered(
        "diagnosis.html",
        ("diagnosis.report", "testbench.report"),
        created,
        diagnosis=diagnosis,
        robot=diagnosis.robot,
        words=words,
        of_the_logs=[
            *notes.differences(diagnosis.differences, diagnosis.robot),
            *notes.late(diagnosis),
            *notes.silent(diagnosis),
        ],
        tiles=_tiles(diagnosis),
        where=plot("where", "", heat_map.where(diagnosis)) if densest else None,
        densest=densest,
        evidence=plot("evidence", "", figures.evidence(diagnosis)) if any_likely else None,
        how_far=[
            plot("waterfall", "All joints", figures.waterfall(diagnosis)),
            plot("gap", "Each joint", figures.gap_by_joint(diagnosis)),
        ],
        signatures=[
            plot(
                f"signature-{index}",
                signature.caption(diagnosis, each),
                signature.signature(diagnosis, each),
            )
            for index, each in enumerate(diagnosis.effects)
        ],
        residual=plot("residual", "", figures.before_and_after(diagnosis)),
        forward=forward,
        closed_loop=None
        if forward is None or not forward.motion
        else plot("forward", "", figures.forward(diagnosis, forward)),
        experiment=next_experiment,
        written=written,
        notes=_notes(diagnosis),
    )


def _notes(diagnosis: Diagnosis) -> list[str]:
    """All else that is to be known, a sentence each."""
    return [
        *diagnosis.notes,
        *notes.too_little_motion(diagnosis),
        *notes.everywhere(diagnosis),
        *notes.mended(diagnosis),
        *notes.recurrence(diagnosis),
        *notes.noise_unseen(diagnosis),
        *notes.near_rest(diagnosis),
    ]


def _tiles(diagnosis: Diagnosis) -> list[Tile]:
    gap, unit = diagnosis.gap, torque_unit(diagnosis.robot)
    total = {stage: float(getattr(gap, stage).sum()) for stage in STAGES}
    tiles = [Tile(words.verdict(diagnosis), "verdict", diagnosis.verdict in ("none", "parameters", "effect"))]
    if diagnosis.effects:
        tiles.append(Tile(f"{100 * diagnosis.effects[0].probability:.0f} %", "certain of the first effect"))
    tiles.append(Tile(f"{total['nominal']:.3g} {unit}", "torque error, model as given"))
    tiles.append(Tile(f"{total['effects']:.3g} {unit}", "after correction"))
    closed = gap.reported_closed
    if closed is not None and diagnosis.effects:
        tiles.append(Tile(f"{100 * closed:.0f} %", "of re-identification's rest explained", closed >= 0.8))
    return tiles
