"""CSV and its kin: dialects, names and units as people have them."""

import csv
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest

from identification.errors import InputError
from recordings.joints import joints_named

from .runs import JOINTS, Array, Run, assert_read, numbered, opened, run

ALL = ("velocity", "torque")


def write(
    path: Path,
    header: Sequence[str] | None,
    table: Array,
    separator: str = ",",
    number: Callable[[float], str] = repr,
    before: Sequence[str] = (),
) -> Path:
    """A file as the csv module writes it."""
    with path.open("w", newline="", encoding="utf-8") as file:
        file.writelines(f"{line}\n" for line in before)
        writer = csv.writer(file, delimiter=separator)
        if header is not None:
            writer.writerow(header)
        writer.writerows([number(float(value)) for value in row] for row in table)
    return path


def columns(*names: str) -> list[str]:
    return [name.format(joint) for name in names for joint in JOINTS]


def table(made: Run, *others: Array) -> Array:
    return np.column_stack([made.time, made.position, made.velocity, made.torque, *others])


@pytest.mark.parametrize("separator", [",", ";", "\t", "|"])
def test_any_separator(tmp_path: Path, separator: str) -> None:
    header = ["time", *columns("{}_pos", "{}_vel", "{}_torque")]
    path = write(tmp_path / "run.csv", header, table(run()), separator)
    assert_read(opened(path).recording, run(), ALL)


def test_decimal_commas(tmp_path: Path) -> None:
    header = ["t", *columns("q_{}", "dq_{}", "tau_{}")]
    path = write(tmp_path / "run.csv", header, table(run()), ";", lambda value: repr(value).replace(".", ","))
    assert_read(opened(path).recording, run(), ALL)


def test_blanks_and_a_header_in_the_last_comment(tmp_path: Path) -> None:
    path = tmp_path / "run.txt"
    header = " ".join(["time", *columns("{}_position", "{}_velocity", "{}_effort")])
    np.savetxt(path, table(run()), fmt="%.17g", header=f"recorded by hand\n{header}")
    assert_read(opened(path).recording, run(), ALL)


def test_without_a_header_blocks_are_named_by_their_values(tmp_path: Path) -> None:
    made = run()
    path = write(tmp_path / "run.csv", None, np.column_stack([made.time, made.position, made.torque]))
    assert_read(opened(path).recording, made, ["torque"])
    path = write(tmp_path / "more.csv", None, table(made, made.reference))
    assert_read(opened(path).recording, made, [*ALL, "reference"])


def test_comments_between_lines_and_an_unnamed_index(tmp_path: Path) -> None:
    made = run()
    indexed = np.column_stack([np.arange(len(made.time)), table(made)])
    header = ["", "timestamp", *columns("{}_position", "{}_velocity", "{}_torque")]
    path = write(tmp_path / "run.csv", header, indexed, before=["# a comment, with a comma"])
    lines = path.read_text().splitlines()
    path.write_text("\n".join([*lines[:40], "# restarted", *lines[40:]]) + "\n")
    found = opened(path)
    assert_read(found.recording, made, ALL)


def test_degrees_milliseconds_and_millinewtonmetres_as_stated(tmp_path: Path) -> None:
    made = run()
    header = ["time [ms]", *columns("{}_pos [deg]", "{}_vel (deg/s)", "{}_torque [mNm]")]
    degrees = np.degrees(made.position), np.degrees(made.velocity)
    path = write(
        tmp_path / "run.csv", header, np.column_stack([1e3 * made.time, *degrees, 1e3 * made.torque])
    )
    assert_read(opened(path).recording, made, ALL)


@pytest.mark.parametrize(("unit", "of_a_second"), [("ms", 1e3), ("µs", 1e6), ("ns", 1e9)])
def test_units_that_nothing_states_are_named_by_the_values(
    tmp_path: Path, unit: str, of_a_second: float
) -> None:
    made = run()
    header = ["timestamp", *columns("{}_pos", "{}_vel", "{}_torque")]
    stamps = 1_700_000_000 * int(of_a_second) + np.round(of_a_second * made.time).astype(np.int64)
    rest = np.column_stack([np.degrees(made.position), np.degrees(made.velocity), 1e3 * made.torque])
    with (tmp_path / "run.csv").open("w") as file:
        file.write(",".join(header) + "\n")
        for stamp, row in zip(stamps.tolist(), rest.tolist(), strict=True):
            file.write(",".join([str(stamp), *map(repr, row)]) + "\n")
    found = opened(tmp_path / "run.csv")
    assert found.mapping is not None
    assert found.mapping.time.unit == unit
    units = {quantity: channel.unit for quantity, channel in found.mapping.channels.items()}
    assert units == {"position": "deg", "velocity": "deg/s", "torque": "mN·m"}
    assert_read(found.recording, made, ALL)


