"""Many closed loops stepped at once: the compiled callback, its context, and the batch that runs it.

Each simulation has a context block: counters, constants, and the addresses of its arrays. The
callback finds the block through the force slot of the world body (``xfrc_applied[0]``), which is part
of each simulation's state and which MuJoCo never reads, so any compiled model runs unchanged.
"""

import os
from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import cache
from typing import Any

import mujoco
import numba
import numpy as np
from mujoco.batch import Batch, SimulationError
from numba import carray, cfunc, types
from numpy.typing import NDArray

from identification.errors import InputError
from identification.kinematics import kernel

from ..effects import action as rows
from ..effects.action import Hook, Stage
from ..native import address_pointer, float_pointer, pointer_to
from .controller import pd_command
from .friction import coulomb_friction
from .hooks import hook_table, run_stage
from .mujoco_pointers import check_offsets, data_offsets, installed_control, solve_mass_matrix
from .sensors import encoder_reading
from .transmission import motor_friction, spring_torque

Array = NDArray[np.float64]

# No arm turns this fast (rad/s, m/s): the loop is unstable.
RUNAWAY_SPEED = 1e5

# Rows of the arrays that the context points at; the last axis is the joint.
CONSTANTS = 10
(
    VISCOUS,
    COULOMB,
    KP,
    KD,
    TORQUE_LIMIT,
    ENCODER_QUANTUM,
    ARMATURE,
    SPLIT,
    CONTACT_STIFFNESS,
    CONTACT_DAMPING,
) = range(CONSTANTS)
INPUTS = 4
REFERENCE_POSITION, REFERENCE_VELOCITY, FEEDFORWARD, POSITION_NOISE = range(INPUTS)
OUTPUTS = 9
(
    READING,
    POSITION,
    VELOCITY,
    ACCELERATION,
    COMMAND,
    FRICTION,
    DRIVE,
    EFFECT_TORQUE,
    LINK_POSITION,
) = range(OUTPUTS)
MEMORIES = 7
(
    LAST_READING,
    MEASURED_VELOCITY,
    HELD_COMMAND,
    COULOMB_FRICTION,
    LAST_VELOCITY,
    MOTOR_POSITION,
    MOTOR_VELOCITY,
) = range(MEMORIES)
# Rows of scratch before those of ``coulomb_friction``, which takes 2 n + 2.
SCRATCH = 5

CONTEXT = np.dtype(
    [
        ("step", np.int64),
        ("substeps", np.int64),
        ("joints", np.int64),
        ("samples", np.int64),
        ("failed_sample", np.int64),
        ("timestep", np.float64),
        ("rate", np.float64),
        ("velocity_pole", np.float64),
        ("constants", np.int64),
        ("inputs", np.int64),
        ("outputs", np.int64),
        ("memory", np.int64),
        ("work", np.int64),
        ("bus", np.int64),
        ("hooks", np.int64),
        ("edges", np.int64),
    ]
)
_context_pointer = pointer_to(numba.from_dtype(CONTEXT))


@dataclass(frozen=True)
class Loop:
    """One closed loop to run: N samples, n joints, SI units at the joint.

    plant: its MuJoCo model. substeps: physics steps a control period. rate: Hz, of the controller.
    velocity_pole: of its velocity filter. constants: (CONSTANTS, n). inputs: (N, INPUTS, n).
    pose: (n,) of the links at the start, at rest. hold: (n,) drive torque before the start.
    windup: (n,) motor less link position at the start. hooks: of the effects.
    """

    plant: Any
    substeps: int
    rate: float
    velocity_pole: float
    constants: Array
    inputs: Array
    pose: Array
    hold: Array
    windup: Array | float = 0.0
    hooks: tuple[Hook, ...] = ()


