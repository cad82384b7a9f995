"""The diagnosis in ten lines for the terminal."""

import numpy as np
from rich.text import Text

from testbench.findings import significant, torque_unit
from testbench.robot import Robot
from testbench.summary import finding_line, labelled_line
from testbench.terminal import console

from ..correction.corrected_mjcf import Written
from ..decision.findings import STAGES, Diagnosis
from ..experiment.discriminating_motion import NextExperiment
from . import notes, words

MOST_LINES, MOST_EFFECTS, MOST_RIVALS = 10, 3, 2


def print_summary(
    diagnosis: Diagnosis, next_experiment: NextExperiment | None = None, written: Written | None = None
) -> None:
    """Print the summary on standard output, 110 columns wide where that is not a terminal."""
    console().print(summary(diagnosis, next_experiment, written), soft_wrap=True)


def summary(
    diagnosis: Diagnosis, next_experiment: NextExperiment | None = None, written: Written | None = None
) -> Text:
    """Verdict, where, which, how far and what next, at most ten lines; one more of corrected.xml."""
    robot = diagnosis.robot
    lines = [Text(diagnosis.sentence, style="bold")]
    lines += [finding_line(each) for each in diagnosis.log_findings if not each.bars_names]
    if where := words.where(diagnosis):
        lines.append(labelled_line("where", where))
    for each in diagnosis.effects[:MOST_EFFECTS]:
        label = words.labelled(robot, each)
        sizes = words.parameters(each, diagnosis.run_names)
        lines.append(labelled_line("effect", f"{label}: {100 * each.probability:.0f} %; {sizes}"))
    if diagnosis.effects and diagnosis.notes:
        lines.append(labelled_line("unknown", diagnosis.notes[0]))
    for label, said in (
        ("runs", notes.differences(diagnosis.differences, robot)),
        ("late", notes.late(diagnosis)),
        ("silent", notes.silent(diagnosis)),
        ("motion", notes.too_little_motion(diagnosis)),
        ("alike", notes.everywhere(diagnosis)),
        ("mended", notes.mended(diagnosis)),
    ):
        lines += [labelled_line(label, each) for each in said]
    if ambiguous := next((each for each in diagnosis.effects if each.confusable_with), None):
        either = f"{words.title(ambiguous.effect)} may be {words.confusable(ambiguous)}"
        lines.append(labelled_line("open", f"{either}: these runs do not distinguish them"))
    others = [
        f"{words.labelled(robot, each)} ({100 * each.probability:.0f} %)"
        for each in diagnosis.not_reported[:MOST_RIVALS]
    ]
    if others:
        lines.append(labelled_line("not", "; ".join(others)))
    lines.append(labelled_line("gap", _gap(diagnosis)))
    if next_experiment is not None:
        lines.append(labelled_line("next", next_experiment.why))
    most = MOST_LINES + sum(not each.bars_names for each in diagnosis.log_findings)
    lines = lines[:most]
    if written is not None:
        lines.append(labelled_line("file", _corrected_file(robot, written)))
    return Text("\n").join(lines)


def _gap(diagnosis: Diagnosis) -> str:
    """The gap of all joints by stage, the noise in it, and how far it is closed."""
    gap = diagnosis.gap
    stages = (("given", gap.nominal), ("re-identified", gap.parameters), ("with effects", gap.effects))
    by_stage = " → ".join(f"{np.sum(rms):.3g} {name}" for name, rms in stages)
    at_most = "at most " if gap.unseen.any() else ""
    noise = f"noise {at_most}{np.sum(gap.noise_floor):.3g} {torque_unit(diagnosis.robot)}"
    share = gap.reported_closed
    closed = "" if share is None or not diagnosis.effects else f"; {100 * share:.0f} % closed"
    return f"{by_stage}, {noise}{closed}{_over_all(diagnosis)}"


def _over_all(diagnosis: Diagnosis) -> str:
    """The gap of all joints over all frequencies, for the end of a line on that in the band."""
    gap = diagnosis.gap
    by_stage = " → ".join(f"{np.sum(gap.over_all(getattr(gap, stage))):.3g}" for stage in STAGES)
    band = sorted({significant(each, 2) for each in diagnosis.prepared.cutoff.tolist()}, key=float)
    below = band[0] if len(band) == 1 else f"{band[0]} to {band[-1]}"
    return f"; that is below {below} Hz, over all frequencies {by_stage}"


def _corrected_file(robot: Robot, written: Written) -> str:
    """The torque error of corrected.xml beside that of the model given and of the laws, joints summed."""
    error = written.error
    given, laws, file = (f"{np.sum(rms):.3g}" for rms in (error.given, error.laws, error.file))
    lacks = "; the report lists what the file lacks" if written.lacks else ""
    line = f"{given} given → {file} by corrected.xml along these runs, {laws} by the diagnosis's laws"
    return f"{line} ({torque_unit(robot)}){lacks}"
