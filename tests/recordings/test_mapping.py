"""The mapping file: what it says is done, what it cannot say is refused, and a guess is written as one."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from identification.errors import InputError
from recordings.convert import converted
from recordings.guess import guess_mapping
from recordings.joints import joints_named
from recordings.mapping import read_mapping
from recordings.mapping_file import write_mapping
from recordings.table import Channel, Stream, Table

from .runs import JOINTS, RATE, Run, arm_joints, assert_read, opened, run

TWO = "columns: [{0}_shoulder, {0}_elbow]"


def table(made: Run | None = None, **others: Any) -> Table:
    """Columns of the run by the short names of their signals."""
    made = made or run()
    arrays = {"q": made.position, "dq": made.velocity, "tau": made.torque, **others}
    channels = [Channel("time", made.time[:, np.newaxis])]
    for name, values in arrays.items():
        channels += [Channel(f"{name}_{joint}", values[:, [index]]) for index, joint in enumerate(JOINTS)]
    return Table(Path("run.csv"), "csv", (Stream("", tuple(channels)),))


def mapped(tmp_path: Path, text: str, source: Table) -> Any:
    path = tmp_path / "run.map.yaml"
    head = "format: recording-map\nformat_version: 1\njoints: [shoulder, elbow]\n"
    if "time:" not in text:
        head += "time: {column: time, unit: s}\n"
    path.write_text(head + text)
    return converted(source, read_mapping(path), (False, False)).recording


def channels(**lines: str) -> str:
    return "channels:\n" + "".join(f"  {name}: {{{line}}}\n" for name, line in lines.items())


POSITION = TWO.format("q") + ", unit: rad"


def test_sign_zero_and_scale_of_each_joint(tmp_path: Path) -> None:
    made = run()
    counts = np.column_stack(
        [2048 + made.position[:, 0] * 4096 / (2 * np.pi), np.degrees(-made.position[:, 1])]
    )
    text = channels(
        position=TWO.format("n")
        + f", scale: [{2 * np.pi / 4096!r}, {np.pi / 180!r}], sign: [1, -1], zero: [2048, 0]",
        torque=TWO.format("tau") + ", unit: N·m",
    )
    assert_read(mapped(tmp_path, text, table(n=counts)), made, ["torque"])


def test_what_is_measured_at_the_motor_goes_through_its_gear(tmp_path: Path) -> None:
    made, ratio = run(), np.array([100.0, 50.0])
    text = "gear_ratio: [100, 50]\n" + channels(
        position=TWO.format("m") + ", unit: rad, side: motor",
        torque=TWO.format("u") + ", unit: mN·m, side: motor",
    )
    source = table(m=made.position * ratio, u=1e3 * made.torque / ratio)
    assert_read(mapped(tmp_path, text, source), made, ["torque"])


def test_currents_make_torque_by_the_motors_constant_and_the_gear(tmp_path: Path) -> None:
    made = run()
    text = "gear_ratio: [100, 50]\ntorque_constant: [0.1, 0.2]\n" + channels(
        position=POSITION, current=TWO.format("i") + ", unit: mA"
    )
    recording = mapped(tmp_path, text, table(i=100 * made.torque))
    assert not recording.has_torque
    assert recording.drive.kind == "current"
    np.testing.assert_allclose(recording.current * recording.drive.torque_per_unit, made.torque)


def test_a_position_servo_with_its_gains(tmp_path: Path) -> None:
    text = "controller: {kp: [20, 10], kd: 1.5, delay: 0.004}\n" + channels(
        position=POSITION, reference_position=TWO.format("r") + ", unit: rad"
    )
    recording = mapped(tmp_path, text, table(r=run().reference))
    assert recording.controller.kind == "position_servo"
    np.testing.assert_array_equal(recording.controller.kp, [20, 10])
    np.testing.assert_array_equal(recording.controller.kd, [1.5, 1.5])
    assert recording.controller.delay == 0.004


def test_a_rate_in_place_of_time_stamps(tmp_path: Path) -> None:
    text = f"time: {{rate: {RATE}}}\n" + channels(position=POSITION, torque=TWO.format("tau") + ", unit: N·m")
    assert_read(mapped(tmp_path, text, table()), run(), ["torque"])


def test_wraps_are_taken_back_and_a_counter_that_is_a_turn_off_as_well() -> None:
    made = run()
    wrapped = np.degrees(made.position) % 360
    guess = guess_mapping(table(q=wrapped), arm_joints())
    assert guess.mapping.channels["position"].unit == "deg"
    found = converted(table(q=wrapped), guess.mapping, guess.is_slide)
    assert_read(found.recording, made, ["velocity", "torque"])
    assert any("made continuous" in note for note in found.notes)
    counted = made.position + np.array([0, 2 * np.pi])
    guess = guess_mapping(table(q=counted), arm_joints())
    assert_read(
        converted(table(q=counted), guess.mapping, guess.is_slide).recording, made, ["velocity", "torque"]
    )
    np.testing.assert_allclose(np.asarray(guess.mapping.channels["position"].zero), [0, 2 * np.pi])


def test_torque_that_is_nan_throughout_is_none() -> None:
    nothing = np.full_like(run().torque, np.nan)
    guess = guess_mapping(table(tau=nothing), arm_joints())
    assert "torque" not in guess.mapping.channels
    assert any("this log has no torque" in line for line in guess.left_out)


def test_currents_that_are_never_below_zero_have_lost_their_sign() -> None:
    guess = guess_mapping(table(current=np.abs(run().torque)), arm_joints())
    assert guess.mapping.channels["current"].sign == "absolute"
    found = converted(table(current=np.abs(run().torque)), guess.mapping, guess.is_slide)
    assert found.recording.unsigned == ("current",)


def test_qd_is_a_velocity_or_where_to_go_by_its_values() -> None:
    made = run()
    quantities = {
        name: set(guess_mapping(table(qd=values), arm_joints()).mapping.channels)
        for name, values in {"asked": made.reference, "other": 1 - made.torque}.items()
    }
    assert "reference_position" not in quantities["other"]
    without = Table(
        Path("a.csv"),
        "csv",
        (
            Stream(
                "",
                tuple(
                    channel
                    for channel in table(qd=made.reference).streams[0].channels
                    if not channel.name.startswith("dq")
                ),
            ),
        ),
    )
    found = guess_mapping(without, arm_joints()).mapping.channels
    assert found["reference_position"].columns == ("qd_shoulder", "qd_elbow")
    assert "velocity" not in found


def test_samples_without_a_position_are_left_out_and_gaps_of_others_filled() -> None:
    made = run()
    position, torque = made.position.copy(), made.torque.copy()
    position[[0, 7], 1] = np.nan
    torque[20:25, 0] = np.nan
    source = table(q=position, tau=torque)
    guess = guess_mapping(source, arm_joints())
    found = converted(source, guess.mapping, guess.is_slide)
    assert len(found.recording.time) == len(made.time) - 2
    assert np.isfinite(found.recording.torque).all()
    assert any("2 of 300 samples" in note for note in found.notes)
    assert any("torque of shoulder is NaN at 5 samples" in note for note in found.notes)


def test_joints_that_the_model_lacks_are_left_out_and_those_that_the_log_lacks_are_not_mapped() -> None:
    joints = joints_named(["shoulder", "wrist"])
    guess = guess_mapping(table(), joints)
    assert guess.mapping.joints == ("shoulder",)
    assert any("q_elbow" in line for line in guess.left_out)


def test_the_arm_without_a_model_is_what_the_log_names() -> None:
    assert guess_mapping(table()).mapping.joints == JOINTS


def test_a_guess_is_written_as_a_map_that_reads_the_same(tmp_path: Path) -> None:
    source = table()
    guess = guess_mapping(source, arm_joints())
    path = tmp_path / "run.map.yaml"
    write_mapping(guess.mapping, guess.reasons, guess.left_out, source, path)
    assert read_mapping(path) == guess.mapping
    text = path.read_text()
    for reason in guess.reasons.values():
        assert f"# {reason}" in text


WRONG = [
    ("chanels: {}\n" + channels(position=POSITION), "chanels: expected a known field"),
    (channels(torque=POSITION), "channels with position among them"),
    (channels(position="columns: [q_shoulder], unit: rad"), "expected 2 columns of position, one a joint"),
    (channels(position=TWO.format("q") + ", unit: furlong"), "a unit of position .*furlong"),
    (channels(position=TWO.format("q")), "position: expected either a unit or a scale"),
    (channels(position=POSITION + ", sign: absolute"), "only current, duty, voltage may be absolute"),
    (channels(position=POSITION + ", sign: [1, 1, 1]"), "2 values of position sign"),
    (channels(position=POSITION + ", side: motor"), "a gear_ratio"),
    (
        "time: {unit: s}\n" + channels(position=POSITION),
        "time: expected either a column of time stamps or a rate",
    ),
    (channels(position=POSITION, power=POSITION), "channels among position, .* not power"),
    (channels(position=TWO.format("w") + ", unit: rad"), "map: position: expected a column of the csv file"),
    ("time: {column: clock, unit: s}\n" + channels(position=POSITION), "map: time.column: .*'clock'"),
    (
        channels(position=POSITION + ", sign: true"),
        "channels.position.sign: expected a number or a text, got true",
    ),
]


@pytest.mark.parametrize(("text", "says"), WRONG)
def test_a_wrong_map_is_refused_in_a_line(tmp_path: Path, text: str, says: str) -> None:
    with pytest.raises(InputError, match=says):
        mapped(tmp_path, text, table())


def test_the_map_beside_a_recording_counts(tmp_path: Path) -> None:
    made = run()
    header = ",".join(["time", *(f"{name}_{joint}" for name in ("q", "tau") for joint in JOINTS)])
    np.savetxt(
        tmp_path / "run.csv",
        np.column_stack([made.time, made.position, -made.torque]),
        delimiter=",",
        header=header,
        comments="",
        fmt="%.17g",
    )
    assert opened(tmp_path / "run.csv").map is None
    (tmp_path / "run.map.yaml").write_text(
        "time: {column: time}\njoints: [shoulder, elbow]\n"
        + channels(position=POSITION, torque=TWO.format("tau") + ", unit: N·m, sign: -1")
    )
    found = opened(tmp_path / "run.csv")
    assert found.map == tmp_path / "run.map.yaml"
    assert_read(found.recording, made, ["torque"])
