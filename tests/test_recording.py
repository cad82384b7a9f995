from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from rerun.chunk import RrdReader

from identification.errors import InputError
from testbench.jobs.view import view
from testbench.recording import PLOT_RATE, POSE_RATE, write_session
from testbench.results import IdentificationResult
from testbench.scene import body_poses

from .synthetic import ARM, synthetic_result, synthetic_robot, without_truth

SECONDS = 4.0


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> IdentificationResult:
    return synthetic_result(synthetic_robot(tmp_path_factory.mktemp("robot")), SECONDS)


@pytest.fixture(scope="module")
def columns(result: IdentificationResult, tmp_path_factory: pytest.TempPathFactory) -> dict[str, list[Any]]:
    path = tmp_path_factory.mktemp("session") / "session.rrd"
    write_session(result, path)
    return read(path)


def read(path: Path) -> dict[str, list[Any]]:
    """Every column of the recording, "entity:column" to its rows; ids and Rerun's own entities left out."""
    columns: dict[str, list[Any]] = {}
    for chunk in RrdReader(path).stream():
        if chunk.entity_path.startswith("/__"):
            continue
        batch = chunk.to_record_batch()
        for field, values in zip(batch.schema, batch.columns, strict=True):
            if not field.name.startswith("rerun.controls"):
                rows = values.cast("int64") if field.name == "time" else values
                columns.setdefault(f"{chunk.entity_path}:{field.name}", []).extend(rows.to_pylist())
    return columns


def scalars(columns: dict[str, list[Any]], entity: str) -> np.ndarray:
    """A series; NaN in rows without a value."""
    return np.array([row[0] if row else np.nan for row in columns[f"{entity}:Scalars:scalars"]])


def test_every_run_has_the_arm_its_reference_and_every_joint(
    columns: dict[str, list[Any]], result: IdentificationResult
) -> None:
    entities = {name.split(":")[0] for name in columns}
    assert {"/summary", "/parameters/table", "/parameters/chart/estimate"} <= entities
    for run in ("validation_1", "fit_1"):
        expected = {f"/{run}/floor", f"/{run}/path/measured", f"/{run}/path/reference"}
        for body in ("turret", "arm", "ram"):
            expected |= {f"/{run}/arm/measured/{body}", f"/{run}/arm/reference/{body}"}
        for joint in result.robot.joint_names:
            for series in ("position/measured", "position/reference", "torque/measured", "torque/predicted"):
                expected.add(f"/{run}/joints/{joint}/{series}")
            expected |= {
                f"/{run}/joints/{joint}/residual/{x}" for x in ("residual", "floor_upper", "floor_lower")
            }
        assert expected <= entities


def test_rows_are_thinned_to_the_plot_and_pose_rates(columns: dict[str, list[Any]]) -> None:
    assert len(scalars(columns, "/fit_1/joints/lift/position/measured")) == SECONDS * PLOT_RATE
    assert len(scalars(columns, "/fit_1/joints/lift/torque/predicted")) == SECONDS * PLOT_RATE
    assert len(columns["/fit_1/arm/measured/ram:Transform3D:translation"]) == SECONDS * POSE_RATE


def test_torques_and_times_come_back_as_they_went_in(
    columns: dict[str, list[Any]], result: IdentificationResult
) -> None:
    fit = result.validations[0]
    for joint, name in enumerate(result.robot.joint_names):
        root = f"/validation_1/joints/{name}"
        np.testing.assert_array_equal(scalars(columns, f"{root}/torque/measured"), fit.measured[:, joint])
        np.testing.assert_array_equal(scalars(columns, f"{root}/torque/predicted"), fit.predicted[:, joint])
        residual = np.where(fit.used[:, joint], fit.measured[:, joint] - fit.predicted[:, joint], np.nan)
        np.testing.assert_array_equal(scalars(columns, f"{root}/residual/residual"), residual)
    nanoseconds = columns["/validation_1/joints/turn/torque/measured:time"]
    np.testing.assert_array_equal(nanoseconds, np.round(1e9 * fit.time))


def test_series_are_named_with_their_unit(columns: dict[str, list[Any]]) -> None:
    assert columns["/fit_1/joints/lift/torque/measured:SeriesLines:names"] == [["measured [N·m]"]]
    assert columns["/fit_1/joints/reach/torque/measured:SeriesLines:names"] == [["measured [N]"]]
    assert columns["/fit_1/joints/reach/position/reference:SeriesLines:names"] == [["reference [m]"]]


