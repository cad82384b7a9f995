"""Which experiment tells which effects apart, in words."""

from collections.abc import Sequence
from dataclasses import dataclass

from testbench.effects import effects


@dataclass(frozen=True)
class Advice:
    """What to record where at least ``least`` of these effects are among those to tell apart."""

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


def why(names: Sequence[str], separation: float | None, reason: str) -> str:
    """Why and how to record again, in one or two sentences.

    names: effects to tell apart, "none" among them where it is whether there is one. separation: of
    the proposed motion in noise units, None where there is no motion for the given reason.
    """
    titles = [effects()[name].DESCRIPTION.title.lower() for name in names if name != "none"]
    listed = titles[0] if len(titles) == 1 else ", ".join(titles[:-1]) + " and " + titles[-1]
    if "none" in names:
        question = f"These runs would not show {listed}"
    else:
        question = f"These runs cannot tell {listed} apart"
    chosen = {name for name in names if name != "none"}
    words = next((a.words for a in ADVICE if len(a.among & chosen) >= a.least), "")
    parts = [question + (f": {words}" if words else "")]
    if separation is None:
        parts.append(reason[0].upper() + reason[1:])
    elif separation < ENOUGH:
        parts.append(f"The best motion found would part them by only {separation:.2g} times the noise")
    else:
        parts.append(f"The proposed motion parts them by {separation:.3g} times the noise")
    return ". ".join(parts) + "."
