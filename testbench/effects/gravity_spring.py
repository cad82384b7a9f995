"""Gravity spring: a counterbalance whose torque is a sine of the joint's position."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.kinematics import kernel

from ..robot import Robot
from .action import (
    LINK_POSITION,
    LINK_TORQUE,
    Action,
    SimulatedRobot,
    Stage,
    bus_row,
    hook,
    hook_kernel,
    require_joint,
    vector,
)
from .base import EffectDescription, EffectParameter, Injection, Scope
from .columns import on_one_joint
from .experiment import Experiment
from .fitted_effect import FittedEffect, times
from .passive_device import passive_device
from .signature import Family, Logged, Member, Quantity, amplitude_and_phase, coefficients_as_named
from .size import scale_of

Array = NDArray[np.float64]

DESCRIPTION = EffectDescription(
    name="gravity_spring",
    title="Gravity spring",
    law="stiffness·sin(phase - q) added to the drive; gas_spring: a constant force between anchors at "
    "radius 1 and 1/2, stiffness·sin(phase - q)·0.5 / sqrt(1.25 - cos(phase - q))",
    reference='Swevers, Verdonck & De Schutter, "Dynamic model identification for industrial robots", IEEE '
    "Control Systems 27(5), 2007",
    scope=Scope.JOINT,
    parameters=(
        EffectParameter("stiffness", "N·m", 0.0, np.inf, (0.1, 0.6), "gravity"),
        EffectParameter("phase", "rad", -2 * np.pi, 2 * np.pi, (0.0, 1.0)),
    ),
    laws=("sine", "gas_spring"),
    confused_with=("cable_spring", "payload", "encoder_offset", "base_tilt"),
    shown_by=(Experiment.WHOLE_RANGE,),
    of_position=True,
    loads=True,
    hinges_only=True,
)

SINE, GAS_SPRING = DESCRIPTION.laws
# Phases at which a gas spring is tried.
PHASES = 24
# Of a gas spring's torque as a sum of sines: what comes after leaves 2 % of it.
HARMONICS = 4
# A spring that holds less than this share of the Coulomb friction may be any cable.
OF_COULOMB = 0.1


def action(injection: Injection, simulated: SimulatedRobot) -> Action:
    """A torque on the link."""
    joint = require_joint(DESCRIPTION.name, injection.joint, simulated.robot.joints)
    values = [injection.values[name] for name in ("stiffness", "phase")]
    return Action((hook(Stage.TORQUE, _spring, joint, [*values, injection.law == GAS_SPRING]),))


@kernel
def _lever(angle: Any) -> Any:
    """Lever arm of a force between anchors at radius 1 and 1/2, by the angle between them, rad."""
    return 0.5 * np.sin(angle) / np.sqrt(1.25 - np.cos(angle))


@hook_kernel
def _spring(bus: int, parameters: int, state: int, joint: int) -> None:
    row, value = bus_row(bus, joint), vector(parameters, 3)
    angle = value[1] - row[LINK_POSITION]
    row[LINK_TORQUE] += value[0] * (_lever(angle) if value[2] > 0.0 else np.sin(angle))


def signature(runs: Sequence[Logged], joint: int | None, into: int | None) -> Family:
    """sin q and cos q, as -stiffness·sin(phase - q) = stiffness·sin(q - phase); gas springs by phase."""
    joint = require_joint(DESCRIPTION.name, joint, runs[0].joints)
    waves = on_one_joint(
        runs, lambda run: np.column_stack([np.cos(run.q[:, joint]), np.sin(run.q[:, joint])])
    )
    free = np.full(2, np.inf)
    sine = Member({}, (joint,), waves, -free, free)

    def gas_spring(shape: Mapping[str, float]) -> Member:
        levers = on_one_joint(runs, lambda run: -_lever(shape["phase"] - run.q[:, [joint]]))
        return Member(dict(shape), (joint,), levers, np.zeros(1), np.full(1, np.inf), GAS_SPRING)

    phases = np.linspace(-np.pi, np.pi, PHASES, endpoint=False)
    return Family(
        effect=DESCRIPTION.name,
        joint=joint,
        members=(sine, *(gas_spring({"phase": float(phase)}) for phase in phases)),
        parameters=_parameters,
        refine={"phase": (-2 * np.pi, 2 * np.pi)},
        member=gas_spring,
        swallowed=True,
    )


def _parameters(member: Member, c: Array, covariance: Array) -> dict[str, Quantity]:
    if member.law == GAS_SPRING:
        return coefficients_as_named(DESCRIPTION, ("stiffness",))(member, c, covariance)
    stiffness, stiffness_std, phase, phase_std = amplitude_and_phase(
        float(c[0]), float(c[1]), covariance[:2, :2]
    )
    return {
        "stiffness": Quantity(stiffness, stiffness_std, "N·m"),
        "phase": Quantity(-phase, phase_std, "rad"),
    }


def size(fitted: FittedEffect) -> float:
    """Its stiffness as a multiple of a mild one, which holds a share of the Coulomb friction at least."""
    least = OF_COULOMB * scale_of("coulomb", fitted.robot, fitted.joint)
    return times(fitted.value("stiffness"), max(fitted.mild("stiffness"), least))


def write(spec: Any, robot: Robot, injection: Injection) -> tuple[str, ...]:
    """The cogging torque of a passive dcmotor with one cycle a revolution; a gas spring's overtones too."""
    joint = require_joint(DESCRIPTION.name, injection.joint, robot.joints)
    stiffness, phase = (injection.values[name] for name in ("stiffness", "phase"))
    if injection.law == SINE:
        passive_device(spec, robot, joint, "spring", cogging=(stiffness, 1.0, np.pi - phase))
        return ()
    angles = np.linspace(-np.pi, np.pi, 360, endpoint=False)
    for cycles in range(1, HARMONICS + 1):
        share = 2 * float(np.mean(_lever(angles) * np.sin(cycles * angles)))
        cogging = (share * stiffness, float(cycles), np.pi - cycles * phase)
        passive_device(spec, robot, joint, "spring", cogging=cogging)
    return (f"the gas spring's torque is a sum of {HARMONICS} sines",)
