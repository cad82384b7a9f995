"""One physics step of the closed loop, compiled: sense, control, run the hooks of effects, apply, log."""

from functools import cache
from typing import Any

import numpy as np
from numba import carray, cfunc, types
from numpy.typing import NDArray

from identification.kinematics import kernel

from ..effects import action as rows
from ..effects.action import Stage
from ..native import address_pointer, float_pointer
from . import layout
from .controller import pd_command
from .friction import coulomb_friction
from .hooks import run_stage
from .led import APPLIED, BIAS, PASSIVE, POSITION, VELOCITY, begin_step, end_step, solve_at_joints
from .sensors import encoder_reading
from .transmission import motor_friction, spring_torque

Array = NDArray[np.float64]

# No arm turns this fast (rad/s, m/s): the loop is unstable.
RUNAWAY_SPEED = 1e5


@cache
def loop_callback(
    qpos: int, qvel: int, qfrc_applied: int, qfrc_bias: int, qfrc_passive: int, xfrc_applied: int
) -> Any:
    """The compiled mjcb_control for these offsets in mjData; numba's cache on disk is keyed by them."""

    @cfunc(types.void(types.int64, types.int64), cache=True)
    def control(model: int, data: int) -> None:
        # Each field of mjData is a pointer: its word holds the array's address.
        slot = carray(address_pointer(data + xfrc_applied), 1)[0]
        place = carray(address_pointer(slot), 1)[0]
        # mjcb_control is the process's: a model that another thread compiles meanwhile is stepped with it.
        if place == 0:
            return
        context = carray(layout.context_pointer(place), 1)[0]
        m, led = context.links, context.led
        position = carray(float_pointer(carray(address_pointer(data + qpos), 1)[0]), m)
        velocity = carray(float_pointer(carray(address_pointer(data + qvel), 1)[0]), m)
        bias = carray(float_pointer(carray(address_pointer(data + qfrc_bias), 1)[0]), m)
        passive = carray(float_pointer(carray(address_pointer(data + qfrc_passive), 1)[0]), m)
        applied = carray(float_pointer(carray(address_pointer(data + qfrc_applied), 1)[0]), m)
        if led == 0:
            closed_loop_step(context, model, data, position, velocity, bias, passive, applied)
            return
        own = begin_step(led, model, data, position, velocity, bias, passive)
        closed_loop_step(
            context, model, data, own[POSITION], own[VELOCITY], own[BIAS], own[PASSIVE], own[APPLIED]
        )
        end_step(led, model, data, position, velocity, bias, passive, applied)

    return control


