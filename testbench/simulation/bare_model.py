"""A robot's moving masses alone: the same dynamics without geoms, sites, cameras and lights, and cheaper.

MuJoCo places every geom at every step, which costs a detailed arm a third of the step.
"""

from typing import Any

import mujoco
import numpy as np

# What the dynamics read, copied over so that not even rounding differs.
FIELDS = (
    "qpos0",
    "qpos_spring",
    "body_pos",
    "body_quat",
    "body_ipos",
    "body_iquat",
    "body_mass",
    "body_subtreemass",
    "body_inertia",
    "body_invweight0",
    "body_gravcomp",
    "jnt_pos",
    "jnt_axis",
    "jnt_stiffness",
    "jnt_stiffnesspoly",
    "dof_armature",
    "dof_damping",
    "dof_dampingpoly",
    "dof_frictionloss",
    "dof_invweight0",
    "dof_M0",
)


def bare_model(model: Any) -> Any:
    """A ``mujoco.MjModel`` with the bodies and joints of a compiled model, and nothing else.

    Masses, joint springs, damping, armature, frictionloss, gravity compensation, options and fluid forces
    on the bodies' inertia boxes stay; joint limits, contacts, equalities, sensors and actuators go. The
    model itself where more than bodies and joints takes part in its smooth dynamics.
    """
    if _has_other_dynamics(model):
        return model
    spec = mujoco.MjSpec()
    bodies = [spec.worldbody]
    for index in range(1, model.nbody):
        body = bodies[model.body_parentid[index]].add_body(
            name=model.body(index).name,
            pos=model.body_pos[index],
            quat=model.body_quat[index],
            mass=model.body_mass[index],
            ipos=model.body_ipos[index],
            iquat=model.body_iquat[index],
            inertia=model.body_inertia[index],
            gravcomp=model.body_gravcomp[index],
            explicitinertial=True,
        )
        bodies.append(body)
        first = int(model.body_jntadr[index])
        for joint in range(first, first + int(model.body_jntnum[index])):
            body.add_joint(
                name=model.joint(joint).name,
                type=mujoco.mjtJoint(model.jnt_type[joint]),
                pos=model.jnt_pos[joint],
                axis=model.jnt_axis[joint],
            )
    bare = spec.compile()
    for field in FIELDS:
        getattr(bare, field)[:] = getattr(model, field)
    for option in dir(model.opt):
        if not option.startswith("_"):
            setattr(bare.opt, option, getattr(model.opt, option))
    return bare


def _has_other_dynamics(model: Any) -> bool:
    """Whether tendons, flexes, plug-ins, actuators, yielding springs or geoms in a fluid act on joints."""
    return bool(
        model.ntendon
        or model.nflex
        or model.nplugin
        or np.any(model.geom_fluid)
        or np.any(model.actuator_armature)
        or np.any(model.actuator_damping)
        or np.any(model.actuator_dampingpoly)
        or np.any(model.jnt_plasticadr >= 0)
    )
