"""What a model's joints may do: ranges, rated speeds and accelerations, torque limits."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from identification.errors import InputError
from identification.followers import Follows, followed
from identification.joint_names import joint_label

Array = NDArray[np.float64]
VELOCITY, ACCELERATION = "velocity_limit", "acceleration_limit"
# In a numeric, no limit: MuJoCo writes no infinity (mjMAXVAL).
NO_LIMIT = 1e10


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


def model_limits(model: mujoco.MjModel, rated: Mapping[str, Mapping[str, float]]) -> Limits:
    """Limits of a compiled model's joints, those that follow others counted to these.

    rated: by the names above, then by joint; missing is no limit.

    Ranges and torque limits are the model's own: ``range``, and the least of ``actuatorfrcrange``, the
    ``forcerange`` of an actuator on the joint, and the ``ctrlrange`` of a motor on it.
    """
    ranges = np.array([own_range(model, joint) for joint in range(model.njnt)])
    found = followed(model)
    for joint, follows in found.items():
        least, most = leaders_range(model, joint, follows)
        lower, upper = ranges[follows.leader]
        ranges[follows.leader] = max(lower, least), min(upper, most)
    own = [joint for joint in range(model.njnt) if joint not in found]
    names = [joint_label(model, joint) for joint in own]
    velocity, acceleration = (
        np.array([rated.get(kind, {}).get(name, np.inf) for name in names])
        for kind in (VELOCITY, ACCELERATION)
    )
    return Limits(
        lower=ranges[own, 0],
        upper=ranges[own, 1],
        velocity=velocity,
        acceleration=acceleration,
        torque=_torque_limits(model)[own],
    )


def own_range(model: Any, joint: int) -> tuple[float, float]:
    """The range of a joint by itself, rad (m); infinite where it has none."""
    if not model.jnt_limited[joint]:
        return -np.inf, np.inf
    lower, upper = model.jnt_range[joint].tolist()
    return lower, upper


def leaders_range(model: Any, joint: int, follows: Follows) -> tuple[float, float]:
    """The range that a joint's own leaves to the one that it follows, rad (m)."""
    ends = [(end - follows.offset) / follows.ratio for end in own_range(model, joint)]
    return min(ends), max(ends)


def rated_at_leaders(
    rated: Mapping[str, Mapping[str, float]], followers: Mapping[str, tuple[str, float]]
) -> dict[str, dict[str, float]]:
    """Rated speeds and accelerations with those of followers counted to the joints that they follow.

    followers: the leader's name and the ratio, by name.
    """
    out = {kind: dict(by_joint) for kind, by_joint in rated.items()}
    for by_joint in out.values():
        for name, (leader, ratio) in followers.items():
            if name in by_joint:
                by_joint[leader] = min(by_joint.get(leader, np.inf), by_joint[name] / abs(ratio))
    return out


def rated_by_numerics(numerics: Mapping[str, Array], joints: tuple[str, ...]) -> dict[str, dict[str, float]]:
    """Rated speeds and accelerations by joint, from a model's custom numerics, one value a joint.

    Raises InputError for another number of values, or one that is not positive.
    """
    rated = {}
    for kind in (VELOCITY, ACCELERATION):
        values = numerics.get(kind)
        if values is None:
            continue
        if len(values) != len(joints) or not np.all(values > 0):
            expected = f"{len(joints)} positive values, one a joint"
            raise InputError("model", f"custom numeric {kind}", expected, values.tolist())
        limited = zip(joints, values.tolist(), strict=True)
        rated[kind] = {joint: value for joint, value in limited if value < NO_LIMIT}
    return rated


def write_numerics(spec: Any, rated: Mapping[str, Mapping[str, float]], joints: tuple[str, ...]) -> None:
    """Put rated speeds and accelerations into an MjSpec as custom numerics, one value a joint."""
    for numeric in list(spec.numerics):
        if numeric.name in (VELOCITY, ACCELERATION):
            spec.delete(numeric)
    for kind, by_joint in rated.items():
        if any(joint in by_joint for joint in joints):
            values = [by_joint.get(joint, NO_LIMIT) for joint in joints]
            spec.add_numeric(name=kind, data=values, size=len(values))


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
