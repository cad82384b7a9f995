"""Size of an effect, relative to that on healthy robots and to what no arm has."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from identification.parameters import COULOMB, MASS, PER_JOINT, VISCOUS
from testbench.effects import effect
from testbench.effects.payload import arm_length
from testbench.effects.signature import Quantity
from testbench.effects.size import scale_of, typical_range
from testbench.robot import Robot

from .candidates import Candidate

Array = NDArray[np.float64]

ELASTIC, CABLE, GAIN = "joint_elasticity", "cable_spring", "torque_gain_error"
OFFSET, ECCENTRICITY = "encoder_offset", "encoder_eccentricity"
RIPPLE = "transmission_ripple"
LAG = "actuator_lag"
# A delay of one joint alone is judged as a lag of it: the multiple that healthy joints reach.
LATE_ALONE = 4.5
# Bristles bear all of a joint's Coulomb friction; what gives way with less of it is another hysteresis.
# And an encoder that counts in no less than a part of their displacement looks like them.
BRISTLES, SMALLEST_LEVEL, COUNTS = "presliding_hysteresis", 0.55, 2.5
SPRINGS = CABLE, "gravity_spring"
# A spring that holds less than this share of the Coulomb friction may be any cable.
SPRING, SPRING_COULOMB = "gravity_spring", 0.1
# No gear loses so many times the severe end's share of its load, or warms within so many seconds: what seems
# to is fitted, but not reported. Worms and small gears lose more; there it explains all but all.
OF_THE_LOAD, MOST_OF_LOAD = "load_dependent_friction", 1.5
WARMING, SHORTEST_WARMING = "thermal_friction_drift", 3.5
# What warms for far longer than the runs last has any drop: it is sized as if with this time constant.
LONGEST_WARMING = 80.0
# The typical coefficient of nonlinear friction is that of a small exponent; a larger one bends the viscous
# torque by this share, if mildly.
BENDING, BENT = "nonlinear_viscous_friction", 0.1
# From this exponent on towards one its size falls to nothing.
LEAST_BENT = 0.7
# And so many times that is no oil's, but where it explains all but all.
MOST_BENT, ALL_BUT_ALL = 30.0, 0.95
# A kilogram is much on a small arm: there a mild payload is this share of the last link, or of the heaviest's
# hundredth where the model has next to nothing last.
PAYLOAD, OF_LAST_LINK, OF_HEAVIEST = "payload", 0.45, 0.01
# A tool's centre is no farther from the last joint than this share of the arm's length.
TOOL_REACH = 0.4
DIFFERENCE = "viscous_difference"


def is_excessive(robot: Robot, candidate: Candidate, coefficients: Array, share: float) -> bool:
    """Whether friction bends, grows with the load or falls with warmth as no gear's does.

    share: of its joint's squared residual that it explains.
    """
    if candidate.family.effect == BENDING:
        much = size(robot, np.zeros(robot.joints), candidate, coefficients) > MOST_BENT
        return much and share < ALL_BUT_ALL
    if candidate.family.effect == OF_THE_LOAD:
        (parameter,) = effect(OF_THE_LOAD).DESCRIPTION.parameters
        _, severe = typical_range(parameter, robot, candidate.family.joint)
        return float(coefficients[0]) > MOST_OF_LOAD * severe and share < ALL_BUT_ALL
    return candidate.family.effect == WARMING and candidate.member.shape["time_constant"] < SHORTEST_WARMING


def is_beyond_healthy(robot: Robot, torque_scale: Array, candidate: Candidate, coefficients: Array) -> bool:
    """Whether an effect is larger than what a healthy robot has of it; arguments as of ``size``."""
    name, joint = candidate.family.effect, candidate.family.joint
    if name == BRISTLES:
        assert joint is not None
        resolved = candidate.member.shape["displacement"] > COUNTS * candidate.position_step[joint]
        if not resolved or coefficients[0] < SMALLEST_LEVEL * scale_of("coulomb", robot, joint):
            return False
    return times_healthy(robot, torque_scale, candidate, coefficients) > 1


def times_healthy(robot: Robot, torque_scale: Array, candidate: Candidate, coefficients: Array) -> float:
    """Size of an effect as a multiple of the largest on a healthy robot; arguments as of ``size``."""
    description = effect(candidate.family.effect).DESCRIPTION
    healthy = LATE_ALONE if candidate.is_late_alone else description.healthy
    if description.of_sample:
        mild, _ = typical_range(description.parameters[0], robot, candidate.family.joint)
        healthy = max(healthy, description.of_sample * candidate.sample_time / mild)
    largest = size(robot, torque_scale, candidate, coefficients)
    return largest / healthy if healthy > 0 else np.inf * largest


def is_plausible(robot: Robot, candidate: Candidate, coefficients: Array) -> bool:
    """Whether the effect's parameters are within their bounds, and a payload's centre where a tool can be."""
    family, values = candidate.family, quantities(candidate, coefficients)
    for parameter in effect(family.effect).DESCRIPTION.parameters:
        if parameter.name in values:
            value = np.asarray(values[parameter.name].value)
            if np.any(value < parameter.lower) or np.any(value > parameter.upper):
                return False
    if family.effect == PAYLOAD:
        moment = float(np.linalg.norm(values["first_moment"].value))
        return moment <= TOOL_REACH * arm_length(robot.chain) * _number(values["mass"])
    return True


def quantities(candidate: Candidate, coefficients: Array) -> dict[str, Quantity]:
    """An effect's parameters by name, without their deviations."""
    count = candidate.count + len(candidate.family.refine)
    return candidate.family.parameters(candidate.member, coefficients, np.zeros((count, count)))


