"""A robot as its MJCF (or URDF) tells it: names, limits, chain and ground truth."""

from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

from identification.chain import Chain, chain_from_model
from identification.errors import InputError

from .containment.model import compiled
from .files import require_file
from .unmodelled_forces import unmodelled_forces

Array = NDArray[np.float64]

# Name of the custom text by which a model says which of its forces effects put there.
EFFECTS_WRITTEN = "effects_written"
# Forces that a refusal names.
NAMED_FORCES = 3


@dataclass(frozen=True)
class Limits:
    """What the joints may do; each (n,), SI units at the joint, inf where the model sets no limit.

    lower, upper: position, rad (m). velocity: rad/s. acceleration: rad/s². torque: N·m (N).
    """

    lower: Array
    upper: Array
    velocity: Array
    acceleration: Array
    torque: Array


@dataclass(frozen=True)
class Robot:
    """A model on disk and what was read from it.

    name: the MJCF's model name. path: the file. model: compiled MuJoCo model.
    chain: kinematics. parameters: (14 n,) standard parameters of the model itself.
    limits: joint limits.
    """

    name: str
    path: Path
    model: mujoco.MjModel
    chain: Chain
    parameters: Array
    limits: Limits

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Joint names, base to tip."""
        return self.chain.joint_names

    @property
    def joints(self) -> int:
        """Number of joints."""
        return self.chain.joints

    def units(self) -> tuple[str, ...]:
        """Unit of each joint's torque: N·m for a hinge, N for a slide."""
        return tuple("N" if slide else "N·m" for slide in self.chain.is_slide)


def load_robot(path: str | Path) -> Robot:
    """Read an MJCF, or a URDF that MuJoCo reads.

    Joint limits come from ``range`` and ``actuatorfrcrange`` (or the ``ctrlrange``/``forcerange``
    of a motor on the joint); velocity and acceleration limits, which MJCF has no field for, from
    ``<custom><numeric name="velocity_limit" data="..."/>`` and ``acceleration_limit``, rad/s and
    rad/s², one value a joint. Raises InputError, also for a model with forces that would be ignored.
    """
    path = Path(path)
    require_file(path, "model", "an existing MJCF or URDF file")
    model = compiled(path)
    try:
        chain, parameters = chain_from_model(model)
        _require_known_forces(model)
        limits = _limits(model)
    except InputError as error:
        raise error.located(path) from None
    name = model.names[: model.names.index(b"\0")].decode() or path.stem
    return Robot(name, path, model, chain, parameters, limits)


def _require_known_forces(model: mujoco.MjModel) -> None:
    """Raise InputError for a model with forces that nothing here reckons with."""
    found = unmodelled_forces(model)
    if not found:
        return
    got = ", ".join(found[:NAMED_FORCES])
    if len(found) > NAMED_FORCES:
        got += f" and {len(found) - NAMED_FORCES} more"
    if mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_TEXT, EFFECTS_WRITTEN) >= 0:
        raise InputError("model", "forces", "the model that this corrected simulator was made from", got)
    expected = "rigid bodies with joint springs, armature, damping, frictionloss and gravity"
    raise InputError("model", "forces", expected, f"{got}; take it out of the model, simulate has --effect")


def _limits(model: mujoco.MjModel) -> Limits:
    n = model.njnt
    limited = np.asarray(model.jnt_limited, dtype=bool)
    lower = np.where(limited, model.jnt_range[:, 0], -np.inf)
    upper = np.where(limited, model.jnt_range[:, 1], np.inf)
    return Limits(
        lower=lower,
        upper=upper,
        velocity=_numeric(model, "velocity_limit", n),
        acceleration=_numeric(model, "acceleration_limit", n),
        torque=_torque_limits(model),
    )


def _numeric(model: mujoco.MjModel, name: str, n: int) -> Array:
    """The custom numeric of that name, (n,), or inf where the model has none."""
    index = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_NUMERIC, name)
    if index < 0:
        return np.full(n, np.inf)
    start, size = model.numeric_adr[index], model.numeric_size[index]
    values = np.array(model.numeric_data[start : start + size])
    if size != n or not np.all(values > 0):
        raise InputError(
            "model", f"custom numeric {name}", f"{n} positive values, one a joint", values.tolist()
        )
    return values


def _torque_limits(model: mujoco.MjModel) -> Array:
    """Symmetric torque limit a joint, (n,) N·m: the joint's own, its actuators' and its motors' controls'."""
    torque = np.full(model.njnt, np.inf)
    for joint in range(model.njnt):
        if model.jnt_actfrclimited[joint]:
            torque[joint] = _least(model.jnt_actfrcrange[joint])
    for actuator in range(model.nactuator):
        if model.actuator_trntype[actuator] != mujoco.mjtTrn.mjTRN_JOINT:
            continue
        joint = int(model.actuator_trnid[actuator, 0])
        gear = abs(float(model.actuator_gear[actuator, 0]))
        if model.actuator_forcelimited[actuator]:
            torque[joint] = min(torque[joint], gear * _least(model.actuator_forcerange[actuator]))
        control = int(model.actuator_ctrladr[actuator])
        if _is_motor(model, actuator) and model.actuator_ctrllimited[control]:
            gain = abs(float(model.actuator_gainprm[actuator, 0]))
            torque[joint] = min(torque[joint], gear * gain * _least(model.actuator_ctrlrange[control]))
    return torque


def _is_motor(model: mujoco.MjModel, actuator: int) -> bool:
    """Whether an actuator's control is a torque: that of a servo is where to go, or how fast."""
    return (
        model.actuator_gaintype[actuator] == mujoco.mjtGain.mjGAIN_FIXED
        and model.actuator_biastype[actuator] == mujoco.mjtBias.mjBIAS_NONE
        and model.actuator_dyntype[actuator] == mujoco.mjtDyn.mjDYN_NONE
        and model.actuator_ctrlnum[actuator] == 1
    )


def _least(bounds: Array) -> float:
    """The bound (2,) that is nearer to zero, by its size."""
    return float(np.abs(bounds).min())
