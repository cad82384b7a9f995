"""Effects, numbers and places as the page, the terminal and the session spell them."""

from collections.abc import Sequence

import numpy as np

from testbench.effects import effects
from testbench.effects.signature import Quantity
from testbench.findings import significant
from testbench.robot import Robot

from ..correction.corrected_mjcf import Written
from ..decision.findings import Diagnosis, NamedEffect
from ..held_out.differing_runs import in_words
from ..residual.localisation import EVERYWHERE

# The times of a push, of which there may be many.
INTERVALS = "intervals"
# What would be 0 %.
LEAST_SHOWN = 0.005


def title(effect: str) -> str:
    """An effect's title, for people."""
    known = effects().get(effect)
    return effect.replace("_", " ") if known is None else known.DESCRIPTION.title


def place(robot: Robot, joint: int | None, into: int | None = None) -> str:
    """Phrase for the joint or joints at which an effect acts."""
    if joint is None:
        return "whole robot"
    first = robot.joint_names[joint]
    return first if into is None else f"{first} and {robot.joint_names[into]}"


def labelled(robot: Robot, effect: str, joint: int | None, into: int | None = None) -> str:
    """An effect with its place."""
    return f"{title(effect)}, {place(robot, joint, into)}"


def quantity(value: Quantity) -> str:
    """A value with its standard deviation and unit."""
    unit = "" if value.unit == "-" else f" {value.unit}"
    if isinstance(value.value, tuple) and isinstance(value.std, tuple):
        parts = [f"{_known(v, s)} ± {significant(s, 2)}" for v, s in zip(value.value, value.std, strict=True)]
        return f"({', '.join(parts)}){unit}"
    if isinstance(value.value, tuple) or isinstance(value.std, tuple):
        raise ValueError("value and std of a quantity must have the same components")
    deviation = f" ± {significant(value.std, 2)}" if value.std > 0 else ""
    return f"{_known(value.value, value.std)}{deviation}{unit}"


def _known(value: float, deviation: float) -> str:
    """A number to three digits, or to the first of its deviation where that is more."""
    digits = 3
    if deviation > 0 and np.isfinite(value) and np.isfinite(deviation) and value != 0:
        digits = max(digits, _power_of_ten(value) - _power_of_ten(deviation) + 1)
    return significant(value, digits)


def _power_of_ten(value: float) -> int:
    return int(np.floor(np.log10(abs(value))))


def _spans(times: Quantity, runs: Sequence[str]) -> str:
    """Start and end of each interval, s, which are known alike. runs: the name of each one's, or none."""
    assert isinstance(times.value, tuple)
    assert isinstance(times.std, tuple)
    ends = [_known(v, s) for v, s in zip(times.value, times.std, strict=True)]
    spans = [f"{first} to {last}" for first, last in zip(ends[::2], ends[1::2], strict=True)]
    known = f"{times.unit} (each ± {significant(max(times.std, default=0.0), 2)})"
    if not runs:
        return f"{', '.join(spans)} {known}"
    of_runs = dict.fromkeys(runs)
    told = (
        f"{', '.join(span for span, run in zip(spans, runs, strict=True) if run == each)} in {each}"
        for each in of_runs
    )
    return f"{'; '.join(told)}, {known}"


def parameters(named: NamedEffect, runs: Sequence[str]) -> str:
    """All parameters of a named effect on one line, after its law where that is not the effect's first.

    runs: names of all runs, of which an event was in some.
    """
    law, of_event = named.candidate.member.law, [runs[index] for index in named.runs]
    values = [
        f"{name.replace('_', ' ')} {_spans(value, of_event) if name == INTERVALS else quantity(value)}"
        for name, value in named.parameters.items()
    ]
    return ("" if law is None else f"{law.replace('_', ' ')}, ") + ", ".join(values)


def where(diagnosis: Diagnosis, most: int = 3) -> str:
    """The joints with the largest shares of the gap, each with the regime that its own gap is densest in.

    Empty where the model is as good as a re-identified one, or that leaves nothing above the noise.
    """
    if diagnosis.verdict == "none":
        return ""
    names = diagnosis.robot.joint_names
    shown = [w for w in diagnosis.where[:most] if w.share >= LEAST_SHOWN]
    return "; ".join(
        f"{names[w.joint]} {100 * w.share:.0f} %"
        + ("" if w.regime == EVERYWHERE else f", densest: {w.regime}")
        for w in shown
    )


def torque_unit(robot: Robot) -> str:
    """N·m, N, or both where the robot has hinge and slide joints."""
    units = sorted(set(robot.units()), reverse=True)
    return units[0] if len(units) == 1 else "N·m (N for a slide joint)"


def titles(names: Sequence[str]) -> str:
    """Titles of several effects in a sentence."""
    words = [title(name).lower() for name in names]
    return words[0] if len(words) == 1 else ", ".join(words[:-1]) + " or " + words[-1]


def verdict(diagnosis: Diagnosis) -> str:
    """The verdict in two or three words."""
    return {
        "none": "no gap",
        "parameters": "wrong parameters",
        "effect": "unmodelled effect" + ("s" if len(diagnosis.effects) > 1 else ""),
        "unknown": "unknown cause",
    }[diagnosis.verdict]


def near_rest(diagnosis: Diagnosis) -> list[str]:
    """Sentences on friction near rest: soft joints, friction that turns ahead."""
    names, width = diagnosis.robot.joint_names, diagnosis.prepared.coulomb_smoothing
    soft = [f"{names[joint]} {width[joint]:.2g}" for joint in np.flatnonzero(width).tolist()]
    law = "Coulomb friction is soft near rest, fc tanh(v / w) with w in rad/s (m/s)"
    said = [f"{law}: {', '.join(soft)}."] if soft else []
    if (lead := diagnosis.prepared.coulomb_lead) > 0:
        ahead = f"All Coulomb friction changes sign {1e3 * lead:.1f} ms ahead of the joints"
        said.append(f"{ahead}, as a soft constraint has it: these logs seem to be of MuJoCo's frictionloss.")
    return said


