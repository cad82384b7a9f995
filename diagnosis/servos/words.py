"""A diagnosis of position servos in sentences, and as lines for the terminal."""

import numpy as np
from rich.text import Text

from testbench.drives.effects import drive_effects
from testbench.findings import significant
from testbench.summary import labelled_line
from testbench.terminal import console

from .findings import ServoDiagnosis, ServoFault

# Joints, effects and candidates that the terminal lists.
MOST = 4
# Probability from which it is said that something acts which the catalogue lacks.
STATED = 0.5


def sentence(diagnosis: ServoDiagnosis) -> str:
    """The verdict in one sentence."""
    given, parameters, corrected = (
        f"{milli(each)} mrad" for each in (diagnosis.given, diagnosis.parameters, diagnosis.corrected)
    )
    halves = "RMS on halves that were not fitted"
    if diagnosis.verdict == "effect":
        besides = f" {text}" if (text := beside(diagnosis)) else ""
        names = ", ".join(f"{title(each)} ({each.probability:.0%})" for each in diagnosis.effects)
        return (
            f"The gap comes from {names}: the position error in closed loop falls from {parameters} "
            f"re-identified to {corrected} {halves}; it is {given} by the model as given.{besides}"
        )
    if diagnosis.verdict == "none":
        return f"The model as given explains these logs: {given} {halves}, {parameters} re-identified."
    if diagnosis.verdict == "parameters":
        return (
            f"Other parameters than the model's explain these logs: the position error in closed loop falls "
            f"from {given} to {parameters} {halves}, and no effect stands out."
        )
    worst = diagnosis.where[0]
    there = [each for each in diagnosis.candidates if each.joint in (None, worst.joint)]
    likely = " or ".join(
        f"{labelled(each.effect, each.joint)} ({each.probability:.0%})"
        for each in there[:2]
        if each.probability >= 0.05
    )
    which = f"; likeliest: {likely}" if likely else ""
    return (
        f"At {worst.joint} lies {worst.share:.0%} of the squared position error that re-identification "
        f"leaves ({parameters} {halves}, {given} as given), and no effect of the catalogue explains it "
        f"surely enough{which}."
    )


def beside(diagnosis: ServoDiagnosis) -> str:
    """A sentence on what acts besides the stated effects; empty where nothing is likely to."""
    if diagnosis.unknown < STATED:
        return ""
    return f"What is left has a cause that the catalogue lacks ({diagnosis.unknown:.0%})."


def title(each: ServoFault) -> str:
    """An effect, where, and how large."""
    figures = ", ".join(
        f"{name} {significant(float(np.asarray(quantity.value)), 3)} ± "
        f"{significant(float(np.asarray(quantity.std)), 2)} {quantity.unit}".removesuffix(" -")
        for name, quantity in each.parameters.items()
    )
    return f"{labelled(each.effect, each.joint if each.joint else ', '.join(each.joints))}, {figures}"


def confusable(each: ServoFault) -> str:
    """Titles of the effects that these runs do not distinguish from one; empty where there are none."""
    return ", ".join(drive_effects()[name].title for name in each.confusable_with)


def labelled(effect: str, joint: str | None) -> str:
    """An effect's title and its joint."""
    return f"{drive_effects()[effect].title.lower()} at {joint or 'all joints'}"


def notes(diagnosis: ServoDiagnosis) -> tuple[str, ...]:
    """Sentences on what position alone cannot show, and on effects that are not stated."""
    alike = "Position alone determines ratios of gains, inertia and friction; their scale is the model's."
    return (alike, *diagnosis.notes)


def print_servo_summary(diagnosis: ServoDiagnosis) -> None:
    """Print the diagnosis in some ten lines, 110 columns wide where that is no terminal."""
    lines = [Text(sentence(diagnosis), style="bold")]
    where = "; ".join(
        f"{each.joint} {each.share:.0%} ({each.regime}, {significant(1e3 * each.gap_rms, 3)} mrad)"
        for each in diagnosis.where[:MOST]
    )
    lines.append(labelled_line("where", where))
    for each in diagnosis.effects[:MOST]:
        lines.append(labelled_line("effect", f"{title(each)}: {each.probability:.0%}"))
        if each.confusable_with:
            lines.append(
                labelled_line("open", f"these runs hardly distinguish it from {confusable(each).lower()}")
            )
    listed = diagnosis.candidates[:MOST]
    if listed:
        weighed = [f"{labelled(each.effect, each.joint)} ({each.probability:.0%})" for each in listed]
        lines.append(labelled_line("not", "; ".join(weighed)))
    figures = (diagnosis.given, diagnosis.parameters, diagnosis.corrected, diagnosis.noise)
    given, parameters, corrected, noise = map(milli, figures)
    lines.append(
        labelled_line(
            "gap",
            f"{given} given → {parameters} re-identified → {corrected} with effects, noise {noise}; mrad",
        )
    )
    if diagnosis.experiment is not None:
        lines.append(labelled_line("next", diagnosis.experiment.why))
    lines += [labelled_line("note", each) for each in diagnosis.notes]
    console().print(Text("\n").join(lines), soft_wrap=True)


def milli(rms: np.ndarray) -> str:
    """The RMS of all joints together, in thousandths: mrad (mm) of (n,) rad (m)."""
    return significant(1e3 * float(np.sqrt(np.mean(rms**2))), 3)
