"""Identified drives in words and tables for the terminal."""

from collections.abc import Sequence

import numpy as np
from rich.console import Group
from rich.table import Table
from rich.text import Text

from ..findings import significant
from ..terminal import console
from .differences import NAMES, Difference
from .document import Errors
from .identified import Alike, Figure, IdentifiedDrives
from .shared import DIFFERENT, SPREAD

# Figures of the table, in its order: name, heading, factor.
SHOWN = (
    ("armature", "armature", 1.0),
    ("coulomb", "Coulomb N·m", 1.0),
    ("viscous", "viscous", 1.0),
    ("damping", "kd + viscous", 1.0),
    ("load_friction", "per load", 1.0),
    ("stribeck", "Stribeck N·m", 1.0),
    ("friction_slope", "slope N·m/rad", 1.0),
    ("back_emf", "back EMF", 1.0),
    ("limit", "limit N·m", 1.0),
    ("kp_scale", "kp scale", 1.0),
    ("delay", "delay ms", 1e3),
)
COMPARED = ("armature", "coulomb", "damping", "delay", "kp_scale")
DIGITS = 3
# Samples of a residual that count for one.
SYSTEMATIC = 10.0


def remarks_on(found: IdentifiedDrives) -> tuple[str, ...]:
    """Sentences on what the runs leave open."""
    figures = found.figures
    out = []
    scales = [each for each in figures if each.name == "kp_scale"]
    held = [each.joint for each in scales if not each.is_determined]
    if held:
        out.append(
            f"No known mass fixes the scale of torque at {_listed(held, found, 'any')}: "
            "position determines only the ratios of gains, inertia and friction there; the scale is that of "
            "the stated gains."
        )
    if any(each.name == "damping" for each in figures):
        out.append(
            "Viscous friction and the drive's kd act alike: their sum is determined better than either."
        )
    for name, text in (("armature", "armature"), ("coulomb", "Coulomb friction"), ("delay", "delay")):
        left = [each.joint for each in figures if each.name == name and not each.is_determined]
        if left:
            out.append(f"The motion leaves the {text} of {_listed(left, found)} as wide as it was before.")
    if found.tied:
        apart = [f"{each.name} of {', '.join(each.joints)}" for each in found.tied if not each.is_one]
        kept = f"; kept apart, since they differ by more: {'; '.join(apart)}" if apart else ""
        out.append(
            "Joints that the model has alike share armature, friction, gains and delay within "
            f"{SPREAD:.0%}{kept}."
        )
    systematic = [
        name
        for limb, own in zip(found.limbs, found.fits, strict=True)
        for name, inflation in zip(limb.chain.joint_names, own.inflation, strict=True)
        if inflation > SYSTEMATIC
    ]
    if systematic:
        out.append(
            f"What is left of the position error of {_listed(systematic, found)} is slow and systematic: the "
            "model lacks something there, and the deviations count its samples for few."
        )
    return tuple(out)


def _listed(joints: Sequence[str], found: IdentifiedDrives, of_all: str = "every") -> str:
    """Names of joints; where it is all of several, "every joint", or another word for every."""
    if len(joints) == found.robot.joints and len(joints) > 1:
        return f"{of_all} joint"
    return joints[0] if len(joints) == 1 else f"{', '.join(joints[:-1])} and {joints[-1]}"


def alike_sentence(each: Alike) -> str:
    """Whether joints of several limbs have one value of a figure."""
    factor, unit = (1e3, "ms") if each.name == "delay" else (1.0, each.unit)
    value = f"{significant(factor * each.value)} ± {significant(factor * each.std, 2)} {unit}".replace(
        " -", ""
    )
    joints = f"{each.joints[0]} … {each.joints[-1]}"
    if each.p_value >= DIFFERENT:
        return f"{each.name} of {joints}: one value, {value} (p = {each.p_value:.2g})"
    different = f"different by more than their deviations (p = {each.p_value:.1g})"
    return f"{each.name} of {joints}: {different}, mean {value}"


