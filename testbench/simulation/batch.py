"""Many closed loops stepped at once, each with its context.

Each simulation has a context block: counters, constants, and the addresses of its arrays. The
callback finds the block through the force slot of the world body (``xfrc_applied[0]``), which is part
of each simulation's state and which MuJoCo never reads, so any compiled model runs unchanged.
"""

import os
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

import mujoco
import numpy as np
from mujoco.batch import Batch, SimulationError
from numpy.typing import NDArray

from identification.errors import InputError
from identification.followers import Followers

from ..effects import action as rows
from ..effects.action import Hook
from . import layout
from .hooks import hook_table
from .led import led_memory
from .mujoco_pointers import check_offsets, data_offsets, installed_control
from .step import RUNAWAY_SPEED, loop_callback

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Loop:
    """One closed loop to run: N samples, n joints, SI units at the joint.

    plant: its MuJoCo model. substeps: physics steps a control period. rate: Hz, of the controller.
    velocity_pole: of its velocity filter. constants: (CONSTANTS, n). inputs: (N, INPUTS, n).
    pose: (n,) of the links at the start, at rest. hold: (n,) drive torque before the start.
    windup: (n,) motor less link position at the start. hooks: of the effects. followers: the plant's joints
    that follow those n.
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
    followers: Followers | None = None

    @property
    def start(self) -> Array:
        """Positions of all the plant's joints at the start."""
        return self.pose if self.followers is None else self.followers.positions(self.pose)


def run_loops(loops: Sequence[Loop], threads: int | None) -> list[Array]:
    """Outputs of each loop at each sample, (N, OUTPUTS, n); they do not depend on ``threads``.

    Raises InputError when the models cannot share a batch or a loop runs away.
    """
    batch = _batch(loops, threads)
    arrays = [_arrays(loop) for loop in loops]
    contexts = np.zeros(len(loops), layout.CONTEXT)
    slots = batch.bind("xfrc_applied")
    for index, loop in enumerate(loops):
        contexts[index] = _context(loop, arrays[index])
        slots.view(np.int64)[index, 0, 0] = contexts.ctypes.data + index * layout.CONTEXT.itemsize
        batch.bind("qpos")[index] = loop.start
    # One step more than there are periods: it logs the last sample.
    steps = np.array([(len(loop.inputs) - 1) * loop.substeps + 1 for loop in loops])
    offsets = data_offsets()
    check_offsets(offsets, mujoco.MjData(loops[0].plant))
    callback = loop_callback(*(getattr(offsets, field.name) for field in fields(offsets)))
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
    memory = np.zeros((layout.MEMORIES, n))
    memory[layout.HELD_COMMAND], memory[layout.MOTOR_POSITION] = loop.hold, loop.pose + loop.windup
    bus = np.zeros((n, rows.BUS_ROWS))
    bus[:, rows.DRIVE] = bus[:, rows.LOAD] = loop.hold
    table, edges = hook_table(loop.hooks, bus)
    return {
        "constants": np.ascontiguousarray(loop.constants),
        "inputs": np.ascontiguousarray(loop.inputs),
        "outputs": np.zeros((samples, layout.OUTPUTS, n)),
        "memory": memory,
        "work": np.zeros((layout.SCRATCH + 2 * n + 2, n)),
        "bus": bus,
        "hooks": table,
        "edges": edges,
        "led": led_memory(loop.followers),
    }


def _context(loop: Loop, arrays: dict[str, Any]) -> tuple[Any, ...]:
    """A row of CONTEXT."""
    samples, _, n = loop.inputs.shape
    addresses = (array.ctypes.data if array.size else 0 for array in arrays.values())
    timestep = loop.plant.opt.timestep
    head = (0, loop.substeps, n, samples, -1, timestep, loop.rate, loop.velocity_pole)
    return (*head, *addresses, len(loop.start))
