"""The hooks of effects in the loop: their table for compiled code, and what they say of a robot at rest."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numba import carray
from numpy.typing import NDArray

from identification.kinematics import kernel

from ..effects.action import (
    BUS_ROWS,
    HALF_GAP,
    LINK_POSITION,
    LINK_TORQUE,
    MOTOR_TORQUE,
    POSITION,
    READING,
    STATIC_LOAD,
    STIFFNESS,
    TIMESTEP,
    Hook,
    Stage,
)
from ..native import address_pointer, call_address

Array = NDArray[np.float64]

STAGES = len(Stage)
# Columns of the table of hooks.
ENTRY = 5
# A wound-up transmission at rest: a contraction wherever stiffness grows with windup.
WINDUP_ITERATIONS = 60


def hook_table(hooks: Sequence[Hook], bus: Array) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Rows (H, ENTRY) of addresses to call, by stage, and where each stage's rows begin, (STAGES + 1,).

    bus: (n, BUS_ROWS). The hooks and the bus must outlive the table.
    """
    ordered = sorted(hooks, key=lambda hook: hook.stage)
    table = np.array(
        [
            (
                hook.kernel.address,
                bus.ctypes.data,
                hook.parameters.ctypes.data,
                hook.state.ctypes.data,
                hook.joint,
            )
            for hook in ordered
        ],
        dtype=np.int64,
    ).reshape(-1, ENTRY)
    edges = np.searchsorted([hook.stage for hook in ordered], np.arange(STAGES + 1))
    return table, edges.astype(np.int64)


@kernel
def run_stage(stage: Stage, table: int, edges: int) -> None:
    """Call the hooks of a stage; table, edges: addresses of what ``hook_table`` returns."""
    edge = carray(address_pointer(edges), STAGES + 1)
    first, last = edge[stage], edge[stage + 1]
    if first == last:
        return
    entry = carray(address_pointer(table), (last, ENTRY))
    for i in range(first, last):
        call_address(entry[i, 0], entry[i, 1], entry[i, 2], entry[i, 3], entry[i, 4])


class Standstill:
    """What the hooks say of the robot at rest, before the first step.

    hooks: of all effects. split: (n,) bool. contact_stiffness: (n,) N·m/rad. timestep: s.
    """

    def __init__(
        self, hooks: Sequence[Hook], split: NDArray[np.bool_], contact_stiffness: Array, timestep: float
    ):
        self.hooks, self.split = hooks, split
        self.contact_stiffness, self.timestep = contact_stiffness, timestep

    def torque(self, pose: Array, static_load: Array) -> Array:
        """Torque (n,) that the effects add at a link pose (n,)."""
        bus = self._bus(pose, pose, static_load)
        self._run(Stage.TORQUE, bus)
        return bus[:, MOTOR_TORQUE] + bus[:, LINK_TORQUE]

    def windup(self, pose: Array, torque: Array) -> Array:
        """Motor less link position (n,) where the transmissions carry ``torque`` (n,)."""
        windup = np.zeros_like(pose)
        if not self.split.any():
            return windup
        for _ in range(WINDUP_ITERATIONS):
            bus = self._bus(pose + windup, pose, torque)
            self._run(Stage.TRANSMISSION, bus)
            wound = torque / bus[:, STIFFNESS] + np.sign(torque) * bus[:, HALF_GAP]
            windup = np.where(self.split, wound, 0.0)
        return windup

    def reading(self, motor: Array, static_load: Array) -> Array:
        """What the encoders see, (n,), at a motor position (n,)."""
        bus = self._bus(motor, motor, static_load)
        self._run(Stage.ENCODER, bus)
        return bus[:, READING].copy()

    def _bus(self, motor: Array, link: Array, static_load: Array) -> Array:
        bus = np.zeros((len(motor), BUS_ROWS))
        bus[:, TIMESTEP] = self.timestep
        bus[:, POSITION], bus[:, LINK_POSITION], bus[:, READING] = motor, link, motor
        bus[:, STATIC_LOAD] = static_load
        bus[:, STIFFNESS] = self.contact_stiffness
        return bus

    def _run(self, stage: Stage, bus: Array) -> Any:
        for hook in self.hooks:
            if hook.stage == stage:
                # The state stays as the first step is to find it.
                hook.kernel(bus, hook.parameters, hook.state.copy(), hook.joint)
