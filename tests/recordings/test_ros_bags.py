"""Bags of both ROS, written by rosbags: storages, messages, clocks and publishers."""

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from identification.errors import InputError
from recordings.readers.ros_messages import CONTROLLER_STATE, typestores

from .runs import JOINTS, Run, assert_read, opened, run

ALL = ("velocity", "torque")
START = 1_700_000_000_000_000_000
STATE = "sensor_msgs/msg/JointState"
# Type, topic, receive time in ns, message.
Sent = tuple[str, str, int, Any]


def nanoseconds(time: float) -> int:
    return START + round(1e9 * time)


def header(store: Any, stamp: int, is_ros1: bool = False) -> Any:
    time = store.types["builtin_interfaces/msg/Time"](sec=stamp // 10**9, nanosec=stamp % 10**9)
    extra = {"seq": 0} if is_ros1 else {}
    return store.types["std_msgs/msg/Header"](stamp=time, frame_id="", **extra)


def joint_states(
    store: Any,
    made: Run,
    names: Sequence[str] = JOINTS,
    stamp: Callable[[float], int] = nanoseconds,
    is_ros1: bool = False,
    effort: bool = True,
) -> list[Sent]:
    """Joint states of joints in any order; the receive time is 2 ms later."""
    order = [JOINTS.index(name) for name in names]
    sent = []
    for index, time in enumerate(made.time.tolist()):
        message = store.types[STATE](
            header=header(store, stamp(time), is_ros1),
            name=list(names),
            position=made.position[index, order],
            velocity=made.velocity[index, order],
            effort=made.torque[index, order] if effort else np.array([]),
        )
        sent.append((STATE, "/joint_states", nanoseconds(time) + 2_000_000, message))
    return sent


def write_bag(path: Path, store: Any, sent: Iterable[Sent], plugin: StoragePlugin) -> Path:
    with Writer(path, version=9, storage_plugin=plugin) as writer:
        connections: dict[str, Any] = {}
        for type_, topic, received, message in sent:
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, type_, typestore=store)
            writer.write(connections[topic], received, store.serialize_cdr(message, type_))
    return path


@pytest.fixture(scope="module")
def store() -> Any:
    return typestores()[0]


@pytest.mark.parametrize("plugin", list(StoragePlugin))
def test_ros2_in_either_storage_as_a_folder_and_as_a_lone_file(
    tmp_path: Path, store: Any, plugin: StoragePlugin
) -> None:
    folder = write_bag(tmp_path / "bag", store, joint_states(store, run()), plugin)
    assert_read(opened(folder).recording, run(), ALL)
    (file,) = (each for each in folder.iterdir() if each.suffix != ".yaml")
    assert_read(opened(file).recording, run(), ALL)
    (folder / "metadata.yaml").unlink()
    assert_read(opened(folder).recording, run(), ALL)


def test_ros1(tmp_path: Path) -> None:
    store = get_typestore(Stores.ROS1_NOETIC)
    path = tmp_path / "run.bag"
    with Writer1(path) as writer:
        connection = writer.add_connection("/joint_states", STATE, typestore=store)
        for _, _, received, message in joint_states(store, run(), is_ros1=True):
            writer.write(connection, received, store.serialize_ros1(message, STATE))
    assert_read(opened(path).recording, run(), ALL)


def test_joints_in_another_order_and_a_hand_that_publishes_between(tmp_path: Path, store: Any) -> None:
    made = run()
    arm = joint_states(store, made, JOINTS[::-1])
    hand = []
    for _, topic, received, message in arm:
        finger = store.types[STATE](
            header=message.header,
            name=["finger_joint1"],
            position=np.array([0.04]),
            velocity=np.array([]),
            effort=np.array([]),
        )
        hand.append((STATE, topic, received + 1000, finger))
    both = [each for pair in zip(arm, hand, strict=True) for each in pair]
    found = opened(write_bag(tmp_path / "bag", store, both, StoragePlugin.SQLITE3))
    assert_read(found.recording, made, ALL)
    assert found.guess is not None
    assert any("finger_joint1" in line for line in found.guess.left_out)


def test_stamps_that_nobody_set_give_way_to_the_time_of_receipt(tmp_path: Path, store: Any) -> None:
    sent = joint_states(store, run(), stamp=lambda time: 0)
    found = opened(write_bag(tmp_path / "bag", store, sent, StoragePlugin.MCAP))
    assert_read(found.recording, run(), ALL)
    assert found.mapping is not None
    assert found.mapping.time.column == "receive time"


