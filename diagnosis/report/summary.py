"""The diagnosis in ten lines for the terminal."""

import numpy as np
from rich.text import Text

from testbench.summary import finding_line
from testbench.terminal import console

from ..correction.corrected_mjcf import Written
from ..decision.findings import Diagnosis
from ..experiment.discriminating_motion import NextExperiment
from . import words

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
    robot, gap = diagnosis.robot, diagnosis.gap
    lines = [Text(diagnosis.sentence, style="bold")]
    lines += [finding_line(each) for each in diagnosis.log_findings if not each.bars_names]
    if where := words.where(diagnosis):
        lines.append(_line("where", where))
    for each in diagnosis.effects[:MOST_EFFECTS]:
        label = words.labelled(robot, each.effect, each.joint, each.into)
        told = words.parameters(each, diagnosis.run_names)
        lines.append(_line("effect", f"{label}: {100 * each.probability:.0f} %; {told}"))
    if diagnosis.effects and diagnosis.notes:
        lines.append(_line("unknown", diagnosis.notes[0]))
    lines += [_line("runs", each) for each in words.differences(diagnosis)]
    lines += [_line("late", each) for each in words.late(diagnosis)]
    lines += [_line("silent", each) for each in words.silent(diagnosis)]
    lines += [_line("untold", each) for each in words.untold(diagnosis)]
    lines += [_line("alike", each) for each in words.everywhere(diagnosis)]
    lines += [_line("mended", each) for each in words.mended(diagnosis)]
    ambiguous = next((each for each in diagnosis.effects if each.confusable_with), None)
    if ambiguous is not None:
        others_like = words.titles(ambiguous.confusable_with)
        lines.append(
            _line("open", f"{words.title(ambiguous.effect)} may be {others_like}: these runs cannot tell")
        )
    named = {(each.effect, each.joint, each.into) for each in diagnosis.effects}
    ranked = sorted(diagnosis.ranked, key=lambda each: (-each.probability, -each.score))
    others = [each for each in ranked if (each.effect, each.joint, each.into) not in named][:MOST_RIVALS]
    if others:
        listed = [
            f"{words.labelled(robot, each.effect, each.joint, each.into)} ({100 * each.probability:.0f} %)"
            for each in others
        ]
        lines.append(_line("not", "; ".join(listed)))
    stages = (("given", gap.nominal), ("re-identified", gap.parameters), ("with effects", gap.effects))
    told = " → ".join(f"{np.sum(rms):.3g} {name}" for name, rms in stages)
    share = gap.told_closed
    closed = "" if share is None or not diagnosis.effects else f"; {100 * share:.0f} % closed"
    over_all = words.over_all(diagnosis)
    lines.append(_line("gap", f"{told}, {words.noise_floor(diagnosis)}{closed}{over_all}"))
    if next_experiment is not None:
        lines.append(_line("next", next_experiment.why))
    most = MOST_LINES + sum(not each.bars_names for each in diagnosis.log_findings)
    lines = lines[:most]
    if written is not None:
        lines.append(_line("file", words.corrected_file(robot, written)))
    return Text("\n").join(lines)


def _line(label: str, text: str) -> Text:
    return Text.assemble((f"{label:8}", "dim"), text)
