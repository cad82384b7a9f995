"""Forces that an MJCF puts on a robot's joints and that identification and diagnosis do not know."""

from collections.abc import Iterator
from typing import Any

import mujoco
import numpy as np

from identification.chain import gravity
from identification.followers import followed
from identification.joint_names import joint_label

# Of a dcmotor in biasprm and dynprm: amplitude of the cogging, stiffness of the LuGre bristles.
COGGING, BRISTLES = 0, 5


def unmodelled_forces(model: Any) -> tuple[str, ...]:
    """What acts in a compiled ``mujoco.MjModel`` and is not known.

    Known are gravity, elastic springs of joints, armature, linear damping, frictionloss, and joints that
    follow another at a constant ratio. A phrase for each of the others, with its value and element, such as
    "stiffness 20 of tendon t". What is zero or inactive is harmless, and so are contacts, joint limits, and
    actuators that their controls drive.
    """
    found = (_of_joints, _of_bodies, _of_tendons, _of_equalities, _of_actuators, _of_the_rest)
    return tuple(phrase for each in found for phrase in each(model))


def _of_joints(model: Any) -> Iterator[str]:
    for joint in range(model.njnt):
        name = joint_label(model, joint)
        if model.jnt_plasticadr[joint] >= 0:
            yield f"springyield {_text(model.jnt_springyield[joint])} of joint {name}"
        damping = [model.dof_damping[joint], *model.dof_dampingpoly[joint]]
        if np.any(damping[1:]):
            yield f"damping {_text(damping)} of joint {name}"


def _of_bodies(model: Any) -> Iterator[str]:
    if gravity(model).any():
        # On what no joint moves it does nothing.
        for body in np.flatnonzero((model.body_gravcomp != 0) & (model.body_weldid != 0)):
            yield f"gravcomp {_text(model.body_gravcomp[body])} of body {model.body(body).name}"
    for body in np.flatnonzero(model.body_plugin >= 0):
        yield f"a plugin of body {model.body(body).name}"


def _of_tendons(model: Any) -> Iterator[str]:
    for tendon in range(model.ntendon):
        values = {
            "stiffness": [model.tendon_stiffness[tendon], *model.tendon_stiffnesspoly[tendon]],
            "damping": [model.tendon_damping[tendon], *model.tendon_dampingpoly[tendon]],
            "frictionloss": [model.tendon_frictionloss[tendon]],
            "armature": [model.tendon_armature[tendon]],
        }
        for field, value in values.items():
            if np.any(value):
                yield f"{field} {_text(value)} of tendon {model.tendon(tendon).name or tendon + 1}"


def _of_equalities(model: Any) -> Iterator[str]:
    found = followed(model)
    for equality in np.flatnonzero(model.eq_active0):
        if model.eq_type[equality] == mujoco.mjtEq.mjEQ_JOINT and int(model.eq_obj1id[equality]) in found:
            continue
        kind = mujoco.mjtEq(model.eq_type[equality]).name.removeprefix("mjEQ_").lower()
        yield f"equality {kind} {model.equality(equality).name or equality + 1}"


def _of_actuators(model: Any) -> Iterator[str]:
    for index in range(model.nactuator):
        name = f"actuator {model.actuator(index).name or index + 1}"
        damping = [model.actuator_damping[index], *model.actuator_dampingpoly[index]]
        if model.actuator_armature[index]:
            yield f"armature {_text(model.actuator_armature[index])} of {name}"
        if np.any(damping):
            yield f"damping {_text(damping)} of {name}"
        gain, bias = model.actuator_gainprm[index], model.actuator_biasprm[index]
        kind = model.actuator_biastype[index]
        if kind == mujoco.mjtBias.mjBIAS_DCMOTOR:
            if bias[COGGING]:
                yield f"cogging {_text(bias[COGGING])} of {name}"
            if model.actuator_dynprm[index, BRISTLES]:
                yield f"LuGre friction of {name}"
            if not model.actuator_ctrlnum[index] and gain[1]:
                yield f"back-EMF of {name}, which has no input"
        elif kind == mujoco.mjtBias.mjBIAS_MUSCLE:
            yield f"muscle {name}"
        elif kind == mujoco.mjtBias.mjBIAS_AFFINE and bias[:3].any() and not gain[:3].any():
            yield f"bias {_text(bias[:3])} of {name}, which has no gain"


def _of_the_rest(model: Any) -> Iterator[str]:
    for name in ("density", "viscosity"):
        value = getattr(model.opt, name)
        if value:
            yield f"option {name} {_text(value)}"
    if model.nflex:
        yield f"flex {model.flex(0).name}"


def _text(values: Any) -> str:
    """Numbers as MJCF spells them, without the zeros that end a polynomial."""
    numbers = np.trim_zeros(np.atleast_1d(values), "b")
    return " ".join(f"{number:g}" for number in numbers)