@kernel
def closed_loop_step(
    context: Any,
    model: int,
    data: int,
    position: Array,
    velocity: Array,
    bias: Array,
    passive: Array,
    applied: Array,
) -> None:
    """Set the applied torque of one physics step: drive less friction; at a tick, sense, control and log.

    context: record of CONTEXT. model, data: addresses. position to applied: (n,) fields of mjData, or what
    ``begin_step`` makes of them.

    The steps v+ = v + h a(q), q+ = q + h v+ are those of the leapfrog q(t + h/2) = q(t) + h/2 v(t),
    v(t + h) = v(t) + h a(q(t + h/2)), ... (Hairer, Lubich & Wanner, "Geometric Numerical Integration",
    2006, ch. I.1.4) with MuJoCo's q half a step ahead of its v: q - h/2 v is the position at v's instant.
    Read as such, held torque and motion are aligned to second order in h, without it to half a step.
    """
    n = context.joints
    h = context.timestep
    constants = carray(float_pointer(context.constants), (layout.CONSTANTS, n))
    memory = carray(float_pointer(context.memory), (layout.MEMORIES, n))
    work = carray(float_pointer(context.work), (layout.SCRATCH + 2 * n + 2, n))
    bus = carray(float_pointer(context.bus), (n, rows.BUS_ROWS))
    force, before, last_drive, level = work[0], work[1], work[2], work[3]
    runaway = context.failed_sample >= 0
    for j in range(n):
        runaway = runaway or not abs(velocity[j]) < RUNAWAY_SPEED
    if runaway:
        _freeze(context, position, velocity, bias, passive, applied)
        return
    sample = context.step // context.substeps
    tick = context.step % context.substeps == 0
    output = carray(float_pointer(context.outputs), (context.samples, layout.OUTPUTS, n))[sample]
    for j in range(n):
        bus[j, rows.STEP], bus[j, rows.TIME], bus[j, rows.TIMESTEP] = context.step, context.step * h, h
    if tick:
        for j in range(n):
            output[layout.LINK_POSITION, j] = output[layout.POSITION, j] = position[j] - 0.5 * h * velocity[j]
            if constants[layout.SPLIT, j] > 0.0:
                output[layout.POSITION, j] = (
                    memory[layout.MOTOR_POSITION, j] - 0.5 * h * memory[layout.MOTOR_VELOCITY, j]
                )
            bus[j, rows.READING] = output[layout.POSITION, j]
            last_drive[j] = bus[j, rows.DRIVE]
            before[j] = memory[layout.COULOMB_FRICTION, j]
        run_stage(Stage.ENCODER, context.hooks, context.edges)
        _control(context, sample, bus, constants, memory)
    _fill(bus, position, velocity, bias, passive, constants, memory)
    run_stage(Stage.DRIVE, context.hooks, context.edges)
    run_stage(Stage.FRICTION_LEVEL, context.hooks, context.edges)
    run_stage(Stage.FRICTION_STATE, context.hooks, context.edges)
    run_stage(Stage.TRANSMISSION, context.hooks, context.edges)
    run_stage(Stage.TORQUE, context.hooks, context.edges)
    coulomb = memory[layout.COULOMB_FRICTION]
    for j in range(n):
        applied[j] = bus[j, rows.DRIVE] - bus[j, rows.VISCOUS] * bus[j, rows.VELOCITY]
        applied[j] += bus[j, rows.MOTOR_TORQUE] - bus[j, rows.SMOOTH_FRICTION]
        level[j] = bus[j, rows.COULOMB]
        if constants[layout.SPLIT, j] > 0.0:
            level[j] = 0.0
            applied[j] = _move_motor(context, model, data, j, applied[j], bus, constants, memory, work)
        applied[j] += bus[j, rows.LINK_TORQUE]
        force[j] = applied[j] + passive[j] - bias[j]
        # The solution for the links overwrites it.
        bus[j, rows.FRICTION] = coulomb[j]
    coulomb_friction(model, data, h, velocity, force, level, coulomb, work[layout.SCRATCH :], context.led)
    acceleration = work[layout.SCRATCH + 1]
    for j in range(n):
        smooth = bus[j, rows.VISCOUS] * bus[j, rows.VELOCITY] + bus[j, rows.SMOOTH_FRICTION]
        if constants[layout.SPLIT, j] > 0.0:
            coulomb[j] = bus[j, rows.FRICTION]
            bus[j, rows.LOAD] = applied[j] - bus[j, rows.LINK_TORQUE]
        else:
            applied[j] -= coulomb[j]
            rotor = constants[layout.ARMATURE, j] * acceleration[j]
            bus[j, rows.LOAD] = bus[j, rows.DRIVE] + bus[j, rows.MOTOR_TORQUE] - smooth - coulomb[j] - rotor
        bus[j, rows.FRICTION] = smooth + coulomb[j]
    if tick:
        _log(context, model, data, output, velocity, bias, passive, bus, constants, memory, work)
    context.step += 1


@kernel
def _fill(
    bus: Array, position: Array, velocity: Array, bias: Array, passive: Array, constants: Array, memory: Array
) -> None:
    """Set the rows of the bus at their values before the hooks of this step."""
    for j in range(velocity.size):
        row = bus[j]
        row[rows.LINK_POSITION], row[rows.LINK_VELOCITY] = position[j], velocity[j]
        row[rows.POSITION] = position[j]
        speed = velocity[j]
        if constants[layout.SPLIT, j] > 0.0:
            row[rows.POSITION] = memory[layout.MOTOR_POSITION, j]
            speed = memory[layout.MOTOR_VELOCITY, j]
        # Adams-Bashforth: the velocity half a step on, where the leapfrog takes its forces.
        row[rows.VELOCITY] = 1.5 * speed - 0.5 * memory[layout.LAST_VELOCITY, j]
        if constants[layout.IMPLICIT, j] > 0.0:
            # The mass matrix has the rest of the step in it.
            row[rows.VELOCITY] = speed
        memory[layout.LAST_VELOCITY, j] = speed
        row[rows.STATIC_LOAD] = bias[j] - passive[j]
        row[rows.COMMAND] = row[rows.DRIVE] = memory[layout.HELD_COMMAND, j]
        row[rows.VISCOUS], row[rows.COULOMB] = constants[layout.VISCOUS, j], constants[layout.COULOMB, j]
        row[rows.SMOOTH_FRICTION] = row[rows.MOTOR_TORQUE] = row[rows.LINK_TORQUE] = row[rows.HALF_GAP] = 0.0
        row[rows.STIFFNESS], row[rows.DAMPING] = (
            constants[layout.CONTACT_STIFFNESS, j],
            constants[layout.CONTACT_DAMPING, j],
        )


