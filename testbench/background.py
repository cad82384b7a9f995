"""The small imperfections that no healthy robot is without, on every joint."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .effects import effect, injection
from .effects.base import Injection
from .effects.size import scale_of
from .robot import Robot
from .simulation import SensorOptions

Array = NDArray[np.float64]

# Ranges that a joint's imperfections are drawn from, at a scale of 1.
STRIBECK_EXTRA = (0.01, 0.05)  # of the Coulomb friction
STRIBECK_VELOCITY = (0.05, 0.3)  # rad/s
STRIBECK_EXPONENT = (1.0, 2.0)
OFFSET = (0.005, 0.03)  # of the Coulomb friction, either sign
VISCOUS_DIFFERENCE = (0.002, 0.01)  # of the viscous friction, either sign
LOAD_FRICTION = (0.002, 0.008)
RIPPLE = (0.0005, 0.0015)  # of the torque limit
RIPPLE_CYCLES = (8.0, 60.0)
SECOND_HARMONIC = 0.3  # of the ripple's amplitude
CABLE = (0.005, 0.03)  # of the Coulomb friction, N·m/rad
TORQUE_NOISE = 0.005  # of the torque limit
CORRELATION_TIME = (0.002, 0.01)  # s
ENCODER_BITS = (17, 18, 19)
SLIDE_RESOLUTION = (1e-6, 4e-6)  # m
SKEW = (0.0, 0.002)  # s by which the torque channel leads the position


@dataclass(frozen=True)
class Background:
    """effects: on every joint. sensors: of the whole robot."""

    effects: tuple[Injection, ...]
    sensors: SensorOptions


def background(robot: Robot, seed: int | np.random.SeedSequence, scale: float = 1.0) -> Background:
    """Stribeck, asymmetric and load friction, ripple and cable of every joint, and its sensors.

    scale: multiplies every size but those of the encoders. Laws are drawn among those that the effects
    offer. The same robot, seed and scale give the same background.
    """
    rng = np.random.default_rng(seed)
    injections: list[Injection] = []
    for joint in range(robot.joints):
        coulomb = scale * scale_of("coulomb", robot, joint)
        viscous = scale * scale_of("viscous", robot, joint)
        drawn: dict[str, dict[str, float]] = {
            "stribeck_friction": {
                "extra": coulomb * rng.uniform(*STRIBECK_EXTRA),
                "velocity": rng.uniform(*STRIBECK_VELOCITY),
                "exponent": rng.uniform(*STRIBECK_EXPONENT),
            },
            "asymmetric_friction": {
                "offset": _sign(rng) * coulomb * rng.uniform(*OFFSET),
                "viscous_difference": _sign(rng) * viscous * rng.uniform(*VISCOUS_DIFFERENCE),
            },
            "load_dependent_friction": {"coefficient": min(scale * rng.uniform(*LOAD_FRICTION), 1.0)},
            "transmission_ripple": {
                "amplitude": scale * scale_of("torque_limit", robot, joint) * rng.uniform(*RIPPLE),
                "cycles": rng.uniform(*RIPPLE_CYCLES),
                "phase": rng.uniform(-np.pi, np.pi),
            },
            "cable_spring": {
                "stiffness": coulomb * rng.uniform(*CABLE),
                "rest": rng.uniform(-1.0, 1.0),
                # A hose that hardens is at most twice as stiff at the end of the joint's range.
                "doubling": min(float(robot.limits.upper[joint] - robot.limits.lower[joint]), 2 * np.pi),
            },
        }
        ripple = drawn["transmission_ripple"]
        ripple["second_amplitude"] = SECOND_HARMONIC * ripple["amplitude"]
        ripple |= {"second_cycles": 2 * ripple["cycles"], "second_phase": 2 * ripple["phase"]}
        for name, values in drawn.items():
            law = str(rng.choice(effect(name).DESCRIPTION.laws))
            injections.append(injection(robot, name, joint + 1, values, law))
    n = robot.joints
    limited = np.isfinite(robot.limits.torque)
    sensors = SensorOptions(
        encoder_bits=rng.choice(ENCODER_BITS, n),
        slide_resolution=rng.uniform(*SLIDE_RESOLUTION, n),
        torque_noise=np.where(limited, scale * TORQUE_NOISE, 0.0),
        torque_correlation_time=rng.uniform(*CORRELATION_TIME, n),
        torque_delay=-scale * rng.uniform(*SKEW),
    )
    return Background(tuple(injections), sensors)


def _sign(rng: np.random.Generator) -> float:
    return float(rng.choice((-1.0, 1.0)))