def run_loops(loops: Sequence[Loop], threads: int | None) -> list[Array]:
    """Outputs of each loop at each sample, (N, OUTPUTS, n); they do not depend on ``threads``.

    Raises InputError when the models cannot share a batch or a loop runs away.
    """
    batch = _batch(loops, threads)
    arrays = [_arrays(loop) for loop in loops]
    contexts = np.zeros(len(loops), CONTEXT)
    slots = batch.bind("xfrc_applied")
    for index, loop in enumerate(loops):
        contexts[index] = _context(loop, arrays[index])
        slots.view(np.int64)[index, 0, 0] = contexts.ctypes.data + index * CONTEXT.itemsize
        batch.bind("qpos")[index] = loop.pose
    # One step more than there are periods: it logs the last sample.
    steps = np.array([(len(loop.inputs) - 1) * loop.substeps + 1 for loop in loops])
    offsets = data_offsets()
    check_offsets(offsets, mujoco.MjData(loops[0].plant))
    callback = _callback(*(getattr(offsets, field.name) for field in fields(offsets)))
    with installed_control(callback.ctypes):
        done = 0
        for stop in np.unique(steps):
            try:
                batch.step(np.flatnonzero(steps >= stop), int(stop - done))
            except SimulationError as error:
                raise InputError(
                    "simulation", f"run {error.ids[0] + 1}", "a motion MuJoCo can step", error
                ) from None
            done = stop
    for index, failed in enumerate(contexts["failed_sample"]):
        if failed >= 0:
            got = f"speeds beyond {RUNAWAY_SPEED:g} at {failed / loops[index].rate:.3f} s"
            raise InputError(
                "simulation", f"run {index + 1}", "gains, rate and timestep of a stable loop", got
            )
    return [own["outputs"] for own in arrays]


def _batch(loops: Sequence[Loop], threads: int | None) -> Batch:
    """A batch with one simulation a loop, each on its own plant."""
    workers = min(threads or os.cpu_count() or 1, len(loops))
    batch = Batch(loops[0].plant, len(loops), workers)
    try:
        batch.set_models([loop.plant for loop in loops])
    except (ValueError, mujoco.FatalError) as error:
        raise InputError("simulation", "robots", "models of one layout in a call", error) from None
    return batch


def _arrays(loop: Loop) -> dict[str, Any]:
    """The arrays a context points at."""
    samples, _, n = loop.inputs.shape
    memory = np.zeros((MEMORIES, n))
    memory[HELD_COMMAND], memory[MOTOR_POSITION] = loop.hold, loop.pose + loop.windup
    bus = np.zeros((n, rows.BUS_ROWS))
    bus[:, rows.DRIVE] = bus[:, rows.LOAD] = loop.hold
    table, edges = hook_table(loop.hooks, bus)
    return {
        "constants": np.ascontiguousarray(loop.constants),
        "inputs": np.ascontiguousarray(loop.inputs),
        "outputs": np.zeros((samples, OUTPUTS, n)),
        "memory": memory,
        "work": np.zeros((SCRATCH + 2 * n + 2, n)),
        "bus": bus,
        "hooks": table,
        "edges": edges,
    }


def _context(loop: Loop, arrays: dict[str, Any]) -> tuple[Any, ...]:
    """A row of CONTEXT."""
    samples, _, n = loop.inputs.shape
    addresses = (array.ctypes.data for array in arrays.values())
    timestep = loop.plant.opt.timestep
    return (0, loop.substeps, n, samples, -1, timestep, loop.rate, loop.velocity_pole, *addresses)


@cache
def _callback(
    qpos: int, qvel: int, qfrc_applied: int, qfrc_bias: int, qfrc_passive: int, xfrc_applied: int
) -> Any:
    """The compiled mjcb_control for these offsets in mjData; numba's cache on disk is keyed by them."""

    @cfunc(types.void(types.int64, types.int64), cache=True)
    def control(model, data):  # type: ignore[no-untyped-def]
        # Each field of mjData is a pointer: its word holds the array's address.
        slot = carray(address_pointer(data + xfrc_applied), 1)[0]
        context = carray(_context_pointer(carray(address_pointer(slot), 1)[0]), 1)[0]
        n = context.joints
        closed_loop_step(
            context,
            model,
            data,
            carray(float_pointer(carray(address_pointer(data + qpos), 1)[0]), n),
            carray(float_pointer(carray(address_pointer(data + qvel), 1)[0]), n),
            carray(float_pointer(carray(address_pointer(data + qfrc_bias), 1)[0]), n),
            carray(float_pointer(carray(address_pointer(data + qfrc_passive), 1)[0]), n),
            carray(float_pointer(carray(address_pointer(data + qfrc_applied), 1)[0]), n),
        )

    return control


