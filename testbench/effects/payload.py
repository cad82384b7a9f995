"""Payload: a body on the flange that the model does not know."""

from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from identification.chain import Chain
from identification.parameters import INERTIAL, MASS, PER_JOINT
from identification.regressor import regressor

from ..robot import Robot
from .action import Action, SimulatedRobot
from .base import EffectDescription, EffectParameter, Injection, Scope
from .columns import ColumnsByInstant
from .experiment import Experiment
from .fitted_effect import FittedEffect, times
from .signature import Family, Logged, Member, Quantity

Array = NDArray[np.float64]

DESCRIPTION = EffectDescription(
    name="payload",
    title="Payload",
    law="ten inertial parameters added to the last body: sphere, a solid ball of aluminium about the "
    "centre first_moment / mass; point, all mass at the centre",
    reference='Khalil, Gautier & Lemoine, "Identification of the payload inertial parameters of '
    'industrial manipulators", ICRA 2007',
    scope=Scope.ROBOT,
    parameters=(
        EffectParameter("mass", "kg", 0.0, 1000.0, (0.5, 7.0)),
        EffectParameter("first_moment_x", "kg·m", -100.0, 100.0, (0.0, 0.15)),
        EffectParameter("first_moment_y", "kg·m", -100.0, 100.0, (0.0, -0.1)),
        EffectParameter("first_moment_z", "kg·m", -100.0, 100.0, (0.03, 0.7)),
    ),
    laws=("sphere", "point"),
    confused_with=("torque_gain_error", "encoder_offset"),
    shown_by=(Experiment.KNOWN_LOAD,),
    of_last_link=True,
    relinearised=True,
    # Of one that turns about a vertical axis alone the mass may stay open.
    known_by=("first_moment",),
)
DENSITY = 2700.0
MOMENTS = ("first_moment_x", "first_moment_y", "first_moment_z")
# XX .. ZZ of the ten, kg·m², are bounded by a payload that reaches this far, m.
REACH = 1.0
# Deviations: of the mass as a share of all links', of a tool's centre as a share of the arm's length.
OF_THE_LINKS, OF_THE_LENGTH = 1.0, 0.5
# m; an arm of one joint has no length between joints.
SHORTEST = 0.5
# A kilogram is much on a small arm: there a mild mass is this share of the last link's, or of the heaviest's
# hundredth where the model has next to nothing last.
OF_LAST_LINK, OF_HEAVIEST = 0.45, 0.01
# A tool's centre is no farther from the last joint than this share of the arm's length.
TOOL_REACH = 0.4


def centre_and_inertia(injection: Injection) -> tuple[float, Array, float]:
    """Mass kg, centre (3,) m in the last body's frame, and inertia kg·m² about any axis through it."""
    mass = injection.values["mass"]
    centre = np.array([injection.values[name] for name in MOMENTS]) / mass
    radius = 0.0 if injection.law == "point" else (3 * mass / (4 * np.pi * DENSITY)) ** (1 / 3)
    return mass, centre, 0.4 * mass * radius**2


def action(injection: Injection, simulated: SimulatedRobot) -> Action:
    """The last body's mass, centre and inertia in the plant; nothing without mass."""
    if injection.values["mass"] == 0.0:
        return Action()
    mass, centre, inertia = centre_and_inertia(injection)

    def load(plant: Any) -> None:
        body = int(plant.jnt_bodyid[-1])
        flat = np.empty(9)
        mujoco.mju_quat2Mat(flat, plant.body_iquat[body])
        axes = flat.reshape(3, 3)
        own_mass, own_centre = float(plant.body_mass[body]), np.array(plant.body_ipos[body])
        total = own_mass + mass
        common = (own_mass * own_centre + mass * centre) / total
        tensor = axes @ np.diag(plant.body_inertia[body]) @ axes.T + inertia * np.eye(3)
        for part, arm in ((own_mass, own_centre - common), (mass, centre - common)):
            tensor += part * (arm @ arm * np.eye(3) - np.outer(arm, arm))
        moments, directions = np.linalg.eigh(tensor)
        if np.linalg.det(directions) < 0:
            directions[:, 0] *= -1
        plant.body_mass[body], plant.body_ipos[body], plant.body_inertia[body] = total, common, moments
        mujoco.mju_mat2Quat(plant.body_iquat[body], directions.ravel())
        # What the compiler saw of the body's own inertia to save work no longer holds.
        plant.body_sameframe[body] = mujoco.mjtSameFrame.mjSAMEFRAME_NONE
        plant.body_simple[body] = 0
        plant.dof_simplenum[:] = 0
        mujoco.mj_setConst(plant, mujoco.MjData(plant))

    return Action(change_plant=load)