def untold(diagnosis: Diagnosis) -> list[str]:
    """The joints that move too little for an effect to be reported, and why; empty where all move enough."""
    names, said = diagnosis.robot.joint_names, []
    if still := [names[joint] for joint in sorted(diagnosis.prepared.still)]:
        stay = "it stays as the model has it" if len(still) == 1 else "they stay as the model has them"
        said.append(f"In these runs {_listed(still)} stood still: {stay}.")
    if short := [names[joint] for joint in diagnosis.untold]:
        said.append(f"These runs hold too few seconds of motion for a name at {_listed(short)}.")
    if sines := [names[joint] for joint in sorted(diagnosis.one_sine)]:
        place = "every joint" if len(sines) == len(names) else _listed(sines)
        said.append(
            f"One sine at {place}: inertia, gravity and springs there cannot be told apart. "
            "Record a motion of several frequencies."
        )
    return said


def _listed(names: Sequence[str]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"


def late(diagnosis: Diagnosis) -> list[str]:
    """By how much the logs had their torque late, and that it was taken back; nothing where they had not."""
    lag = diagnosis.prepared.lag
    if lag.seconds == 0:
        return []
    through = f", as through a low-pass at {lag.corner:.3g} Hz" if lag.order else ""
    how_late = f"{1e3 * lag.seconds:.3g} ms late against the positions{through}"
    return [f"The logs have all torque {how_late}; it was taken back."]


def noise_floor(diagnosis: Diagnosis) -> str:
    """The noise floor of all joints together with its unit; a bound where some joint's noise is not seen."""
    at_most = "at most " if diagnosis.noise_unseen else ""
    return f"noise {at_most}{np.sum(diagnosis.gap.noise_floor):.3g} {torque_unit(diagnosis.robot)}"


def over_all(diagnosis: Diagnosis) -> str:
    """The gap of all joints over all frequencies, for the end of a line on that in the band."""
    gap = diagnosis.gap
    if gap.above is None:
        return ""
    stages = (gap.nominal, gap.parameters, gap.effects)
    told = " → ".join(f"{np.sum(gap.over_all(rms)):.3g}" for rms in stages)
    band = sorted({significant(each, 2) for each in diagnosis.prepared.cutoff.tolist()}, key=float)
    below = band[0] if len(band) == 1 else f"{band[0]} to {band[-1]}"
    return f"; that is below {below} Hz, over all frequencies {told}"


def corrected_file(robot: Robot, written: Written) -> str:
    """The torque error of corrected.xml beside that of the model given and of the laws, joints summed."""
    error = written.error
    given, laws, file = (f"{np.sum(rms):.3g}" for rms in (error.given, error.laws, error.file))
    lacks = "; the report lists what the file lacks" if written.lacks else ""
    told = f"{given} given → {file} by corrected.xml along these runs, {laws} by the diagnosis's laws"
    return f"{told} ({torque_unit(robot)}){lacks}"


def noise_unseen(diagnosis: Diagnosis) -> list[str]:
    """The joints whose noise floor is a bound, since their logs were low-passed; nothing where none was."""
    names = [diagnosis.robot.joint_names[joint] for joint in diagnosis.noise_unseen]
    if not names:
        return []
    place = "all joints" if len(names) == len(diagnosis.robot.joint_names) else ", ".join(names)
    return [
        f"The torque of {place} was low-passed before it was logged: its noise is at most the floor told."
    ]


def differences(diagnosis: Diagnosis) -> list[str]:
    """Sentences on payload, offsets or friction in which runs differ; empty where they are alike."""
    return in_words(diagnosis.differences, diagnosis.robot.joint_names, diagnosis.robot.units())


def silent(diagnosis: Diagnosis) -> list[str]:
    """The joints whose torque the logs do not have; nothing where they have all."""
    names = [diagnosis.robot.joint_names[joint] for joint in sorted(diagnosis.prepared.silent)]
    return [f"The logged torque of {', '.join(names)} never changes: nothing is told of it."] if names else []


def everywhere(diagnosis: Diagnosis) -> list[str]:
    """Sentence on fitted effects that are not reported, as other joints have them too; empty without any."""
    places: dict[str, list[str]] = {}
    for name, joint in sorted(diagnosis.everywhere, key=str):
        assert joint is not None
        places.setdefault(name, []).append(diagnosis.robot.joint_names[joint])
    told = "; ".join(f"{title(name)} ({', '.join(joints)})" for name, joints in places.items())
    return [f"Fitted, but no one joint's fault, since others are as imperfect: {told}."] if told else []


def mended(diagnosis: Diagnosis) -> list[str]:
    """The samples that were lost on the way to the log; nothing where none were."""
    told = [f"{count} of {name}" for name, count in diagnosis.mended.items()]
    return [f"Samples held or spoiled, and interpolated: {', '.join(told)}."] if told else []


def recurrence(diagnosis: Diagnosis) -> list[str]:
    """Sentence on a push that every run has, and so predictions have; empty where there is none."""
    if diagnosis.recurrence is None:
        return []
    shape = diagnosis.recurrence.pushed.member.shape
    when = f"from {shape['first']:.2f} to {shape['last']:.2f} s"
    return [f"The push comes in every run alike, {when}: predictions along other logs repeat it."]