def point(store: Any, positions: Any, effort: Any = ()) -> Any:
    return store.types["trajectory_msgs/msg/JointTrajectoryPoint"](
        positions=np.asarray(positions, dtype=float),
        velocities=np.array([]),
        accelerations=np.array([]),
        effort=np.asarray(effort, dtype=float),
        time_from_start=store.types["builtin_interfaces/msg/Duration"](sec=0, nanosec=0),
    )


def free_point(store: Any) -> Any:
    return store.types["trajectory_msgs/msg/MultiDOFJointTrajectoryPoint"](
        transforms=[],
        velocities=[],
        accelerations=[],
        time_from_start=store.types["builtin_interfaces/msg/Duration"](sec=0, nanosec=0),
    )


def controller_states(store: Any, made: Run) -> list[Sent]:
    """States of a controller at half the rate of the joint states, in whichever layout the store has."""
    type_ = store.types[CONTROLLER_STATE]
    names = list(type_.__dataclass_fields__)
    sent = []
    for index, time in list(enumerate(made.time.tolist()))[::2]:
        parts: dict[str, Any] = {"header": header(store, nanoseconds(time)), "joint_names": list(JOINTS)}
        for name in names:
            if name in ("reference", "desired"):
                parts[name] = point(store, made.reference[index])
            elif name in ("feedback", "actual", "error", "output"):
                parts[name] = point(store, made.position[index])
            elif name == "multi_dof_joint_names":
                parts[name] = []
            elif name.startswith("multi_dof"):
                parts[name] = free_point(store)
            elif name == "speed_scaling_factor":
                parts[name] = 1.0
        message = type_(**{name: parts[name] for name in names if name in parts})
        sent.append((CONTROLLER_STATE, "/arm_controller/state", nanoseconds(time) + 2_000_000, message))
    return sent


@pytest.mark.parametrize("layout", range(4))
def test_references_come_from_a_controllers_state_in_every_layout(tmp_path: Path, layout: int) -> None:
    made, store = run(), typestores()[layout]
    sent = sorted([*joint_states(store, made), *controller_states(store, made)], key=lambda each: each[2])
    # A bag as it was before definitions were kept in it.
    folder = write_bag(tmp_path / "bag", store, sent, StoragePlugin.SQLITE3)
    (file,) = folder.glob("*.db3")
    _forget_definitions(file)
    recording = opened(file).recording
    kept = len(recording.time)
    assert kept == len(made.time) - 1
    np.testing.assert_allclose(recording.torque, made.torque[:kept])
    # The references are taken at half the rate, and by a cubic between.
    np.testing.assert_allclose(recording.reference_position, made.reference[:kept], atol=2e-4)


def _forget_definitions(file: Path) -> None:
    import sqlite3

    with sqlite3.connect(file) as database:
        database.execute("DELETE FROM message_definitions")
        database.commit()


def test_a_bag_without_joints_says_what_it_has(tmp_path: Path) -> None:
    store = get_typestore(Stores.ROS2_HUMBLE)
    text = store.types["std_msgs/msg/String"](data="hello")
    folder = write_bag(
        tmp_path / "bag", store, [("std_msgs/msg/String", "/chat", START, text)], StoragePlugin.SQLITE3
    )
    with pytest.raises(
        InputError, match=r"a topic of sensor_msgs/msg/JointState.*/chat \(std_msgs/msg/String\)"
    ):
        opened(folder)


def test_a_damaged_bag_is_refused_in_a_line(tmp_path: Path, store: Any) -> None:
    folder = write_bag(tmp_path / "bag", store, joint_states(store, run()), StoragePlugin.MCAP)
    (file,) = folder.glob("*.mcap")
    file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])
    with pytest.raises(InputError, match="a bag that can be read"):
        opened(file)


def test_definitions_in_a_bag_count(tmp_path: Path) -> None:
    store = get_typestore(Stores.ROS2_HUMBLE)
    own = "std_msgs/Header header\nstring[] joint_names\ntrajectory_msgs/JointTrajectoryPoint reference\n"
    store.register(get_types_from_msg(own, CONTROLLER_STATE))
    made = run()
    sent = sorted([*joint_states(store, made), *controller_states(store, made)], key=lambda each: each[2])
    recording = opened(write_bag(tmp_path / "bag", store, sent, StoragePlugin.MCAP)).recording
    kept = len(recording.time)
    np.testing.assert_allclose(recording.reference_position, made.reference[:kept], atol=2e-4)