def print_drives(
    found: IdentifiedDrives,
    errors: Sequence[Errors],
    remarks: Sequence[str],
    differing: Sequence[Difference],
) -> None:
    """Print headline, figures and position errors, 110 columns wide where that is no terminal."""
    before = (Text(sentence) for sentence in (headline(errors), *remarks))
    alike = (Text(alike_sentence(each)) for each in found.alike if each.name in COMPARED)
    tables = (_differences(differing, errors[-1].role), errors_table(found.robot.joint_names, errors))
    console().print(Group(*before, _figures(found), *alike, *tables))


def headline(errors: Sequence[Errors]) -> str:
    """By how much the position error shrinks, all joints pooled, on the runs that judge."""
    judged = errors[-1]
    given, identified = (float(np.sqrt(np.mean(each**2))) for each in (judged.given, judged.identified))
    where = "runs that were not fitted" if judged.role == "validation" else "the fitted runs"
    return (
        f"Simulated in closed loop on the logged command, the position misses {where} by "
        f"{significant(1e3 * identified, 3)} mrad RMS, all joints pooled; by {significant(1e3 * given, 3)} "
        f"mrad with the model as published ({identified / given:.0%} of it)."
    )


def _differences(differing: Sequence[Difference], role: str) -> Table | Text:
    """Where the robot is not as stated, and by how much."""
    judges = "runs that were not fitted" if role == "validation" else "the fitted runs alone"
    if not differing:
        return Text(f"Judged by {judges}, no single figure differs from what was stated.")
    title = f"What differs from the model and the stated drives, judged by {judges}"
    table = Table(title=title, title_justify="left", box=None)
    for heading in ("joint", "what", "stated", "identified", "unit", "log-likelihood lost without it"):
        is_number = heading not in ("joint", "what", "unit")
        table.add_column(heading, justify="right" if is_number else "left", no_wrap=heading == "joint")
    for each in differing:
        alike = [NAMES[name] for name in each.alike if name in NAMES]
        what = NAMES[each.name] + (f" (or {' or '.join(alike)})" if alike else "")
        value = f"{significant(each.value, DIGITS)} ± {significant(each.std, 2)}"
        evidence = significant(each.evidence, 2) if np.isfinite(each.evidence) else "all"
        table.add_row(each.joint, what, significant(each.stated, DIGITS), value, each.unit, evidence)
    return table


def errors_table(joints: Sequence[str], errors: Sequence[Errors], repeat: np.ndarray | None = None) -> Table:
    """Position RMS a joint, mrad (mm), as given and as identified."""
    table = Table(title="Position RMS in closed loop, mrad (mm)", title_justify="left", box=None)
    table.add_column("joint", no_wrap=True)
    for each in errors:
        for name in ("as published", "identified"):
            table.add_column(f"{each.role}, {name}" if each.role else name, justify="right")
    if repeat is not None:
        table.add_column("repeatability", justify="right")
    for joint, name in enumerate(joints):
        cells = [1e3 * values[joint] for each in errors for values in (each.given, each.identified)]
        cells += [] if repeat is None else [1e3 * repeat[joint]]
        table.add_row(name, *(significant(cell, DIGITS) for cell in cells))
    return table


def _figures(found: IdentifiedDrives) -> Table:
    table = Table(title="Drives and joints, ± one standard deviation", title_justify="left", box=None)
    headings, rows = figure_rows(found)
    for heading in headings:
        table.add_column(heading, justify="left" if heading == "joint" else "right", no_wrap=True)
    for row in rows:
        table.add_row(*row)
    return table


def figure_rows(found: IdentifiedDrives) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Headings, and a row a joint of its figures with their deviations."""
    figures = {(each.name, each.joint): each for each in found.figures}
    shown = [each for each in SHOWN if any(name == each[0] for name, _ in figures)]
    rows = [
        (joint, *(_cell(figures.get((name, joint)), factor) for name, _, factor in shown))
        for joint in found.robot.joint_names
    ]
    return ("joint", *(heading for _, heading, _ in shown)), rows


def _cell(figure: Figure | None, factor: float) -> str:
    if figure is None:
        return "-"
    return f"{significant(factor * figure.value, 3)} ± {significant(factor * figure.std, 2)}"
