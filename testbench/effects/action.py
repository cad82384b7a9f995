"""How an effect acts in the simulated robot: compiled hooks at named stages of the physics step.

An effect's ``action(injection, robot)`` returns an ``Action``: hooks, a change of the plant, or that
its joint is split into motor and link. A hook is a kernel with its parameters and its own state:

    @hook_kernel
    def ripple(bus, parameters, state, joint):
        row, value = bus_row(bus, joint), vector(parameters, 3)
        row[MOTOR_TORQUE] -= value[0] * np.sin(value[1] * row[POSITION] + value[2])

The bus has a row a joint, filled anew before every physics step, save for what is marked kept. The
stages run in the order of ``Stage``, the hooks of a stage in the order in which the effects are
given. A kernel finds its state zero in the first step, where row[STEP] is 0; it sets it up there.
"""

import ctypes
from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property
from typing import Any

import numpy as np
from numba import carray, cfunc, njit, types
from numpy.typing import NDArray

from identification.errors import InputError

from ..native import float_pointer
from ..robot import Robot

Array = NDArray[np.float64]

BUS_ROWS = 21
(
    STEP,  # physics steps since the start
    TIME,  # s since the start
    TIMESTEP,  # s
    POSITION,  # rad, of the motor, scaled to the joint; the link's where the joint is rigid
    VELOCITY,  # rad/s, of the motor
    LINK_POSITION,  # rad
    LINK_VELOCITY,  # rad/s
    STATIC_LOAD,  # N·m that balance gravity, Coriolis and springs of the plant
    LOAD,  # N·m the gearbox carried in the last step; kept
    FRICTION,  # N·m of friction in the last step; kept
    COMMAND,  # N·m that the controller asks for
    DRIVE,  # N·m that the drive gives; starts as COMMAND
    VISCOUS,  # N·m·s/rad; starts as the plant's
    COULOMB,  # N·m, level of the set-valued friction; starts as the plant's; never below 0
    SMOOTH_FRICTION,  # N·m of friction beside VISCOUS and COULOMB; starts at 0
    MOTOR_TORQUE,  # N·m added to the drive behind its own limits; starts at 0
    LINK_TORQUE,  # N·m added at the link; starts at 0
    STIFFNESS,  # N·m/rad of the transmission; starts as that of a hard contact
    DAMPING,  # N·m·s/rad of the transmission; starts as that of a hard contact
    HALF_GAP,  # rad of play to each side; starts at 0
    READING,  # rad that the encoder sees before noise and quantisation; starts as POSITION
) = range(BUS_ROWS)


class Stage(IntEnum):
    """When a hook runs within a physics step, and which rows of the bus it may write.

    ENCODER, only in steps where the controller samples: READING; of the other rows only STEP, TIME,
    TIMESTEP and the kept ones are of this step. DRIVE: DRIVE. FRICTION_LEVEL: VISCOUS, COULOMB,
    SMOOTH_FRICTION. FRICTION_STATE: takes COULOMB over into SMOOTH_FRICTION. TRANSMISSION, of split
    joints: STIFFNESS, DAMPING, HALF_GAP. TORQUE: MOTOR_TORQUE, LINK_TORQUE.
    """

    ENCODER = 0
    DRIVE = 1
    FRICTION_LEVEL = 2
    FRICTION_STATE = 3
    TRANSMISSION = 4
    TORQUE = 5


HOOK_SIGNATURE = types.void(types.int64, types.int64, types.int64, types.int64)
_PROTOTYPE = ctypes.CFUNCTYPE(None, *[ctypes.c_int64] * 4)


class HookKernel:
    """A hook's function, compiled to a native address when that is first asked for."""

    def __init__(self, function: Callable[[Any, Any, Any, Any], None]):
        self.function = function

    @cached_property
    def _compiled(self) -> Any:
        return cfunc(HOOK_SIGNATURE, cache=True, nopython=True)(self.function)

    @property
    def address(self) -> int:
        """Where the native function lies."""
        return int(self._compiled.address)

    def __call__(self, bus: Array, parameters: Array, state: Array, joint: int) -> None:
        """Run it once from Python; bus is (n, BUS_ROWS), all arrays contiguous float64."""
        addresses = (array.ctypes.data for array in (bus, parameters, state))
        _PROTOTYPE(self.address)(*addresses, joint)


def hook_kernel(function: Callable[[Any, Any, Any, Any], None]) -> HookKernel:
    """Decorator of a hook: kernel(bus, parameters, state, joint), three addresses and an index."""
    return HookKernel(function)


@njit(inline="always")
def vector(address: int, size: int) -> Array:
    """The float64 array of that size at an address; shares its memory."""
    return carray(float_pointer(address), size)


@njit(inline="always")
def bus_row(bus: int, joint: int) -> Array:
    """A joint's row of the bus, (BUS_ROWS,), at the bus's address."""
    return carray(float_pointer(bus + 8 * BUS_ROWS * joint), BUS_ROWS)


@dataclass(frozen=True)
class Hook:
    """A kernel at its stage. joint: index. parameters, state: (p,) and (s,) float64; state is written."""

    stage: Stage
    kernel: HookKernel
    joint: int
    parameters: Array
    state: Array


def hook(stage: Stage, kernel: HookKernel, joint: int, parameters: Any = (), state: int = 0) -> Hook:
    """A hook with float64 parameters and a zero state of ``state`` numbers."""
    values = np.array(parameters, dtype=np.float64).ravel()
    return Hook(stage, kernel, joint, values, np.zeros(state))


@dataclass(frozen=True)
class Action:
    """What an effect does to the simulated robot; nothing when empty.

    hooks: in the order in which they run within a stage. change_plant: called once with the plant's
    own MjModel copy. split: joint whose motor and link move apart, or None. A split joint's rotor
    inertia, friction and encoder are on the motor side.
    """

    hooks: tuple[Hook, ...] = ()
    change_plant: Callable[[Any], None] | None = None
    split: int | None = None


@dataclass(frozen=True)
class SimulatedRobot:
    """What an effect may know of the robot that it is put into.

    robot: its model. timestep: s, of the physics. rate: Hz, of the controller.
    inertia: (n,) kg·m² (kg), each joint's own in the middle of the range, rotor included.
    """

    robot: Robot
    timestep: float
    rate: float
    inertia: Array


def require_joint(effect: str, joint: int | None, joints: int) -> int:
    """The joint. Raises InputError when an effect of one joint is given none, or one that is not there."""
    if joint is None or not 0 <= joint < joints:
        raise InputError("effects", effect, f"one of the robot's {joints} joints", joint)
    return joint
