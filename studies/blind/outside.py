"""Effects that are physical and in no catalogue, at one joint of the simulated robot.

They act by the same hooks as those of the catalogue, where a simulation is handed them; the diagnosis knows
nothing of them.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from testbench.effects.action import (
    COULOMB,
    MOTOR_TORQUE,
    POSITION,
    TIME,
    TIMESTEP,
    VELOCITY,
    Action,
    HookKernel,
    SimulatedRobot,
    Stage,
    bus_row,
    hook,
    hook_kernel,
    require_joint,
    vector,
)
from testbench.effects.base import Injection
from testbench.simulation import Reference

Array = NDArray[np.float64]

# Time constant of the acceleration that friction follows, s, and where it stops growing.
ACCELERATION_LAG, HIGHEST_ACCELERATION = 0.01, 2.0
# A detent acts in a small part of the range only, so it is so much higher.
DETENT_HEIGHT = 3.0
# Hz, of what shakes a joint from outside.
SHAKEN = (3.0, 14.0)


@dataclass(frozen=True)
class OutsideEffect:
    """An effect that is in no catalogue: its kernel takes the injection's values in their order.

    state: numbers that the kernel keeps.
    """

    stage: Stage
    kernel: HookKernel
    state: int = 0

    def action(self, injection: Injection, simulated: SimulatedRobot) -> Action:
        """One hook at the injection's joint."""
        joint = require_joint(injection.effect, injection.joint, simulated.robot.joints)
        return Action((hook(self.stage, self.kernel, joint, list(injection.values.values()), self.state),))


@hook_kernel
def _position_friction(bus: int, parameters: int, state: int, joint: int) -> None:
    row, value = bus_row(bus, joint), vector(parameters, 3)
    row[COULOMB] += value[0] * (1.0 + np.sin(value[1] * row[POSITION] + value[2]))


@hook_kernel
def _neighbour_friction(bus: int, parameters: int, state: int, joint: int) -> None:
    row, value = bus_row(bus, joint), vector(parameters, 3)
    row[COULOMB] += value[0] * abs(bus_row(bus, int(value[1]))[VELOCITY]) / value[2]


@hook_kernel
def _offset_drift(bus: int, parameters: int, state: int, joint: int) -> None:
    row, value = bus_row(bus, joint), vector(parameters, 2)
    row[MOTOR_TORQUE] += value[0] * (1.0 - np.exp(-row[TIME] / value[1]))


@hook_kernel
def _acceleration_friction(bus: int, parameters: int, state: int, joint: int) -> None:
    row, value, memory = bus_row(bus, joint), vector(parameters, 2), vector(state, 2)
    change = (row[VELOCITY] - memory[0]) / row[TIMESTEP] - memory[1]
    memory[0] = row[VELOCITY]
    memory[1] += row[TIMESTEP] / ACCELERATION_LAG * change
    row[COULOMB] += value[0] * min(abs(memory[1]) / value[1], HIGHEST_ACCELERATION)


@hook_kernel
def _detent(bus: int, parameters: int, state: int, joint: int) -> None:
    row, value = bus_row(bus, joint), vector(parameters, 3)
    row[COULOMB] += value[0] * np.exp(-(((row[POSITION] - value[1]) / value[2]) ** 2))


@hook_kernel
def _quadratic_coupling(bus: int, parameters: int, state: int, joint: int) -> None:
    row, value = bus_row(bus, joint), vector(parameters, 4)
    own, other = row[VELOCITY] / value[2], bus_row(bus, int(value[1]))[VELOCITY] / value[3]
    row[MOTOR_TORQUE] -= value[0] * own * own * other


@hook_kernel
def _slack_hose(bus: int, parameters: int, state: int, joint: int) -> None:
    row, value = bus_row(bus, joint), vector(parameters, 3)
    row[MOTOR_TORQUE] -= value[0] * max(row[POSITION] - value[1], 0.0) / value[2]


@hook_kernel
def _friction_jump(bus: int, parameters: int, state: int, joint: int) -> None:
    row, value = bus_row(bus, joint), vector(parameters, 2)
    if row[TIME] >= value[1]:
        row[COULOMB] += value[0]


@hook_kernel
def _vibration(bus: int, parameters: int, state: int, joint: int) -> None:
    row, value = bus_row(bus, joint), vector(parameters, 3)
    row[MOTOR_TORQUE] -= value[0] * np.sin(2 * np.pi * value[1] * row[TIME] + value[2])


OUTSIDE = {
    "position_dependent_friction": OutsideEffect(Stage.FRICTION_LEVEL, _position_friction),
    "neighbour_dependent_friction": OutsideEffect(Stage.FRICTION_LEVEL, _neighbour_friction),
    "torque_offset_drift": OutsideEffect(Stage.TORQUE, _offset_drift),
    "acceleration_dependent_friction": OutsideEffect(Stage.FRICTION_LEVEL, _acceleration_friction, state=2),
    "detent_friction": OutsideEffect(Stage.FRICTION_LEVEL, _detent),
    "quadratic_velocity_coupling": OutsideEffect(Stage.TORQUE, _quadratic_coupling),
    "slack_hose": OutsideEffect(Stage.TORQUE, _slack_hose),
    "friction_jump": OutsideEffect(Stage.FRICTION_LEVEL, _friction_jump),
    "vibration": OutsideEffect(Stage.TORQUE, _vibration),
}


def outside_values(
    name: str, size: float, joint: int, references: Sequence[Reference], rng: np.random.Generator
) -> dict[str, float]:
    """Parameters of an outside effect whose torque is about ``size``, N·m, along the references."""
    position, velocity, acceleration = (
        np.concatenate([getattr(reference, channel) for reference in references])
        for channel in ("position", "velocity", "acceleration")
    )
    joints = position.shape[1]
    neighbour = joint - 1 if joint > 0 else min(1, joints - 1)
    q = position[:, joint]
    speed, other, change = (
        max(float(np.sqrt(np.mean(x**2))), 1e-6)
        for x in (velocity[:, joint], velocity[:, neighbour], acceleration[:, joint])
    )
    span = max(float(np.ptp(q)), 1e-6)
    near = float(rng.uniform(*np.quantile(q, [0.2, 0.8])))
    drawn: dict[str, dict[str, float]] = {
        "position_dependent_friction": {
            "size": size,
            "cycles": 2 * np.pi * rng.uniform(1.0, 4.0) / span,
            "phase": rng.uniform(-np.pi, np.pi),
        },
        "neighbour_dependent_friction": {"size": size, "neighbour": neighbour, "speed": other},
        "torque_offset_drift": {
            "size": float(rng.choice((-1.0, 1.0))) * size,
            "time_constant": rng.uniform(2.0, 6.0),
        },
        "acceleration_dependent_friction": {"size": size, "acceleration": change},
        "detent_friction": {
            "size": DETENT_HEIGHT * size,
            "position": near,
            "width": span * rng.uniform(0.02, 0.08),
        },
        "quadratic_velocity_coupling": {
            "size": size,
            "neighbour": neighbour,
            "speed": speed,
            "neighbour_speed": other,
        },
        "slack_hose": {
            "size": size,
            "position": near,
            "range": max(float(np.sqrt(np.mean(np.maximum(q - near, 0.0) ** 2))), 1e-6),
        },
        "friction_jump": {"size": size, "start": rng.uniform(2.0, 6.0)},
        "vibration": {
            "size": np.sqrt(2) * size,
            "frequency": rng.uniform(*SHAKEN),
            "phase": rng.uniform(-np.pi, np.pi),
        },
    }
    return {key: float(value) for key, value in drawn[name].items()}
