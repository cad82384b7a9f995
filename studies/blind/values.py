"""Parameters of an effect that is drawn: its sizes by severity, its shape at random, so that it acts."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from testbench.effects import effect, injection
from testbench.effects.base import EffectParameter, Injection, Scope
from testbench.effects.signature import places
from testbench.effects.size import scale_of, speed_limit, typical_range, typical_values
from testbench.robot import Robot

Array = NDArray[np.float64]

# What an effect looks like is drawn from these ranges, whatever its severity.
SHAPES = {
    "stribeck_friction": {"velocity": (0.03, 0.4), "exponent": (1.0, 2.5)},
    "presliding_hysteresis": {"exponent": (0.4, 2.6)},
    "joint_coupling": {"width": (0.01, 0.15)},
    "thermal_friction_drift": {"time_constant": (10.0, 60.0)},
    "transmission_ripple": {
        "cycles": (8.0, 60.0),
        "phase": (-np.pi, np.pi),
        "second_cycles": (8.0, 120.0),
        "second_phase": (-np.pi, np.pi),
    },
    "gravity_spring": {"phase": (-np.pi, np.pi)},
    "cable_spring": {"rest": (-1.0, 1.0), "doubling": (0.5, 1.5)},
    "encoder_eccentricity": {"phase": (-np.pi, np.pi), "second_phase": (-np.pi, np.pi)},
    "external_contact": {"start": (1.0, 6.0), "duration": (0.2, 1.0)},
}
SIGNED = {
    "asymmetric_friction": ("offset", "viscous_difference"),
    "base_tilt": ("roll", "pitch"),
    "encoder_offset": ("offset",),
    "external_contact": ("torque",),
    "torque_gain_error": ("relative",),
}
# Sizes that vary about the typical one of their severity by up to this factor.
SPREAD = {
    "joint_elasticity": {"damping": 3.0},
    "joint_coupling": {"viscous": 2.0, "coulomb": 2.0},
    "transmission_ripple": {"second_amplitude": 2.0},
    "encoder_eccentricity": {"second_amplitude": 2.0},
}
# Friction flattens by the first exponents and bends, either way, by the second: by so much of the viscous
# torque at the speed limit.
FLATTENING, BENDING, BENT = (0.3, 0.7), (1.8, 2.2), (0.1, 0.4)
# Share of the ripples with a second wave whose wave is a second harmonic.
HARMONIC = 0.5
# Share of the samples at which a saturation clips, mild and severe.
CLIPPED = (0.005, 0.08)
# A payload is typical of an arm whose links weigh this much, kg; its centre lies this far out, m.
PAYLOAD_ARM, PAYLOAD_REACH = 60.0, (0.03, 0.12)
# A typical size below this share of the joint's torque limit is none.
SMALLEST_SHARE = 1e-4


def drawn_place(name: str, robot: Robot, rng: np.random.Generator) -> tuple[int | None, int | None] | None:
    """Where the effect is put: (joint, into), None as in the catalogue; None where the robot has no place."""
    description = effect(name).DESCRIPTION
    possible = places(description, robot.chain.is_slide)
    if description.scope is Scope.PAIR:
        # Shared drives are those of neighbours.
        possible = tuple((a, b) for a, b in possible if a is not None and b == a + 1)
    fit = [place for place in possible if place[0] is None or _acts(name, robot, place[0])]
    return fit[int(rng.integers(len(fit)))] if fit else None


def _acts(name: str, robot: Robot, joint: int) -> bool:
    """Whether the effect's first parameter has a typical size on that joint."""
    first: EffectParameter = effect(name).DESCRIPTION.parameters[0]
    if not first.relative_to:
        return True
    smallest = SMALLEST_SHARE * scale_of("torque_limit", robot, joint)
    scaled_torque = first.relative_to in ("coulomb", "viscous_torque", "gravity", "torque_limit")
    severe = max(abs(end) for end in typical_range(first, robot, joint))
    return severe > (smallest if scaled_torque else 0.0)


def drawn_injection(
    robot: Robot,
    name: str,
    place: tuple[int | None, int | None],
    law: str,
    severity: float,
    torques: Sequence[Array],
    rng: np.random.Generator,
) -> Injection:
    """The effect at that severity (0 mild, 1 severe). torques: a run (N, n) N·m, what the motions need."""
    joint = place[0]
    description = effect(name).DESCRIPTION
    values = typical_values(description, robot, joint, severity)
    values |= {key: float(rng.uniform(*ends)) for key, ends in SHAPES.get(name, {}).items()}
    for key, factor in SPREAD.get(name, {}).items():
        values[key] *= float(factor ** rng.uniform(-1.0, 1.0))
    for key in SIGNED.get(name, ()):
        values[key] *= float(rng.choice((-1.0, 1.0)))
    if name == "nonlinear_viscous_friction":
        assert joint is not None
        bends = bool(rng.random() < 0.5)
        values["exponent"] = float(rng.uniform(*(BENDING if bends else FLATTENING)))
        if bends:
            # The typical coefficient is that of a small exponent.
            at_limit = (BENT[0] + severity * (BENT[1] - BENT[0])) * scale_of("viscous_torque", robot, joint)
            speed = speed_limit(robot.limits, joint) ** values["exponent"]
            values["coefficient"] = float(rng.choice((-1.0, 1.0))) * at_limit / speed
    if name == "transmission_ripple" and rng.random() < HARMONIC:
        values["second_cycles"] = 2 * values["cycles"]
    if name == "cable_spring":
        assert joint is not None
        # Of half the joint's range.
        half = float(robot.limits.upper[joint] - robot.limits.lower[joint]) / 2
        values["doubling"] *= min(half, np.pi)
    if name == "torque_saturation":
        assert joint is not None
        clipped = CLIPPED[0] + severity * (CLIPPED[1] - CLIPPED[0])
        size = np.abs(np.concatenate([torque[:, joint] for torque in torques]))
        values["limit"] = float(np.quantile(size, 1 - clipped))
    if name == "payload":
        values["mass"] *= min(1.0, float(np.sum(robot.model.body_mass)) / PAYLOAD_ARM)
        out = rng.standard_normal(3)
        centre = out / np.linalg.norm(out) * rng.uniform(*PAYLOAD_REACH)
        for axis, moment in zip("xyz", centre * values["mass"], strict=True):
            values[f"first_moment_{axis}"] = float(moment)
    for parameter in description.parameters:
        values[parameter.name] = float(np.clip(values[parameter.name], parameter.lower, parameter.upper))
    numbers = [None if index is None else index + 1 for index in place]
    return injection(robot, name, numbers[0], values, law, numbers[1])
