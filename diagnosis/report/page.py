"""report.html of a diagnosis: one page that needs nothing but a browser."""

from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path

from markupsafe import Markup
from plotly.offline import get_plotlyjs

from testbench.files import replacing
from testbench.report.page import Tile, page_environment, plot
from testbench.robot import Robot

from ..correction.closed_loop_gap import ForwardGap
from ..correction.corrected_mjcf import Written
from ..correction.file_error import FileError
from ..decision.findings import Diagnosis, RankedCandidate
from ..experiment.discriminating_motion import NextExperiment
from . import figures, heat_map, signature, words


def write_report(
    diagnosis: Diagnosis,
    path: str | Path,
    written: Written | None = None,
    forward: ForwardGap | None = None,
    next_experiment: NextExperiment | None = None,
) -> None:
    """Write report.html, whole or not at all. Two pages of one diagnosis differ in the time stamp only."""
    created = datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC")
    text = render(diagnosis, created, written, forward, next_experiment)
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def render(
    diagnosis: Diagnosis,
    created: str,
    written: Written | None = None,
    forward: ForwardGap | None = None,
    next_experiment: NextExperiment | None = None,
) -> str:
    """The page as text."""
    robot = diagnosis.robot
    ranked = sorted(diagnosis.ranked, key=lambda each: (-each.probability, -each.score))
    hidden: dict[str, list[str]] = {}
    for effect, joint in diagnosis.not_observable:
        hidden.setdefault(words.title(effect), []).append(words.place(robot, joint))
    environment = page_environment("diagnosis.report", "testbench.report")
    densest = words.where(diagnosis)
    any_likely = any(each.probability >= words.LEAST_SHOWN for each in ranked)
    return environment.get_template("diagnosis.html").render(
        robot=robot.name,
        model=robot.described,
        created=created,
        runs=[run.name for run in diagnosis.prepared.runs],
        sentence=diagnosis.sentence,
        log_findings=diagnosis.log_findings,
        of_the_logs=[*words.differences(diagnosis), *words.late(diagnosis), *words.silent(diagnosis)],
        tiles=_tiles(diagnosis),
        where=plot("where", "", heat_map.where(diagnosis)) if densest else None,
        densest=densest,
        effects=_effects(diagnosis),
        evidence=plot("evidence", "", figures.evidence(diagnosis)) if any_likely else None,
        ruled_out=_ruled_out(diagnosis, ranked),
        hidden=[(name, ", ".join(places)) for name, places in hidden.items()],
        how_far=[
            plot("waterfall", "All joints", figures.waterfall(diagnosis)),
            plot("gap", "Each joint", figures.gap_by_joint(diagnosis)),
        ],
        joints=_joints(diagnosis),
        signatures=[
            plot(
                f"signature-{index}",
                signature.caption(diagnosis, each),
                signature.signature(diagnosis, each),
            )
            for index, each in enumerate(diagnosis.effects)
        ],
        residual=plot("residual", "", figures.before_and_after(diagnosis)),
        forward=plot("forward", "", figures.forward(diagnosis, forward))
        if forward is not None and forward.motion
        else None,
        forward_runs="" if forward is None else f"{', '.join(forward.runs)}, {forward.seconds:.3g} s",
        forward_failed=[] if forward is None else list(forward.failed.items()),
        experiment=next_experiment,
        unknown=diagnosis.verdict == "unknown",
        barred=diagnosis.barred is not None,
        not_in_mjcf=[] if written is None else list(written.lacks),
        of_file=[] if written is None else _of_file(robot, written.error),
        notes=_notes(diagnosis),
        plotly=Markup(get_plotlyjs()),
    )


def _effects(diagnosis: Diagnosis) -> list[dict[str, object]]:
    """The reported effects, as the page shows them."""
    return [
        {
            "name": words.title(each.effect),
            "place": words.place(diagnosis.robot, each.joint, each.into),
            "probability": 100 * each.probability,
            "share": 100 * each.held_out_share,
            "parameters": words.parameters(each, diagnosis.run_names),
            "confusable": words.titles(each.confusable_with) if each.confusable_with else "",
        }
        for each in diagnosis.effects
    ]


def _ruled_out(diagnosis: Diagnosis, ranked: Sequence[RankedCandidate]) -> list[dict[str, object]]:
    """Rows of the candidates that are not reported, with the reason."""
    named = {(each.effect, each.joint, each.into) for each in diagnosis.effects}
    return [
        {
            "label": words.labelled(diagnosis.robot, each.effect, each.joint, each.into),
            "probability": 100 * each.probability,
            "score": each.score,
            "reason": each.reason,
        }
        for each in ranked
        if (each.effect, each.joint, each.into) not in named
    ]


def _joints(diagnosis: Diagnosis) -> list[dict[str, object]]:
    """Rows of the joints' torque errors."""
    gap, robot = diagnosis.gap, diagnosis.robot
    return [
        {
            "name": name,
            "unit": unit,
            "nominal": gap.nominal[joint],
            "parameters": gap.parameters[joint],
            "effects": gap.effects[joint],
            "floor": gap.noise_floor[joint],
            "is_bound": gap.is_bound(joint),
            "band": diagnosis.prepared.cutoff[joint],
            "over_all": gap.over_all(gap.effects)[joint],
        }
        for joint, (name, unit) in enumerate(zip(robot.joint_names, robot.units(), strict=True))
    ]


def _notes(diagnosis: Diagnosis) -> list[str]:
    """All else that is to be known, a sentence each."""
    return [
        *diagnosis.notes,
        *words.untold(diagnosis),
        *words.everywhere(diagnosis),
        *words.mended(diagnosis),
        *words.recurrence(diagnosis),
        *words.noise_unseen(diagnosis),
        *words.near_rest(diagnosis),
    ]


def _of_file(robot: Robot, error: FileError) -> list[dict[str, object]]:
    """Rows of the table of corrected.xml's torque error."""
    columns = (robot.joint_names, robot.units(), error.given, error.laws, error.file)
    names = ("name", "unit", "given", "laws", "file")
    return [dict(zip(names, row, strict=True)) for row in zip(*columns, strict=True)]


def _tiles(diagnosis: Diagnosis) -> list[Tile]:
    gap, unit = diagnosis.gap, words.torque_unit(diagnosis.robot)
    total = {stage: float(getattr(gap, stage).sum()) for stage in ("nominal", "parameters", "effects")}
    tiles = [Tile(words.verdict(diagnosis), "verdict", diagnosis.verdict in ("none", "parameters", "effect"))]
    if diagnosis.effects:
        tiles.append(Tile(f"{100 * diagnosis.effects[0].probability:.0f} %", "certain of the first effect"))
    tiles.append(Tile(f"{total['nominal']:.3g} {unit}", "torque error, model as given"))
    tiles.append(Tile(f"{total['effects']:.3g} {unit}", "after correction"))
    closed = gap.told_closed
    if closed is not None and diagnosis.effects:
        tiles.append(Tile(f"{100 * closed:.0f} %", "of re-identification's rest explained", closed >= 0.8))
    return tiles