def test_bodies_stand_where_mujoco_puts_them(
    columns: dict[str, list[Any]], result: IdentificationResult
) -> None:
    model, recording = result.robot.model, result.fit_recordings[0]
    data = mujoco.MjData(model)
    shown = np.squeeze(columns["/fit_1/arm/measured/ram:Transform3D:translation"])
    every = round(recording.sample_rate / POSE_RATE)
    for row in (0, 37, len(shown) - 1):
        data.qpos[:] = recording.position[row * every]
        mujoco.mj_forward(model, data)
        # Rerun keeps single precision.
        np.testing.assert_allclose(shown[row], data.body("ram").xpos, atol=1e-6)


def test_every_kind_of_geom_is_drawn_and_collision_geoms_are_not(columns: dict[str, list[Any]]) -> None:
    kinds = {name.split(":")[1] for name in columns if name.startswith("/fit_1/arm/measured")}
    assert {"Boxes3D", "Capsules3D", "Cylinders3D", "Ellipsoids3D", "Mesh3D"} <= kinds
    boxes = [v for name, v in columns.items() if "/fit_1/arm" in name and "Boxes3D:half_sizes" in name]
    assert np.max(boxes) < 0.5


def test_a_model_without_geoms_is_drawn_as_sticks(tmp_path: Path) -> None:
    bare = "\n".join(line for line in ARM.splitlines() if "<geom" not in line)
    write_session(synthetic_result(synthetic_robot(tmp_path, bare), 1.0), tmp_path / "session.rrd")
    capsules = [name for name in read(tmp_path / "session.rrd") if name.endswith("Capsules3D:lengths")]
    assert any(name.startswith("/fit_1/arm/measured/turret") for name in capsules)


def test_a_hardware_log_needs_no_truth_and_no_reference(result: IdentificationResult, tmp_path: Path) -> None:
    write_session(without_truth(result), tmp_path / "session.rrd")
    columns = read(tmp_path / "session.rrd")
    assert "/fit_1/joints/turn/torque/predicted:Scalars:scalars" in columns
    assert not any("reference" in name or "floor_upper" in name for name in columns)


def test_the_same_result_gives_the_same_recording(
    columns: dict[str, list[Any]], result: IdentificationResult, tmp_path: Path
) -> None:
    write_session(result, tmp_path / "session.rrd")
    assert read(tmp_path / "session.rrd") == columns
    (store,) = RrdReader(tmp_path / "session.rrd").recordings()
    assert (store.application_id, store.recording_id) == ("identification_testbench", "slider_arm")


def test_the_file_carries_its_layout(result: IdentificationResult, tmp_path: Path) -> None:
    write_session(result, tmp_path / "session.rrd")
    (layout,) = RrdReader(tmp_path / "session.rrd").blueprints()
    origins = set()
    for chunk in RrdReader(tmp_path / "session.rrd").stream(store=layout):
        batch = chunk.to_record_batch()
        if "ViewBlueprint:space_origin" in batch.schema.names:
            origins |= {origin for (origin,) in batch.column("ViewBlueprint:space_origin").to_pylist()}
    assert {"validation_1", "fit_1", "summary", "parameters/chart", "parameters/table"} <= origins


def test_a_failed_write_leaves_the_old_session(
    result: IdentificationResult, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "session.rrd"
    path.write_bytes(b"old")
    monkeypatch.setattr("testbench.recording.log_parameters", lambda *_: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        write_session(result, path)
    assert [p.name for p in tmp_path.iterdir()] == ["session.rrd"]
    assert path.read_bytes() == b"old"


def test_tool_point_is_the_last_site(result: IdentificationResult) -> None:
    model = result.robot.model
    q = np.array([[0.3, -0.4, 0.2]])
    _, _, tool = body_poses(model, q)
    data = mujoco.MjData(model)
    data.qpos[:] = q[0]
    mujoco.mj_forward(model, data)
    np.testing.assert_array_equal(tool[0], data.site("tool").xpos)


def test_view_says_what_is_missing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(InputError, match=r"session\.rrd.*no such file"):
        view(tmp_path)
    (tmp_path / "session.rrd").touch()
    monkeypatch.setattr("sys.platform", "linux")
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    with pytest.raises(InputError, match="graphical display"):
        view(tmp_path)