def signature(runs: Sequence[Logged], joint: int | None, into: int | None) -> Family:
    """The ten inertial columns of the last link: the base parameters swallow them.

    It shows as the shift of the parameters from the nominal ones along these ten; c is in the order
    of the standard parameters, in the last link's frame. What no joint feels, as a height above parallel
    axes, is held at zero.
    """
    n = runs[0].joints
    ten = PER_JOINT * runs[0].chain.last + np.arange(INERTIAL)
    bounds = np.array([DESCRIPTION.parameters[0].upper] * INERTIAL) * REACH
    columns = ColumnsByInstant(runs, lambda run: regressor(run.chain, run.q, run.dq, run.ddq, ten))
    felt = columns.largest() > 0
    member = Member(
        shape={},
        rows=tuple(range(n)),
        columns=columns,
        lower=np.where(felt & ~np.isin(np.arange(INERTIAL), (0, 3, 5, 9)), -bounds, 0.0),
        upper=np.where(felt, bounds, 0.0),
        widths=_widths(runs[0]),
    )

    def parameters(member: Member, c: Array, covariance: Array) -> dict[str, Quantity]:
        of_ten = covariance[:INERTIAL, :INERTIAL] + np.diag(np.where(felt, 0.0, bounds**2))
        # From the link's frame, which the columns are in, to the body's, which the contract wants.
        turn = np.zeros((4, INERTIAL))
        turn[0, 9] = 1.0
        turn[1:, 6:9] = runs[0].body_rotation.T
        turn[1:, 9] = -runs[0].body_rotation.T @ runs[0].body_origin
        values = turn @ c
        std = np.sqrt(np.maximum(np.diag(turn @ of_ten @ turn.T), 0.0))
        return {
            "mass": Quantity(float(values[0]), float(std[0]), "kg"),
            "first_moment": Quantity(
                tuple(float(value) for value in values[1:]), tuple(float(d) for d in std[1:]), "kg·m"
            ),
        }

    return Family(DESCRIPTION.name, None, (member,), parameters, swallowed=True)


def _widths(run: Logged) -> Array:
    """Deviations (10,) of a tool's inertial parameters in the last link's frame, kg·m², kg·m, kg."""
    mass = OF_THE_LINKS * float(run.nominal.reshape(-1, PER_JOINT)[:, MASS].sum())
    lever = OF_THE_LENGTH * arm_length(run.chain)
    return np.repeat([mass * lever**2, mass * lever, mass], (6, 3, 1))


def arm_length(chain: Chain) -> float:
    """Length of the arm along its joints' anchors, m, from the first on; SHORTEST at least."""
    return max(float(np.linalg.norm(chain.tree.translation[1:], axis=1).sum()), SHORTEST)


def size(fitted: FittedEffect) -> float:
    """Its mass as a multiple of a mild one on this arm."""
    masses = fitted.robot.parameters.reshape(-1, PER_JOINT)[:, MASS]
    last, heaviest = float(masses[fitted.robot.chain.last]), float(masses.max())
    return times(
        fitted.value("mass"), min(fitted.mild("mass"), OF_LAST_LINK * max(last, OF_HEAVIEST * heaviest))
    )


def is_plausible(fitted: FittedEffect) -> bool:
    """Whether its centre is where a tool's can be."""
    moment = float(np.linalg.norm(fitted.values["first_moment"].value))
    return moment <= TOOL_REACH * arm_length(fitted.robot.chain) * fitted.value("mass")


def write(spec: Any, robot: Robot, injection: Injection) -> tuple[str, ...]:
    """A body with an inertial, welded to the last body."""
    if injection.values["mass"] == 0.0:
        return ()
    mass, centre, inertia = centre_and_inertia(injection)
    carrier = spec.body(robot.model.body(int(robot.model.jnt_bodyid[-1])).name)
    taken = sum(body.name.startswith("payload") for body in spec.bodies)
    carrier.add_body(
        name=f"payload_{taken + 1}" if taken else "payload",
        mass=mass,
        ipos=centre,
        inertia=np.full(3, inertia),
        explicitinertial=True,
    )
    return ()
