"""Effects written into MJCF: a model that plain MuJoCo runs, and what it cannot carry, said.

An effect's file has ``write(spec, robot, injection) -> tuple[str, ...]``: it changes the MjSpec so that
MuJoCo itself runs the effect, and returns one sentence for each thing it leaves out. Where MJCF has no
form, it changes nothing and the sentence says why. The control of a joint's motor stays the torque, in
N·m at the joint, that the drive reports.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import mujoco
import numpy as np

from identification.errors import InputError

from ..model_file import write_mjcf
from ..robot import EFFECTS_WRITTEN, Robot
from ..unmodelled_forces import unmodelled_forces
from .base import Injection


def write_effects(robot: Robot, injections: Sequence[Injection], out: str | Path) -> tuple[str, ...]:
    """Write ``robot`` with the effects as MJCF to ``out``; the sentences say what it cannot carry.

    Raises InputError for effects that the catalogue does not have or that cannot be written together.
    """
    out = Path(out)
    spec, sentences = effects_spec(robot, injections)
    spec.compiler.savecompiled = False
    text = _compiled(spec, robot).to_xml()
    write_mjcf(ElementTree.fromstring(text), robot, out, "effects that MJCF can carry together")
    return sentences


def effects_spec(robot: Robot, injections: Sequence[Injection]) -> tuple[Any, tuple[str, ...]]:
    """The robot's MjSpec with the effects in it, and the sentences of what it does not carry.

    Raises InputError as ``write_effects``.
    """
    from . import effect  # The catalogue imports the effects, which import this.

    spec = robot.spec()
    sentences: list[str] = []
    for injection in injections:
        where = "" if injection.joint is None else f" of {robot.joint_names[injection.joint]}"
        for sentence in effect(injection.effect).write(spec, robot, injection):
            sentences.append(f"{injection.effect}{where}: {sentence}")
    return spec, tuple(sentences)


def drive(spec: Any, robot: Robot, joint: int) -> Any:
    """The motor (MjsActuator) whose control is the joint's torque; one is added where there is none."""
    element = joint_element(spec, robot, joint)
    for actuator in spec.actuators:
        on_joint = actuator.trntype == mujoco.mjtTrn.mjTRN_JOINT and actuator.target == element.name
        if on_joint and actuator.biastype == mujoco.mjtBias.mjBIAS_NONE:
            return actuator
    actuator = spec.add_actuator(name=f"motor_{joint + 1}", target=element.name)
    actuator.trntype = mujoco.mjtTrn.mjTRN_JOINT
    actuator.set_to_motor()
    limit = robot.limits.torque[joint]
    if np.isfinite(limit):
        actuator.ctrlrange = [-limit, limit]
    return actuator


def joint_element(spec: Any, robot: Robot, joint: int) -> Any:
    """The joint (MjsJoint) of that index; a nameless one is given the name that the chain calls it by."""
    element = spec.joints[joint] if len(spec.joints) == robot.joints else spec.joint(robot.joint_names[joint])
    if not element.name:
        element.name = robot.joint_names[joint]
    return element


def file_angle(spec: Any, robot: Robot, joint: int, value: float) -> float:
    """A joint's position in the unit that the spec's file is written in: rad or degree, m for a slide."""
    if robot.chain.is_slide[joint] or not spec.compiler.degree:
        return value
    return float(np.rad2deg(value))


def _compiled(spec: Any, robot: Robot) -> Any:
    """The spec, once it is sure that MuJoCo compiles it; it says which forces it has."""
    try:
        forces = unmodelled_forces(spec.compile())
        if forces and spec.text(EFFECTS_WRITTEN) is None:
            spec.add_text(name=EFFECTS_WRITTEN, data=", ".join(forces))
            spec.compile()
    except (ValueError, mujoco.FatalError) as error:
        raise InputError(robot.path, "effects", "effects that MJCF can carry together", error) from None
    return spec
