"""Torque that is measured between gearbox and link: no friction and no rotor is in it."""

from dataclasses import replace

from .finding import Finding, Severity
from .subject import Subject

STAGE = 3

# Logarithm of the odds, a joint, by which a torque without friction and rotors is likelier than one with
# them.
ODDS = 4.0


def check(subject: Subject) -> list[Finding]:
    """Whether the torques of all joints are those of the links alone."""
    if subject.fit is None or subject.searched is None:
        return []
    convention = subject.searched[1].convention
    moving = int((subject.samples.moves.any(axis=0)).sum()) if subject.samples is not None else 0
    # Scales are the likeliest with friction; without it the model's own must do.
    plain = replace(convention, scale=(1.0,) * subject.robot.joints)
    with_both = max(subject.fit.under(each).evidence for each in {convention, plain})
    bare = subject.fit.without_friction_and_rotors()
    if moving and bare.under(plain).evidence > with_both + ODDS * moving:
        sentence = (
            "The torque has no friction and no rotors in it: joint torque sensors on the link's side. "
            "Friction and rotor inertia are not identifiable from these logs: take them from the model, or "
            "log motor currents"
        )
        return [Finding(Severity.WARN, "link_side", sentence, (), "", "joint/torque")]
    return []
