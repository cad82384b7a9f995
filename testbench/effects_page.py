"""docs/effects.md: every effect of the catalogue, with a measured picture of how it shows."""

import inspect
from pathlib import Path

import numpy as np

from identification.errors import InputError

from .effect_figures import confusion_svg, residual_svg
from .effect_survey import CUTOFF, EXCITATION, PERIODS, Sighting, survey
from .effects import effect, effects, parse_injection
from .effects.base import EffectDescription, EffectParameter
from .effects.mjcf_form import write_effects
from .files import require_writable, write_text
from .robot import Robot, load_robot

# Fewer than this share of another effect's residual explained is no likeness.
ALIKE = 0.1
# When re-identification leaves less than this, it is rounding and not the effect that is left.
NOTHING_LEFT = 0.02

INTRODUCTION = """\
# Effects that a model leaves out

Made by `testbench effects page`; do not edit. Each effect is one file in `testbench/effects/`: its law,
how it acts in the simulated robot, how it shows along logged signals, and how it is written into MJCF.

The pictures and figures are measured: the simulated {robot} has one effect of its typical size, on
{joint} unless the effect is of the whole robot, and follows the standard excitation (a seeded Fourier
series up to {highest:g} Hz, {seconds:g} s, no noise). The residual is the drive's torque less what the true
model predicts along the measured motion, both low-passed at {cutoff:g} Hz, less the same of a healthy robot;
samples of a joint near its reversals, where its friction jumps, are left out.
*Survives* is what re-identified parameters leave of it (all joints, in shares of the torque limits).
*Explained* is how much of the rest (of its mean square) the effect's own signature accounts for at the same
place; *confused with* names the other effects whose signatures account for at least a tenth.
Where little survives, the effect is to be looked for in the shift of the parameters.
"""


def write_effects_page(model: Path, out: Path, joint: int, jobs: int | None = None) -> None:
    """Write the page and, in a folder beside it of its name, the pictures.

    joint: number from 1 of the joint that is shown; a pair is this joint and the next. Raises InputError.
    """
    robot = load_robot(model)
    if not 1 <= joint < robot.joints:
        raise InputError("effects", "joint", f"a number from 1 to {robot.joints - 1}", joint)
    require_writable(out, model)
    sightings = survey(robot, joint - 1, jobs)
    folder = out.with_suffix("")
    for name, sighting in sightings.items():
        write_text(_picture(robot, sighting), folder / f"{name}.svg")
    left = {name: seen.explained for name, seen in sightings.items() if seen.survives > NOTHING_LEFT}
    write_text(confusion_svg(left, tuple(sightings)), folder / "confusion.svg")
    write_text(_page(robot, joint - 1, sightings, folder.name), out)


def write_effects_model(model: Path, texts: list[str], out: Path) -> tuple[str, ...]:
    """Write the model with the effects, each ``NAME[:joint[:key=value,...]]``; what it cannot carry.

    Raises InputError.
    """
    require_writable(out, model)
    robot = load_robot(model)
    return write_effects(robot, [parse_injection(robot, text) for text in texts], out)


def _picture(robot: Robot, sighting: Sighting) -> str:
    joint, slide = robot.joint_names[sighting.shown], robot.chain.is_slide[sighting.shown]
    length, torque = ("m", "N") if slide else ("rad", "N·m")
    panels = (
        ("time, s", sighting.time),
        (f"velocity of {joint}, {length}/s", sighting.dq),
        (f"position of {joint}, {length}", sighting.q),
    )
    return residual_svg(panels, sighting.change, sighting.left, torque)


def _page(robot: Robot, joint: int, sightings: dict[str, Sighting], folder: str) -> str:
    parts = [
        INTRODUCTION.format(
            robot=robot.name,
            joint=robot.joint_names[joint],
            highest=EXCITATION.base_frequency * EXCITATION.harmonics,
            seconds=PERIODS / EXCITATION.base_frequency,
            cutoff=CUTOFF,
        ),
        "| effect | acts on | residual, RMS | survives | explained | confused with |\n"
        "| --- | --- | --- | --- | --- | --- |",
    ]
    for name, seen in sightings.items():
        description = effect(name).DESCRIPTION
        size = float(np.sqrt(np.mean(seen.change**2)))
        unit = robot.units()[seen.shown]
        others = [f"{other} {100 * share:.0f} %" for other, share in _alike(name, seen)[:3]]
        own = f"{100 * seen.explained[name]:.0f} %" if seen.survives > NOTHING_LEFT else "nothing left"
        parts[-1] += (
            f"\n| [{name}](#{name}) | {description.scope} | {size:.3g} {unit} | {100 * seen.survives:.0f} % "
            f"| {own} | {', '.join(others) or '-'} |"
        )
    parts.append(
        f"How much, in per cent, of what is left of the row's effect the column's signature explains:\n\n"
        f"![Shares explained]({folder}/confusion.svg)\n"
    )
    parts += [_section(robot, effect(name).DESCRIPTION, seen, folder) for name, seen in sightings.items()]
    return "\n\n".join(parts) + "\n"


def _alike(name: str, seen: Sighting) -> list[tuple[str, float]]:
    """Other effects that explain at least ALIKE of what this one leaves, most first."""
    if seen.survives <= NOTHING_LEFT:
        return []
    others = [(other, share) for other, share in seen.explained.items() if other != name and share >= ALIKE]
    return sorted(others, key=lambda item: -item[1])


def _section(robot: Robot, description: EffectDescription, seen: Sighting, folder: str) -> str:
    name = description.name
    values = ", ".join(f"{key} {value:.3g}" for key, value in seen.injection.values.items())
    rows = "\n".join(_row(parameter) for parameter in description.parameters)
    module = effects()[name]
    sentences = list(module.write(robot.spec(), robot, seen.injection))
    form = [
        inspect.getdoc(module.write) or "",
        *(f"{sentence[0].upper()}{sentence[1:]}." for sentence in sentences),
    ]
    known = ", ".join(description.confused_with) or "nothing"
    lines = [
        f"## {name}",
        f"{description.title}: {description.law}.",
        f"![{description.title}]({folder}/{name}.svg)",
        f"Shown with {values}.",
        f"| parameter | unit | bounds | typical |\n| --- | --- | --- | --- |\n{rows}",
        f"Laws in simulation: {', '.join(description.laws)}. Often confused with {known}.",
        f"In MJCF: {' '.join(form)}",
        f"Reference: {description.reference}.",
    ]
    return "\n\n".join(lines)


def _row(parameter: EffectParameter) -> str:
    low, high = sorted(parameter.typical)
    share = f" × {parameter.relative_to.replace('_', ' ')}" if parameter.relative_to else ""
    bounds = f"{parameter.lower:g} to {parameter.upper:g}"
    only = f", {parameter.law} alone" if parameter.law else ""
    return f"| {parameter.name} | {parameter.unit} | {bounds} | {low:g} to {high:g}{share}{only} |"
