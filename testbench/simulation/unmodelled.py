"""The effects of one run put together: hooks, split joints, and what they change of the plant."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import mujoco
import numpy as np
from numpy.typing import NDArray

from identification.errors import InputError
from identification.parameters import ARMATURE, PER_JOINT

from ..effects import effect
from ..effects.action import Action, Hook, SimulatedRobot, Stage
from ..effects.base import Injection
from ..robot import Robot
from .controller import diagonal_inertia, middle_pose
from .hooks import Standstill
from .transmission import CONTACT_DAMPING_RATIO, CONTACT_FREQUENCY

Array = NDArray[np.float64]


class Acting(Protocol):
    """What the simulation asks of an effect."""

    def action(self, injection: Injection, simulated: SimulatedRobot) -> Action:
        """How it acts in the simulated robot."""
        ...


@dataclass(frozen=True)
class Unmodelled:
    """What the loop needs of the effects; each array (n,).

    hooks: with a state of their own. split: joints whose motor and link move apart. armature: kg·m².
    stiffness, damping: N·m/rad and N·m·s/rad of a transmission that no effect says more about.
    """

    hooks: tuple[Hook, ...]
    split: NDArray[np.bool_]
    armature: Array
    stiffness: Array
    damping: Array
    timestep: float

    @property
    def standstill(self) -> Standstill:
        """What the effects do to the robot at rest."""
        return Standstill(self.hooks, self.split, self.stiffness, self.timestep)


def put_in(
    injections: Sequence[Injection],
    robot: Robot,
    plant: Any,
    timestep: float,
    rate: float,
    beside: Mapping[str, Acting] | None = None,
) -> Unmodelled:
    """Put effects into a plant, which is changed; timestep: s, of the physics. rate: Hz, of control.

    beside: effects that are in no catalogue, by name. Raises InputError for a name that is in neither, and
    for a split joint without rotor inertia.
    """
    n = robot.joints
    armature = robot.parameters.reshape(-1, PER_JOINT)[:n, ARMATURE].copy()
    split = np.zeros(n, dtype=bool)
    hooks: list[Hook] = []
    if injections:
        middle = middle_pose(robot.limits.lower, robot.limits.upper)
        inertia = diagonal_inertia(robot.chain, robot.parameters, middle)
        simulated = SimulatedRobot(robot, timestep, rate, inertia)
        for injection in injections:
            acting = (beside or {}).get(injection.effect) or effect(injection.effect)
            action = acting.action(injection, simulated)
            hooks += action.hooks
            if action.change_plant is not None:
                action.change_plant(plant)
            if action.split is not None:
                split[action.split] = True
    for joint in np.flatnonzero(split & (armature <= 0)):
        expected = "a rotor inertia (armature) that can move apart from the link"
        raise InputError("effects", robot.joint_names[joint], expected, armature[joint])
    # A rigid joint has no transmission to act on.
    kept = tuple(hook for hook in hooks if hook.stage is not Stage.TRANSMISSION or split[hook.joint])
    if split.any():
        plant.dof_armature[split[robot.chain.leaders]] = 0.0
        # MuJoCo keeps the inertia of a joint with nothing behind it, rotor included, as a constant.
        mujoco.mj_setConst(plant, mujoco.MjData(plant))
    frequency = 2 * np.pi * CONTACT_FREQUENCY
    return Unmodelled(
        hooks=kept,
        split=split,
        armature=armature,
        stiffness=frequency**2 * armature,
        damping=2 * CONTACT_DAMPING_RATIO * frequency * armature,
        timestep=timestep,
    )


def described(injection: Injection, robot: Robot) -> dict[str, Any]:
    """An injection as the truth of a log states it, JSON-able."""
    joints = {
        key: None if joint is None else robot.joint_names[joint]
        for key, joint in (("joint", injection.joint), ("into", injection.into))
    }
    return {"effect": injection.effect, **joints, "law": injection.law, "values": dict(injection.values)}
