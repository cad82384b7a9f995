"""Effects, numbers and places as the page, the terminal and the session spell them."""

from collections.abc import Sequence

import numpy as np

from testbench.effects import effects
from testbench.effects.signature import Quantity
from testbench.findings import significant
from testbench.robot import Robot

from ..decision.findings import Diagnosis, NamedEffect, RankedCandidate
from ..residual.shares import EVERYWHERE

# The times of a push, of which there may be many.
INTERVALS = "intervals"
# What would be 0 %. Candidates that are drawn.
LEAST_SHOWN, MOST_CANDIDATES = 0.005, 12


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


def labelled(robot: Robot, each: NamedEffect | RankedCandidate) -> str:
    """An effect with its place."""
    return f"{title(each.effect)}, {place(robot, each.joint, each.into)}"


def quantity(value: Quantity) -> str:
    """A value with its standard deviation and unit; several components in brackets."""
    unit = "" if value.unit == "-" else f" {value.unit}"
    parts = [
        _known(v, s) + (f" ± {significant(s, 2)}" if s > 0 else "")
        for v, s in zip(np.ravel(value.value).tolist(), np.ravel(value.std).tolist(), strict=True)
    ]
    return (f"({', '.join(parts)})" if isinstance(value.value, tuple) else parts[0]) + unit


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
    when = (
        f"{', '.join(span for span, run in zip(spans, runs, strict=True) if run == each)} in {each}"
        for each in of_runs
    )
    return f"{'; '.join(when)}, {known}"


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


def where(diagnosis: Diagnosis) -> str:
    """The three joints of the largest shares of the gap, each with the regime that its gap is densest in.

    Empty where the model is as good as a re-identified one, or that leaves nothing above the noise.
    """
    if diagnosis.verdict == "none":
        return ""
    names = diagnosis.robot.joint_names
    shown = [w for w in diagnosis.where[:3] if w.share >= LEAST_SHOWN]
    return "; ".join(
        f"{names[w.joint]} {100 * w.share:.0f} %"
        + ("" if w.regime == EVERYWHERE else f", densest: {w.regime}")
        for w in shown
    )


def verdict(diagnosis: Diagnosis) -> str:
    """The verdict in two or three words."""
    return {
        "none": "no gap",
        "parameters": "wrong parameters",
        "effect": "unmodelled effect" + ("s" if len(diagnosis.effects) > 1 else ""),
        "unknown": "unknown cause",
    }[diagnosis.verdict]


def listed(names: Sequence[str], last: str = "and") -> str:
    """Several names in a sentence; empty for none."""
    return "".join(names) if len(names) < 2 else f"{', '.join(names[:-1])} {last} {names[-1]}"


def confusable(named: NamedEffect) -> str:
    """The effects that these runs cannot distinguish from a reported one; empty where there are none."""
    return listed([title(name).lower() for name in named.confusable_with], "or")
