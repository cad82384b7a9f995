"""ROS messages that carry joint data: their fields, and definitions that bags may lack."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

# control_msgs/JointTrajectoryControllerState, as its releases have it after ``joint_names``.
_POINT, _FREE = "trajectory_msgs/JointTrajectoryPoint", "trajectory_msgs/MultiDOFJointTrajectoryPoint"
_FIRST = ("desired", "actual", "error")
_LATER = ("reference", "feedback", "error", "output")
_BOTH = (*_LATER, "desired", "actual")
CONTROLLER_STATE = "control_msgs/msg/JointTrajectoryControllerState"
DYNAMIC_STATE = "control_msgs/msg/DynamicJointState"


@dataclass(frozen=True)
class Fields:
    """Joint values of one message. stamp: ns, of its header. values: by field, one number a joint."""

    stamp: int
    joints: tuple[str, ...]
    values: Mapping[str, Sequence[float]]


def _joint_state(message: Any) -> Fields:
    values = {name: getattr(message, name) for name in ("position", "velocity", "effort")}
    return Fields(_stamp(message), tuple(message.name), values)


def _controller_state(message: Any) -> Fields:
    values = {}
    for part in dict.fromkeys((*_BOTH, *_FIRST)):
        point = getattr(message, part, None)
        if point is None or part == "error":
            continue
        for name in ("positions", "velocities", "accelerations", "effort"):
            if len(getattr(point, name)):
                values[f"{part}.{name}"] = getattr(point, name)
    return Fields(_stamp(message), tuple(message.joint_names), values)


def _dynamic_state(message: Any) -> Fields:
    joints = tuple(message.joint_names)
    values: dict[str, list[float]] = {}
    for index, each in enumerate(message.interface_values):
        for name, value in zip(each.interface_names, each.values, strict=False):
            values.setdefault(name, [float("nan")] * len(joints))[index] = float(value)
    return Fields(_stamp(message), joints, values)


def _stamp(message: Any) -> int:
    stamp = message.header.stamp
    return int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)


MESSAGES: Mapping[str, Callable[[Any], Fields]] = {
    "sensor_msgs/msg/JointState": _joint_state,
    CONTROLLER_STATE: _controller_state,
    DYNAMIC_STATE: _dynamic_state,
}


@cache
def typestores() -> tuple[Any, ...]:
    """Types of ROS 2 for bags without definitions, one for each layout of a controller's state."""
    return tuple(
        _typestore(parts, free, extra)
        for parts, free, extra in (
            (_BOTH, True, ""),
            (_LATER, True, "float64 speed_scaling_factor\n"),
            (_LATER, True, ""),
            (_FIRST, False, ""),
        )
    )


def _typestore(parts: Sequence[str], has_free: bool, extra: str) -> Any:
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    state = "std_msgs/Header header\nstring[] joint_names\n"
    state += "".join(f"{_POINT} {part}\n" for part in parts)
    if has_free:
        state += "string[] multi_dof_joint_names\n"
        state += "".join(f"{_FREE} multi_dof_{part}\n" for part in parts)
    interface = "control_msgs/msg/InterfaceValue"
    dynamic = f"std_msgs/Header header\nstring[] joint_names\n{interface}[] interface_values\n"
    store = get_typestore(Stores.ROS2_HUMBLE)
    types = get_types_from_msg(state + extra, CONTROLLER_STATE)
    types |= get_types_from_msg("string[] interface_names\nfloat64[] values\n", interface)
    store.register(types | get_types_from_msg(dynamic, DYNAMIC_STATE))
    return store
