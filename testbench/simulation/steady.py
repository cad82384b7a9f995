"""Loops that light links need: physics that resolves their damping, and a controller that is fast enough."""

from dataclasses import replace

import numpy as np

from identification.errors import InputError
from identification.parameters import PER_JOINT, VISCOUS

from ..robot import Robot
from .controller import MODEL
from .gains import Gains, gains, inertia_over_range, sag, servo_gains
from .options import SHORTEST_STEP, SimulationOptions

# Physics step times the fastest decay by viscous friction. Adams-Bashforth of second order is stable to 1; an
# effect may add to the friction.
RESOLVED = 0.25
# Share of the loop's stiffness that gravity may have: what the feedforward lacks then moves a joint five
# times as far as without gravity.
SAG = 0.8
# Hz: servo drives close their inner loops at 8 to 16 kHz.
FASTEST_LOOP = 8000.0


def controller_gains(options: SimulationOptions, nominal: Robot) -> Gains:
    """The gains of a run's controller, which knows this model. Raises InputError."""
    controller, limits = options.controller, nominal.limits
    if controller.kind == MODEL:
        return servo_gains(nominal.model)
    step = 1 / (controller.rate * options.substeps)
    return gains(controller, nominal.chain, nominal.parameters, limits.lower, limits.upper, step)


def resolved(options: SimulationOptions, robot: Robot) -> SimulationOptions:
    """Options whose physics step resolves the joints' viscous friction in every pose over their range.

    Raises InputError for friction that would need less than SHORTEST_STEP.
    """
    viscous = robot.parameters.reshape(-1, PER_JOINT)[:, VISCOUS]
    if not np.any(viscous > 0):
        return options
    limits = robot.limits
    inertia = inertia_over_range(robot.chain, robot.parameters, limits.lower, limits.upper)
    root = np.sqrt(np.maximum(viscous, 0))
    decays = np.linalg.eigvalsh(root[:, None] * np.linalg.inv(inertia) * root)[:, -1]
    period = 1 / options.controller.rate
    if decays.max() * period / options.substeps <= RESOLVED:
        return options
    step = period / np.ceil(decays.max() * period / RESOLVED)
    if step < SHORTEST_STEP:
        joint = robot.joint_names[int(np.argmax(viscous / np.einsum("kjj->kj", inertia).min(axis=0)))]
        expected = "inertia that its damping does not stop at once; give the link mass, or the joint armature"
        raise InputError(robot.path, joint, expected, f"a time constant of {1 / decays.max():.2g} s")
    return replace(options, physics_timestep=step)


def held_up(options: SimulationOptions, robot: Robot) -> tuple[SimulationOptions, str]:
    """Options whose loop is fast enough to hold the robot against gravity, and a line where it is faster.

    Until gravity's stiffness is at most SAG of the loop's, its rate is doubled where that bounds the
    bandwidth, else the bandwidth is raised by half. The log keeps its rate. Gains that were given, and
    servos, stay. Raises InputError where FASTEST_LOOP is not enough.
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
        if np.all(found.bandwidth >= controller.bandwidth * (1 - 1e-9)):
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