@kernel
def _move_motor(
    context: Any,
    model: int,
    data: int,
    j: int,
    torque: float,
    bus: Array,
    constants: Array,
    memory: Array,
    work: Array,
) -> float:
    """Step the motor of a split joint under ``torque``; returns what its transmission carries."""
    h, inertia = context.timestep, constants[layout.ARMATURE, j]
    unit, column = work[4], work[layout.SCRATCH]
    unit[:] = 0.0
    unit[j] = 1.0
    solve_at_joints(context.led, model, data, column.ctypes.data, unit.ctypes.data, 1)
    speed = memory[layout.MOTOR_VELOCITY, j]
    carried = spring_torque(
        bus[j, rows.POSITION] - bus[j, rows.LINK_POSITION],
        speed - bus[j, rows.LINK_VELOCITY],
        bus[j, rows.STIFFNESS],
        bus[j, rows.DAMPING],
        bus[j, rows.HALF_GAP],
        1.0 / inertia + column[j],
        h,
    )
    friction = motor_friction(speed, torque - carried, bus[j, rows.COULOMB], inertia, h)
    memory[layout.COULOMB_FRICTION, j] = friction
    memory[layout.MOTOR_VELOCITY, j] = speed + h / inertia * (torque - carried - friction)
    memory[layout.MOTOR_POSITION, j] += h * memory[layout.MOTOR_VELOCITY, j]
    return carried


@kernel
def _log(
    context: Any,
    model: int,
    data: int,
    output: Array,
    velocity: Array,
    bias: Array,
    passive: Array,
    bus: Array,
    constants: Array,
    memory: Array,
    work: Array,
) -> None:
    """Write what happened at a tick: the truth at this instant."""
    n = context.joints
    load, before, last_drive = work[0], work[1], work[2]
    for j in range(n):
        split = constants[layout.SPLIT, j] > 0.0
        # Torque and friction jump at a tick; the mean of both sides is what the mean torque brings about.
        drive = 0.5 * (last_drive[j] + bus[j, rows.DRIVE])
        speed = memory[layout.LAST_VELOCITY, j]
        friction = bus[j, rows.VISCOUS] * speed + 0.5 * (before[j] + memory[layout.COULOMB_FRICTION, j])
        friction += bus[j, rows.SMOOTH_FRICTION]
        load[j] = drive - friction
        load[j] += bus[j, rows.MOTOR_TORQUE]
        output[layout.ACCELERATION, j] = (
            (load[j] - bus[j, rows.LOAD]) / constants[layout.ARMATURE, j] if split else 0.0
        )
        load[j] = (bus[j, rows.LOAD] if split else load[j]) + bus[j, rows.LINK_TORQUE]
        load[j] = load[j] + passive[j] - bias[j]
        output[layout.READING, j] = memory[layout.LAST_READING, j]
        output[layout.VELOCITY, j] = speed
        output[layout.COMMAND, j] = memory[layout.HELD_COMMAND, j]
        output[layout.FRICTION, j] = friction
        output[layout.DRIVE, j] = drive
        output[layout.EFFECT_TORQUE, j] = bus[j, rows.MOTOR_TORQUE] + bus[j, rows.LINK_TORQUE]
    acceleration = work[4]
    solve_at_joints(context.led, model, data, acceleration.ctypes.data, load.ctypes.data, 1)
    for j in range(n):
        if not constants[layout.SPLIT, j] > 0.0:
            output[layout.ACCELERATION, j] = acceleration[j]


@kernel
def _control(context: Any, sample: int, bus: Array, constants: Array, memory: Array) -> None:
    """One tick: sample the encoders, estimate the velocity, and hold a new command."""
    row = carray(float_pointer(context.inputs), (context.samples, layout.INPUTS, context.joints))[sample]
    pole = context.velocity_pole
    for j in range(context.joints):
        reading = encoder_reading(
            bus[j, rows.READING], row[layout.POSITION_NOISE, j], constants[layout.ENCODER_QUANTUM, j]
        )
        if sample > 0:
            difference = (reading - memory[layout.LAST_READING, j]) * context.rate
            memory[layout.MEASURED_VELOCITY, j] = (
                pole * memory[layout.MEASURED_VELOCITY, j] + (1.0 - pole) * difference
            )
        memory[layout.LAST_READING, j] = reading
        memory[layout.HELD_COMMAND, j] = pd_command(
            row[layout.FEEDFORWARD, j],
            constants[layout.KP, j],
            constants[layout.KD, j],
            row[layout.REFERENCE_POSITION, j] - reading,
            row[layout.REFERENCE_VELOCITY, j] - memory[layout.MEASURED_VELOCITY, j],
            constants[layout.TORQUE_LIMIT, j],
        )


@kernel
def _freeze(
    context: Any, position: Array, velocity: Array, bias: Array, passive: Array, applied: Array
) -> None:
    """Stop a loop that ran away before MuJoCo meets values it warns about, and remember when."""
    if context.failed_sample < 0:
        context.failed_sample = context.step // context.substeps
    for j in range(context.joints):
        position[j] = 0.0
        velocity[j] = 0.0
        applied[j] = bias[j] - passive[j]