def size(robot: Robot, torque_scale: Array, candidate: Candidate, coefficients: Array) -> float:
    """An effect's size as a multiple of the mild end of its typical range on this robot's joint.

    torque_scale: (n,) N·m, a typical torque of each joint, for what has no scale of its own there.
    """
    family, description = candidate.family, effect(candidate.family.effect).DESCRIPTION
    known = {parameter.name: parameter for parameter in description.parameters}
    values = quantities(candidate, coefficients)
    largest, least = 0.0, description.least
    for name in description.size_names:
        mild, severe = typical_range(known[name], robot, family.joint)
        grows = severe >= mild
        if family.effect == PAYLOAD:
            masses = robot.parameters.reshape(-1, PER_JOINT)[:, MASS]
            mild = min(
                mild, OF_LAST_LINK * max(float(masses[robot.chain.last]), OF_HEAVIEST * float(masses.max()))
            )
        if family.joint is not None and known[name].unit == "N·m":
            mild = max(mild, least * float(torque_scale[family.joint]))
            if family.effect == SPRING:
                mild = max(mild, SPRING_COULOMB * scale_of("coulomb", robot, family.joint))
            # A least size stands for the mild end of what grows.
            grows = True
        if name == DIFFERENCE:
            # Where friction is little of the torque, any direction's share of it is nothing.
            assert family.joint is not None
            moved = max(float(candidate.rms[1]), float(np.finfo(float).tiny))
            mild = max(mild, least * float(torque_scale[family.joint]) / moved)
        value = _number(values[name])
        if family.effect == CABLE:
            value *= _lever(robot, candidate, values)
        if family.effect == WARMING:
            value *= _reached(candidate)
        exponent = _number(values["exponent"]) if family.effect == BENDING else 1.0
        if exponent < 1:
            # As little as that bends what viscous friction would be.
            value *= min((1 - exponent) / (1 - LEAST_BENT), 1.0)
        elif exponent > 1:
            assert family.joint is not None
            # At the highest speed of the runs; beyond it nothing is known.
            power = candidate.largest
            # The nearer the exponent is to one, the less it bends, too.
            value *= power * min(exponent * (exponent - 1) / 2, 1.0)
            speed = power ** (1 / exponent)
            mild = BENT * speed * scale_of("viscous", robot, family.joint)
        small, large = (value, mild) if grows else (mild, value)
        largest = max(largest, small / large if large > 0 else np.inf)
    return largest


def _lever(robot: Robot, candidate: Candidate, values: Mapping[str, Quantity]) -> float:
    """Distance from rest at which a cable is judged, rad (m): half of the joint's range, at most one.

    values: its parameters. One that hardens pulls there as if it were as much farther, but no more than it
    does in these runs: beyond their motion nothing is known of it.
    """
    joint = candidate.family.joint
    assert joint is not None
    lever = min(0.5 * float(robot.limits.upper[joint] - robot.limits.lower[joint]), 1.0)
    if "doubling" not in values:
        return lever
    return min(lever * (1 + (lever / _number(values["doubling"])) ** 2), candidate.largest)


def _reached(candidate: Candidate) -> float:
    """Share, up to one, of the warming within LONGEST_WARMING that a joint reaches in its runs."""
    seconds = candidate.sample_time * candidate.samples
    longest, constant = LONGEST_WARMING, candidate.member.shape["time_constant"]
    return min(float(np.expm1(-seconds / constant) / np.expm1(-seconds / longest)), 1.0)


def _number(quantity: Quantity) -> float:
    return float(np.max(np.abs(quantity.value)))


def with_friction(robot: Robot, parameters: Array) -> Robot:
    """The robot with the larger of its model's friction and these standard parameters' (14 n,)."""
    table = robot.parameters.reshape(-1, PER_JOINT).copy()
    fitted = parameters.reshape(-1, PER_JOINT)
    for column in (VISCOUS, COULOMB):
        table[:, column] = np.maximum(table[:, column], fitted[:, column])
    return replace(robot, parameters=table.ravel())
