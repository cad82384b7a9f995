"""Loops that light links need: physics that resolves their damping, and a controller that is fast enough."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from identification.errors import InputError
from identification.parameters import PER_JOINT, VISCOUS

from ..robot import Robot
from .controller import MODEL
from .gains import Gains, gains, inertia_over_range, sag, servo_gains
from .options import SimulationOptions

Array = NDArray[np.float64]

# Physics step times the fastest decay by viscous friction. Adams-Bashforth of second order is stable to 1; an
# effect may add to the friction.
RESOLVED = 0.25
# s: a shorter step is not worth its time, since what implicit friction is late by is less.
FINEST = 1e-5
# Share of the loop's stiffness that gravity may have: what the feedforward lacks then moves a joint five
# times as far as without gravity.
SAG = 0.8
# Hz: servo drives close their inner loops at 8 to 16 kHz.
FASTEST_LOOP = 16000.0


def controller_gains(options: SimulationOptions, nominal: Robot) -> Gains:
    """The gains of a run's controller, which knows this model. Raises InputError."""
    controller, limits = options.controller, nominal.limits
    if controller.kind == MODEL:
        return servo_gains(nominal.model)
    step = 1 / (controller.rate * options.substeps)
    return gains(controller, nominal.chain, nominal.parameters, limits.lower, limits.upper, step)


@dataclass(frozen=True)
class Resolved:
    """How a run's viscous friction is stepped.

    options: with a physics step that is short enough. implicit: (n,) kg·m² (kg), what the mass matrix of a
    step has on its diagonal besides, where friction is taken of the speed after the step; else zero.
    """

    options: SimulationOptions
    implicit: Array


def resolved(options: SimulationOptions, robot: Robot) -> Resolved:
    """A physics step that resolves the joints' viscous friction in every pose over their range.

    Where it would be below FINEST, that is the step, and friction D is taken of a mean of the speeds before
    and after it: M (v+ - v) = h (f - D ((1 - s) v + s v+)), which is stable at any step for a share s of a
    half or more (Hairer & Wanner, "Solving Ordinary Differential Equations II", 1996, ch. IV.3). It is a
    half, and with that of second order, up to h D / I = 2; beyond, 1 - I / (h D), which ends the motion
    within a step as the friction does. I is the joint's smallest inertia over the range.
    """
    viscous = robot.parameters.reshape(-1, PER_JOINT)[: robot.joints, VISCOUS]
    explicit = np.zeros(robot.joints)
    if not np.any(viscous > 0):
        return Resolved(options, explicit)
    limits = robot.limits
    inverse = np.linalg.inv(inertia_over_range(robot.chain, robot.parameters, limits.lower, limits.upper))
    root = np.sqrt(np.maximum(viscous, 0))
    fastest = np.linalg.eigvalsh(root[:, None] * inverse * root)[:, -1].max()
    period = 1 / options.controller.rate
    if fastest * period / options.substeps <= RESOLVED:
        return Resolved(options, explicit)
    step = period / np.ceil(fastest * period / RESOLVED)
    if step >= FINEST:
        return Resolved(replace(options, physics_timestep=step), explicit)
    # An asked step that is shorter stays.
    step = min(period / np.ceil(period / FINEST), period / options.substeps)
    decays = step * viscous * np.einsum("kjj->kj", inverse).max(axis=0)
    share = np.maximum(0.5, 1 - np.divide(1, decays, out=np.ones_like(decays), where=decays > 0))
    return Resolved(replace(options, physics_timestep=step), share * step * np.maximum(viscous, 0))


def held_up(options: SimulationOptions, robot: Robot) -> tuple[SimulationOptions, str]:
    """Options whose loop is fast enough to hold the robot against gravity, and a line where it is faster.

    Until gravity's stiffness is at most SAG of the loop's, its rate is doubled where that bounds the
    bandwidth of the joint that sags, else the bandwidth is raised by half. The log keeps its rate. Gains that
    were given, and servos, stay. Raises InputError where FASTEST_LOOP is not enough.
    """
    asked = options.controller
    if asked.kind == MODEL or asked.kp is not None or asked.kd is not None:
        return options, ""
    limits, longest = robot.limits, options.physics_timestep
    while True:
        controller = options.controller
        found = controller_gains(options, robot)
        share, joint = sag(found.kp, robot.chain, robot.parameters, limits.lower, limits.upper)
        if share <= SAG:
            break
        if found.bandwidth[joint] >= controller.bandwidth * (1 - 1e-9):
            options = replace(options, controller=replace(controller, bandwidth=1.5 * controller.bandwidth))
            continue
        rate = 2 * controller.rate
        if rate > FASTEST_LOOP:
            name, unit = robot.joint_names[joint], "kg" if robot.chain.is_slide[joint] else "kg·m²"
            expected = (
                f"the rotors' inertia (armature), or a narrower range: a loop at {controller.rate:g} Hz "
                "cannot hold links this light up"
            )
            least, most = found.smallest[joint], found.largest[joint]
            got = f"an inertia of {least:.2g} to {most:.2g} {unit} over the range"
            raise InputError(robot.path, name, expected, got)
        substeps = np.ceil(1 / (rate * longest) - 1e-6)
        options = replace(
            options,
            controller=replace(controller, rate=rate),
            physics_timestep=1 / (rate * substeps),
            loops_a_sample=2 * options.loops_a_sample,
        )
    if controller == asked:
        return options, ""
    return options, (
        f"loop at {controller.rate:g} Hz, bandwidth up to {controller.bandwidth:g} Hz: at {asked.rate:g} Hz "
        f"and {asked.bandwidth:g} Hz it does not hold links this light up"
    )