@kernel
def closed_loop_step(context, model, data, position, velocity, bias, passive, applied):  # type: ignore[no-untyped-def]
    """Set the applied torque of one physics step: drive less friction; at a tick, sense, control and log.

    context: record of CONTEXT. model, data: addresses. position to applied: (n,) fields of mjData.

    The steps v+ = v + h a(q), q+ = q + h v+ are those of the leapfrog q(t + h/2) = q(t) + h/2 v(t),
    v(t + h) = v(t) + h a(q(t + h/2)), ... (Hairer, Lubich & Wanner, "Geometric Numerical Integration",
    2006, ch. I.1.4) with MuJoCo's q half a step ahead of its v: q - h/2 v is the position at v's instant.
    Read as such, held torque and motion are aligned to second order in h, without it to half a step.
    """
    n = context.joints
    h = context.timestep
    constants = carray(float_pointer(context.constants), (CONSTANTS, n))
    memory = carray(float_pointer(context.memory), (MEMORIES, n))
    work = carray(float_pointer(context.work), (SCRATCH + 2 * n + 2, n))
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
    output = carray(float_pointer(context.outputs), (context.samples, OUTPUTS, n))[sample]
    for j in range(n):
        bus[j, rows.STEP], bus[j, rows.TIME], bus[j, rows.TIMESTEP] = context.step, context.step * h, h
    if tick:
        for j in range(n):
            output[LINK_POSITION, j] = output[POSITION, j] = position[j] - 0.5 * h * velocity[j]
            if constants[SPLIT, j] > 0.0:
                output[POSITION, j] = memory[MOTOR_POSITION, j] - 0.5 * h * memory[MOTOR_VELOCITY, j]
            bus[j, rows.READING] = output[POSITION, j]
            last_drive[j] = bus[j, rows.DRIVE]
            before[j] = memory[COULOMB_FRICTION, j]
        run_stage(Stage.ENCODER, context.hooks, context.edges)
        _control(context, sample, bus, constants, memory)
    _fill(bus, position, velocity, bias, passive, constants, memory)
    run_stage(Stage.DRIVE, context.hooks, context.edges)
    run_stage(Stage.FRICTION_LEVEL, context.hooks, context.edges)
    run_stage(Stage.FRICTION_STATE, context.hooks, context.edges)
    run_stage(Stage.TRANSMISSION, context.hooks, context.edges)
    run_stage(Stage.TORQUE, context.hooks, context.edges)
    coulomb = memory[COULOMB_FRICTION]
    for j in range(n):
        applied[j] = bus[j, rows.DRIVE] - bus[j, rows.VISCOUS] * bus[j, rows.VELOCITY]
        applied[j] += bus[j, rows.MOTOR_TORQUE] - bus[j, rows.SMOOTH_FRICTION]
        level[j] = bus[j, rows.COULOMB]
        if constants[SPLIT, j] > 0.0:
            level[j] = 0.0
            applied[j] = _move_motor(context, model, data, j, applied[j], bus, constants, memory, work)
        applied[j] += bus[j, rows.LINK_TORQUE]
        force[j] = applied[j] + passive[j] - bias[j]
        # The solution for the links overwrites it.
        bus[j, rows.FRICTION] = coulomb[j]
    coulomb_friction(model, data, h, velocity, force, level, coulomb, work[SCRATCH:])
    acceleration = work[SCRATCH + 1]
    for j in range(n):
        smooth = bus[j, rows.VISCOUS] * bus[j, rows.VELOCITY] + bus[j, rows.SMOOTH_FRICTION]
        if constants[SPLIT, j] > 0.0:
            coulomb[j] = bus[j, rows.FRICTION]
            bus[j, rows.LOAD] = applied[j] - bus[j, rows.LINK_TORQUE]
        else:
            applied[j] -= coulomb[j]
            rotor = constants[ARMATURE, j] * acceleration[j]
            bus[j, rows.LOAD] = bus[j, rows.DRIVE] + bus[j, rows.MOTOR_TORQUE] - smooth - coulomb[j] - rotor
        bus[j, rows.FRICTION] = smooth + coulomb[j]
    if tick:
        _log(context, model, data, output, velocity, bias, passive, bus, constants, memory, work)
    context.step += 1


@kernel
def _fill(bus, position, velocity, bias, passive, constants, memory):  # type: ignore[no-untyped-def]
    """Set the rows of the bus at their values before the hooks of this step."""
    for j in range(velocity.size):
        row = bus[j]
        row[rows.LINK_POSITION], row[rows.LINK_VELOCITY] = position[j], velocity[j]
        row[rows.POSITION] = position[j]
        speed = velocity[j]
        if constants[SPLIT, j] > 0.0:
            row[rows.POSITION] = memory[MOTOR_POSITION, j]
            speed = memory[MOTOR_VELOCITY, j]
        # Adams-Bashforth: the velocity half a step on, where the leapfrog takes its forces.
        row[rows.VELOCITY] = 1.5 * speed - 0.5 * memory[LAST_VELOCITY, j]
        memory[LAST_VELOCITY, j] = speed
        row[rows.STATIC_LOAD] = bias[j] - passive[j]
        row[rows.COMMAND] = row[rows.DRIVE] = memory[HELD_COMMAND, j]
        row[rows.VISCOUS], row[rows.COULOMB] = constants[VISCOUS, j], constants[COULOMB, j]
        row[rows.SMOOTH_FRICTION] = row[rows.MOTOR_TORQUE] = row[rows.LINK_TORQUE] = row[rows.HALF_GAP] = 0.0
        row[rows.STIFFNESS], row[rows.DAMPING] = (
            constants[CONTACT_STIFFNESS, j],
            constants[CONTACT_DAMPING, j],
        )


