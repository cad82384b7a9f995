"""Cable spring: the dress pack pulls the joint back to where it hangs straight."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..robot import Robot
from .action import (
    LINK_POSITION,
    LINK_TORQUE,
    LINK_VELOCITY,
    TIMESTEP,
    Action,
    SimulatedRobot,
    Stage,
    bus_row,
    hook,
    hook_kernel,
    require_joint,
    vector,
)
from .base import EffectDescription, EffectParameter, Injection, Scope
from .bristle import bristle_step, unit_bristle
from .columns import on_one_joint
from .experiment import Experiment
from .fitted_effect import FittedEffect, times
from .mjcf_form import file_angle, joint_element
from .signature import Family, Logged, Member, Quantity

Array = NDArray[np.float64]

LINEAR, HYSTERETIC, HARDENING = "linear", "hysteretic", "hardening"

DESCRIPTION = EffectDescription(
    name="cable_spring",
    title="Cable spring",
    law="drive torque needed + stiffness·(q - rest); hysteretic adds Dahl friction of 0.2 rad·stiffness that "
    "yields within 0.1 rad; hardening: stiffness·x·(1 + (x / doubling)²), x = q - rest",
    reference='Dahl, "A solid friction model", 1968 (the hysteresis); Duffing\'s spring (hardening)',
    scope=Scope.JOINT,
    parameters=(
        EffectParameter("stiffness", "N·m/rad", 0.0, np.inf, (0.05, 0.5), "coulomb"),
        EffectParameter("rest", "rad", -10.0, 10.0, (0.0, 0.5)),
        EffectParameter("doubling", "rad", 1e-3, np.inf, (1.0, 1.0), law=HARDENING),
    ),
    laws=(LINEAR, HYSTERETIC, HARDENING),
    confused_with=("gravity_spring", "asymmetric_friction", "base_tilt"),
    shown_by=(Experiment.WHOLE_RANGE,),
    of_position=True,
    # A hose is no straight line.
    explains_all=0.95,
    loads=True,
    # Every arm has a dress pack, and it pulls.
    healthy=1.2,
)

# Of the hysteretic cable: friction in radians of spring, and the angle within which it yields.
FRICTION, YIELD = 0.2, 0.1
# What they may be on a robot, and where they are looked for first.
FRICTIONS, YIELDS = (0.03, 0.6), (0.02, 0.4)
LIKELY = ((0.1, 0.05), (0.3, 0.05), (0.2, 0.15))
# Where a hardening one rests, and how far from there its stiffness doubles, from the middle of the motion's
# range and in halves of it: what is looked for first, and what it may be.
LIKELY_RESTS, RESTS = (-0.75, 0.0, 0.75), (-1.5, 1.5)
LIKELY_DOUBLING, DOUBLINGS = 0.6, (0.2, 3.0)
# rad.
STILL = 1e-6
# Where its size is judged, from rest: at this share of the joint's range, and at most so many rad (m).
OF_RANGE, FARTHEST = 0.5, 1.0


def action(injection: Injection, simulated: SimulatedRobot) -> Action:
    """A torque on the link."""
    joint = require_joint(DESCRIPTION.name, injection.joint, simulated.robot.joints)
    values = [injection.values[name] for name in ("stiffness", "rest")]
    values += [_hardening(injection), injection.law == HYSTERETIC]
    return Action((hook(Stage.TORQUE, _pull, joint, values, state=1),))


def _hardening(injection: Injection) -> float:
    """How much a cable stiffens, as a share of its stiffness, a rad² from rest."""
    return injection.values["doubling"] ** -2 if injection.law == HARDENING else 0.0


@hook_kernel
def _pull(bus: int, parameters: int, state: int, joint: int) -> None:
    row, value, deflection = bus_row(bus, joint), vector(parameters, 4), vector(state, 1)
    stiffness, pulled = value[0], row[LINK_POSITION] - value[1]
    row[LINK_TORQUE] -= stiffness * pulled * (1.0 + value[2] * pulled * pulled)
    if value[3] > 0.0 and stiffness > 0.0:
        level = FRICTION * stiffness
        bristles = level / YIELD
        deflection[0] = bristle_step(deflection[0], row[LINK_VELOCITY], level, bristles, 1.0, row[TIMESTEP])
        row[LINK_TORQUE] -= bristles * deflection[0]


def signature(runs: Sequence[Logged], joint: int | None, into: int | None) -> Family:
    """q and 1; of a hysteretic cable q with the Dahl friction that goes with it; of a hardening one all."""
    joint = require_joint(DESCRIPTION.name, joint, runs[0].joints)
    lower, upper = np.array([0.0, -np.inf]), np.full(2, np.inf)

    def pulling(pull: Callable[[Logged], Array], shape: Mapping[str, float], law: str | None) -> Member:
        columns = on_one_joint(runs, lambda run: np.column_stack([pull(run), np.ones(run.samples)]))
        return Member(dict(shape), (joint,), columns, lower, upper, law)

    def hardening(shape: Mapping[str, float]) -> Member:
        def columns(run: Logged) -> Array:
            pulled = run.q[:, [joint]] - shape["rest"]
            return pulled * (1 + (pulled / shape["doubling"]) ** 2)

        return Member(dict(shape), (joint,), on_one_joint(runs, columns), lower[:1], upper[:1], HARDENING)

    def member(shape: Mapping[str, float]) -> Member:
        def pull(run: Logged) -> Array:
            rubbed = np.empty((run.samples, 1))
            v = np.ascontiguousarray(run.dq[:, joint])
            unit_bristle(v, np.array([shape["yields"]]), 1.0, 1 / run.sample_rate, rubbed)
            return run.q[:, joint] + shape["friction"] * rubbed[:, 0]

        return hardening(shape) if "rest" in shape else pulling(pull, shape, HYSTERETIC)

    ends = [(float(run.q[:, joint].min()), float(run.q[:, joint].max())) for run in runs]
    low, high = min(low for low, _ in ends), max(high for _, high in ends)
    # A joint that does not move pulls no cable, but a range has two ends.
    middle, half = (low + high) / 2, max((high - low) / 2, STILL)
    shapes = [{"friction": f, "yields": y} for f, y in LIKELY]
    shapes += [{"rest": middle + r * half, "doubling": LIKELY_DOUBLING * half} for r in LIKELY_RESTS]
    linear = pulling(lambda run: run.q[:, joint], {}, None)
    return Family(
        effect=DESCRIPTION.name,
        joint=joint,
        members=(linear, *(member(shape) for shape in shapes)),
        parameters=_parameters,
        refine={
            "friction": FRICTIONS,
            "yields": YIELDS,
            "rest": (middle + RESTS[0] * half, middle + RESTS[1] * half),
            "doubling": (DOUBLINGS[0] * half, DOUBLINGS[1] * half),
        },
        member=member,
    )


def _parameters(member: Member, c: Array, covariance: Array) -> dict[str, Quantity]:
    """Stiffness and rest = -c_1 / c_0, with the first-order standard deviation; or as its shapes have it."""
    stiffness, shape = float(c[0]), member.shape
    if member.law == HARDENING:
        # After one coefficient, and the two shapes that it has not.
        std = np.sqrt(np.maximum(np.diag(covariance), 0.0))
        return {
            "stiffness": Quantity(stiffness, float(std[0]), "N·m/rad"),
            "rest": Quantity(shape["rest"], float(std[3]), "rad"),
            "doubling": Quantity(shape["doubling"], float(std[4]), "rad"),
        }
    covariance = covariance[:2, :2]
    # A spring that is all offset rests too far away to be one, but not at infinity.
    spring = max(stiffness, 1e-9 * abs(float(c[1])), 1e-30)
    rest = -float(c[1]) / spring
    gradient = np.array([-rest / spring, -1 / spring])
    std = np.sqrt(np.maximum([covariance[0, 0], gradient @ covariance @ gradient], 0.0))
    return {
        "stiffness": Quantity(stiffness, float(std[0]), "N·m/rad"),
        "rest": Quantity(rest, float(std[1]), "rad"),
    }


def size(fitted: FittedEffect) -> float:
    """Its pull at half of the joint's range, or at one rad (m), as a multiple of a mild one's at one."""
    return times(fitted.value("stiffness") * _lever(fitted), fitted.mild("stiffness"))


def _lever(fitted: FittedEffect) -> float:
    """Distance from rest at which a cable is judged, rad (m).

    One that hardens pulls there as if it were as much farther, but no more than it does in these runs: beyond
    their motion nothing is known of it.
    """
    limits, joint = fitted.robot.limits, fitted.own_joint
    lever = min(OF_RANGE * float(limits.upper[joint] - limits.lower[joint]), FARTHEST)
    if "doubling" not in fitted.values:
        return lever
    return min(lever * (1 + (lever / fitted.value("doubling")) ** 2), fitted.member.largest)


def write(spec: Any, robot: Robot, injection: Injection) -> tuple[str, ...]:
    """The joint's own spring, in series with nothing; two springs on a joint become one."""
    joint = require_joint(DESCRIPTION.name, injection.joint, robot.joints)
    element = joint_element(spec, robot, joint)
    added = injection.values["stiffness"]
    rest = file_angle(spec, robot, joint, injection.values["rest"])
    stiffness = np.array(element.stiffness, dtype=float)
    total = stiffness[0] + added
    if total > 0.0:
        element.springref = (stiffness[0] * element.springref + added * rest) / total
    element.stiffness = [total, stiffness[1], stiffness[2] + added * _hardening(injection)]
    sentences = []
    if injection.law == HARDENING and stiffness.any():
        sentences.append("the cable hardens about where the joint rests with its own spring")
    if stiffness[1:].any():
        sentences.append("the joint's own spring is a polynomial whose rest position moves with the cable's")
    if injection.law == HYSTERETIC:
        sentences.append("the cable's hysteresis is left out")
    return tuple(sentences)
