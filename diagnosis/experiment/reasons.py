"""Advice, in words, on which experiment distinguishes which effects."""

from collections.abc import Sequence
from dataclasses import dataclass

from testbench.effects import effects


@dataclass(frozen=True)
class Advice:
    """Advice on what to record where at least ``least`` of these effects are among those to distinguish."""

    among: frozenset[str]
    least: int
    words: str


# The most telling first: a motion cannot replace a known load, or time to warm up.
ADVICE = (
    Advice(
        frozenset({"torque_gain_error", "payload"}),
        1,
        "record the same motion with a known payload on and off: no motion alone shows a gain",
    ),
    Advice(
        frozenset({"thermal_friction_drift"}),
        1,
        "repeat the first run after the arm has worked for as long as it takes to warm up",
    ),
    Advice(
        frozenset({"joint_elasticity", "backlash", "torque_delay", "actuator_lag"}),
        1,
        "move with content at 5 to 30 Hz, where their phases part",
    ),
    Advice(
        frozenset({"stribeck_friction", "presliding_hysteresis", "backlash"}),
        2,
        "make small reversals of several amplitudes",
    ),
    Advice(
        frozenset({"load_dependent_friction"}),
        1,
        "repeat the same velocities at two poses that gravity loads differently",
    ),
    Advice(
        frozenset({"transmission_ripple", "encoder_eccentricity"}),
        1,
        "move slowly at constant speed, at two speeds, over as much of the range as there is",
    ),
    Advice(
        frozenset({"base_tilt", "encoder_offset", "gravity_spring", "cable_spring"}),
        1,
        "sweep the joints slowly through their whole range, the first one at several poses of the others",
    ),
    Advice(
        frozenset({"nonlinear_viscous_friction", "stribeck_friction", "asymmetric_friction"}),
        1,
        "hold many constant speeds in both directions, from creeping to the fastest allowed",
    ),
    Advice(frozenset({"torque_saturation", "external_contact"}), 1, "repeat the run: a contact will not"),
)
# Separation in noise units that one run shows beyond doubt; below it a motion alone cannot tell.
ENOUGH = 4.0


def why(open_: Sequence[str], chosen: Sequence[str], separation: float | None, reason: str) -> str:
    """Why and how to record again, in one or two sentences.

    open_: effects that stay open, "none" among them where it is whether there is one. chosen: those
    that the motion separates. separation: of the proposed motion in noise units, None where there is no
    motion for the given reason.
    """
    hidden = "none" in open_
    question = f"These runs cannot tell {_listed(open_)} apart"
    if hidden:
        question = f"These runs would not show {_listed(open_)}"
    if separation is None:
        return _sentences(question + _advice(open_), reason[0].upper() + reason[1:])
    if separation < ENOUGH:
        told = f"The best motion found would part them by only {separation:.2g} times the noise"
        return _sentences(question + _advice(open_), told)
    if not hidden:
        told = f"The proposed motion parts them by {separation:.3g} times the noise"
        told += "" if set(chosen) == set(open_) else f" if it is {_listed(chosen)}"
        return _sentences(question + _advice(open_), told)
    left = [name for name in open_ if name not in chosen]
    told = f"The proposed motion shows {_listed(chosen)} at {separation:.3g} times the noise or more"
    return _sentences(question, told, *([f"Left: {_listed(left)}{_advice(left)}"] if left else []))


def _advice(names: Sequence[str]) -> str:
    """Advice on what to record to distinguish these effects, after a colon; empty without any."""
    words = next((a.words for a in ADVICE if len(a.among & set(names)) >= a.least), "")
    return f": {words}" if words else ""


def _sentences(*sentences: str) -> str:
    return ". ".join(sentences) + "."


def _listed(names: Sequence[str]) -> str:
    """Titles of effects in a sentence."""
    titles = [effects()[name].DESCRIPTION.title.lower() for name in names if name != "none"]
    return titles[0] if len(titles) == 1 else ", ".join(titles[:-1]) + " and " + titles[-1]