@kernel
def _move_motor(context, model, data, j, torque, bus, constants, memory, work):  # type: ignore[no-untyped-def]
    """Step the motor of a split joint under ``torque``; returns what its transmission carries."""
    h, inertia = context.timestep, constants[ARMATURE, j]
    unit, column = work[4], work[SCRATCH]
    unit[:] = 0.0
    unit[j] = 1.0
    solve_mass_matrix(model, data, column.ctypes.data, unit.ctypes.data, np.int32(1))
    speed = memory[MOTOR_VELOCITY, j]
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
    memory[COULOMB_FRICTION, j] = friction
    memory[MOTOR_VELOCITY, j] = speed + h / inertia * (torque - carried - friction)
    memory[MOTOR_POSITION, j] += h * memory[MOTOR_VELOCITY, j]
    return carried


@kernel
def _log(context, model, data, output, velocity, bias, passive, bus, constants, memory, work):  # type: ignore[no-untyped-def]
    """Write what happened at a tick: the truth at this instant."""
    n = context.joints
    load, before, last_drive = work[0], work[1], work[2]
    for j in range(n):
        split = constants[SPLIT, j] > 0.0
        # Torque and friction jump at a tick; the mean of both sides is what the mean torque brings about.
        drive = 0.5 * (last_drive[j] + bus[j, rows.DRIVE])
        speed = memory[LAST_VELOCITY, j]
        friction = bus[j, rows.VISCOUS] * speed + 0.5 * (before[j] + memory[COULOMB_FRICTION, j])
        friction += bus[j, rows.SMOOTH_FRICTION]
        load[j] = drive - friction
        load[j] += bus[j, rows.MOTOR_TORQUE]
        output[ACCELERATION, j] = (load[j] - bus[j, rows.LOAD]) / constants[ARMATURE, j] if split else 0.0
        load[j] = (bus[j, rows.LOAD] if split else load[j]) + bus[j, rows.LINK_TORQUE]
        load[j] = load[j] + passive[j] - bias[j]
        output[READING, j] = memory[LAST_READING, j]
        output[VELOCITY, j] = speed
        output[COMMAND, j] = memory[HELD_COMMAND, j]
        output[FRICTION, j] = friction
        output[DRIVE, j] = drive
        output[EFFECT_TORQUE, j] = bus[j, rows.MOTOR_TORQUE] + bus[j, rows.LINK_TORQUE]
    acceleration = work[4]
    solve_mass_matrix(model, data, acceleration.ctypes.data, load.ctypes.data, np.int32(1))
    for j in range(n):
        if not constants[SPLIT, j] > 0.0:
            output[ACCELERATION, j] = acceleration[j]


@kernel
def _control(context, sample, bus, constants, memory):  # type: ignore[no-untyped-def]
    """One tick: sample the encoders, estimate the velocity, and hold a new command."""
    row = carray(float_pointer(context.inputs), (context.samples, INPUTS, context.joints))[sample]
    pole = context.velocity_pole
    for j in range(context.joints):
        reading = encoder_reading(bus[j, rows.READING], row[POSITION_NOISE, j], constants[ENCODER_QUANTUM, j])
        if sample > 0:
            difference = (reading - memory[LAST_READING, j]) * context.rate
            memory[MEASURED_VELOCITY, j] = pole * memory[MEASURED_VELOCITY, j] + (1.0 - pole) * difference
        memory[LAST_READING, j] = reading
        memory[HELD_COMMAND, j] = pd_command(
            row[FEEDFORWARD, j],
            constants[KP, j],
            constants[KD, j],
            row[REFERENCE_POSITION, j] - reading,
            row[REFERENCE_VELOCITY, j] - memory[MEASURED_VELOCITY, j],
            constants[TORQUE_LIMIT, j],
        )


@kernel
def _freeze(context, position, velocity, bias, passive, applied):  # type: ignore[no-untyped-def]
    """Stop a loop that ran away before MuJoCo meets values it warns about, and remember when."""
    if context.failed_sample < 0:
        context.failed_sample = context.step // context.substeps
    for j in range(context.joints):
        position[j] = 0.0
        velocity[j] = 0.0
        applied[j] = bias[j] - passive[j]
