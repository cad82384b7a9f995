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

from .controller import pd_command
from .friction import coulomb_friction
from .mujoco_pointers import (
    address_pointer,
    check_offsets,
    data_offsets,
    float_pointer,
    installed_control,
    pointer_to,
    solve_mass_matrix,
)
from .sensors import encoder_reading

Array = NDArray[np.float64]

# No arm turns this fast (rad/s, m/s): the loop is unstable.
RUNAWAY_SPEED = 1e5

# Rows of the arrays that the context points at; the last axis is the joint.
CONSTANTS = 6
VISCOUS, COULOMB, KP, KD, TORQUE_LIMIT, ENCODER_QUANTUM = range(CONSTANTS)
INPUTS = 4
REFERENCE_POSITION, REFERENCE_VELOCITY, FEEDFORWARD, POSITION_NOISE = range(INPUTS)
OUTPUTS = 6
READING, POSITION, VELOCITY, ACCELERATION, COMMAND, FRICTION = range(OUTPUTS)
MEMORIES = 6
LAST_READING, MEASURED_VELOCITY, DRIVE, LAST_DRIVE, COULOMB_FRICTION, LAST_VELOCITY = range(MEMORIES)

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
    ]
)
_context_pointer = pointer_to(numba.from_dtype(CONTEXT))


@dataclass(frozen=True)
class Loop:
    """One closed loop to run: N samples, n joints, SI units at the joint.

    plant: its MuJoCo model. substeps: physics steps a control period. rate: Hz, of the controller.
    velocity_pole: of its velocity filter. constants: (CONSTANTS, n). inputs: (N, INPUTS, n).
    pose: (n,) at the start, at rest. hold: (n,) drive torque before the start.
    """

    plant: Any
    substeps: int
    rate: float
    velocity_pole: float
    constants: Array
    inputs: Array
    pose: Array
    hold: Array


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


def _arrays(loop: Loop) -> dict[str, Array]:
    """The arrays a context points at."""
    samples, _, n = loop.inputs.shape
    memory = np.zeros((MEMORIES, n))
    memory[[DRIVE, LAST_DRIVE]] = loop.hold
    return {
        "constants": np.ascontiguousarray(loop.constants),
        "inputs": np.ascontiguousarray(loop.inputs),
        "outputs": np.zeros((samples, OUTPUTS, n)),
        "memory": memory,
        "work": np.zeros((2 * n + 4, n)),
    }


def _context(loop: Loop, arrays: dict[str, Array]) -> tuple[Any, ...]:
    """A row of CONTEXT."""
    samples, _, n = loop.inputs.shape
    addresses = (arrays[name].ctypes.data for name in ("constants", "inputs", "outputs", "memory", "work"))
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
    constants = carray(float_pointer(context.constants), (CONSTANTS, n))
    memory = carray(float_pointer(context.memory), (MEMORIES, n))
    work = carray(float_pointer(context.work), (2 * n + 4, n))
    force, before = work[0], work[1]
    runaway = context.failed_sample >= 0
    for j in range(n):
        runaway = runaway or not abs(velocity[j]) < RUNAWAY_SPEED
    if runaway:
        _freeze(context, position, velocity, bias, passive, applied)
        return
    sample = context.step // context.substeps
    tick = context.step % context.substeps == 0
    output = carray(float_pointer(context.outputs), (context.samples, OUTPUTS, n))[sample]
    if tick:
        for j in range(n):
            output[POSITION, j] = position[j] - 0.5 * context.timestep * velocity[j]
            memory[LAST_DRIVE, j] = memory[DRIVE, j]
            before[j] = memory[COULOMB_FRICTION, j]
        _control(context, sample, output[POSITION], constants, memory)
    for j in range(n):
        # Adams-Bashforth: the velocity half a step on, where the leapfrog takes its forces.
        midway = 1.5 * velocity[j] - 0.5 * memory[LAST_VELOCITY, j]
        memory[LAST_VELOCITY, j] = velocity[j]
        applied[j] = memory[DRIVE, j] - constants[VISCOUS, j] * midway
        force[j] = applied[j] + passive[j] - bias[j]
    coulomb = memory[COULOMB_FRICTION]
    coulomb_friction(model, data, context.timestep, velocity, force, constants[COULOMB], coulomb, work[2:])
    for j in range(n):
        applied[j] -= coulomb[j]
    if tick:
        load, acceleration = work[0], output[ACCELERATION]
        for j in range(n):
            # Torque and friction jump at a tick; the mean of both sides is what the mean torque brings about.
            drive = 0.5 * (memory[LAST_DRIVE, j] + memory[DRIVE, j])
            friction = constants[VISCOUS, j] * velocity[j] + 0.5 * (before[j] + coulomb[j])
            load[j] = drive - friction + passive[j] - bias[j]
            output[READING, j] = memory[LAST_READING, j]
            output[VELOCITY, j] = velocity[j]
            output[COMMAND, j] = memory[DRIVE, j]
            output[FRICTION, j] = friction
        solve_mass_matrix(model, data, acceleration.ctypes.data, load.ctypes.data, np.int32(1))
    context.step += 1


@kernel
def _control(context, sample, position, constants, memory):  # type: ignore[no-untyped-def]
    """One tick: read the encoders, estimate the velocity, and hold a new drive torque."""
    row = carray(float_pointer(context.inputs), (context.samples, INPUTS, context.joints))[sample]
    pole = context.velocity_pole
    for j in range(context.joints):
        reading = encoder_reading(position[j], row[POSITION_NOISE, j], constants[ENCODER_QUANTUM, j])
        if sample > 0:
            difference = (reading - memory[LAST_READING, j]) * context.rate
            memory[MEASURED_VELOCITY, j] = pole * memory[MEASURED_VELOCITY, j] + (1.0 - pole) * difference
        memory[LAST_READING, j] = reading
        memory[DRIVE, j] = pd_command(
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