def test_names_of_urs_rtde(tmp_path: Path) -> None:
    made = run(6)
    blocks = {
        "target_q": made.reference,
        "target_moment": 0 * made.torque,
        "actual_q": made.position,
        "actual_qd": made.velocity,
        "actual_current": made.torque / 10,
        "actual_TCP_pose": made.velocity,
    }
    header = ["timestamp", *(f"{name}_{joint}" for name in blocks for joint in range(6)), "robot_mode"]
    values = np.column_stack([made.time, *blocks.values(), np.full(len(made.time), 7.0)])
    names = ("shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint")
    joints = joints_named([*names, "wrist_1_joint", "wrist_2_joint", "wrist_3_joint"])
    found = opened(write(tmp_path / "robot_data.csv", header, values), joints)
    recording = found.recording
    assert recording.joint_names == joints.names
    np.testing.assert_allclose(recording.position, made.position)
    np.testing.assert_allclose(recording.velocity, made.velocity)
    np.testing.assert_allclose(recording.reference_position, made.reference)
    np.testing.assert_allclose(recording.current, made.torque / 10)
    assert not recording.has_torque
    assert found.guess is not None
    assert any("target_moment_0" in line and "0 at every sample" in line for line in found.guess.left_out)
    assert any("actual_TCP_pose_0" in line for line in found.guess.left_out)


def test_names_of_franka_that_count_from_zero(tmp_path: Path) -> None:
    made = run(7)
    blocks = {
        "q": made.position,
        "q_d": made.reference,
        "dq": made.velocity,
        "tau_J": made.torque,
        "tau_J_d": 0.9 * made.torque,
        "dtau_J": made.velocity,
        "tau_ext_hat_filtered": 0.1 * made.torque,
        "O_T_EE": made.velocity,
    }
    header = ["time", *(f"{name}_{joint}" for name in blocks for joint in range(7))]
    joints = joints_named([f"panda_joint{joint}" for joint in range(1, 8)])
    path = write(tmp_path / "run.csv", header, np.column_stack([made.time, *blocks.values()]))
    recording = opened(path, joints).recording
    for values, wanted in (
        (recording.position, made.position),
        (recording.reference_position, made.reference),
        (recording.velocity, made.velocity),
        (recording.torque, made.torque),
        (recording.torque_command, 0.9 * made.torque),
    ):
        np.testing.assert_allclose(values, wanted)


def test_numbers_in_brackets_are_joints_and_no_units(tmp_path: Path) -> None:
    made, order = run(6), [3, 1, 0, 5, 4, 2]
    blocks = {"state.q": made.position, "state.tau_J": made.torque, "cmd.q": made.reference}
    header = ["duration", *(f"{name}[{joint}]" for name in blocks for joint in order)]
    values = np.column_stack([1e3 * made.time, *(block[:, order] for block in blocks.values())])
    recording = opened(write(tmp_path / "run.csv", header, values), numbered(6)).recording
    np.testing.assert_allclose(recording.time, made.time, atol=1e-9)
    np.testing.assert_allclose(recording.position, made.position)
    np.testing.assert_allclose(recording.torque, made.torque)
    np.testing.assert_allclose(recording.reference_position, made.reference)


def test_lists_in_cells_with_the_joints_named_beside(tmp_path: Path) -> None:
    made = run()
    (tmp_path / "joint_list.txt").write_text("\n".join([JOINTS[1], JOINTS[0], "jaw"]) + "\n")
    order = [1, 0]

    def cell(row: Array) -> str:
        return str([*row[order].tolist(), 0.25])

    with (tmp_path / "state_motor.csv").open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["type", "timestamp", "positions", "velocities", "torques"])
        for index, stamp in enumerate(np.round(1e6 * made.time).astype(int).tolist()):
            rows = (made.position[index], made.velocity[index], made.torque[index])
            writer.writerow(["STATE_MOTOR", stamp, *map(cell, rows)])
    found = opened(tmp_path / "state_motor.csv")
    assert_read(found.recording, made, ALL)
    assert found.guess is not None
    assert any("jaw" in line for line in found.guess.left_out)


def test_a_line_that_a_stopped_logger_cut_off_is_left_out(tmp_path: Path) -> None:
    header = ["time", *columns("{}_pos", "{}_vel", "{}_torque")]
    path = write(tmp_path / "run.csv", header, table(run()))
    path.write_text(path.read_text() + "1.5,0.3,0.")
    assert_read(opened(path).recording, run(), ALL)


WRONG = [
    (lambda lines: [*lines[:50], "0.2,1.0", *lines[50:]], "line 51: expected 7 cells"),
    (lambda lines: [*lines[:50], lines[0], *lines[50:]], "line 51: expected a number"),
    (lambda lines: [lines[0]], "lines of numbers"),
    (lambda lines: [], "lines of data"),
]


@pytest.mark.parametrize(("change", "says"), WRONG)
def test_a_spoiled_file_is_refused_by_its_line(
    tmp_path: Path, change: Callable[[list[str]], list[str]], says: str
) -> None:
    header = ["time", *columns("{}_pos", "{}_vel", "{}_torque")]
    path = write(tmp_path / "run.csv", header, table(run()))
    path.write_text("\n".join(change(path.read_text().splitlines())) + "\n")
    with pytest.raises(InputError, match=says):
        opened(path)
