"""npz, JSON and Parquet, each written by its own library."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from identification.errors import InputError
from recordings.door import Door
from recordings.joints import joints_named

from .runs import JOINTS, RATE, arm_joints, assert_read, opened, run


def test_npz_by_order_with_what_is_no_signal_left_out(tmp_path: Path) -> None:
    made = run()
    path = tmp_path / "run.npz"
    objects = np.array([{"a": 1}, None], dtype=object)
    np.savez(
        path,
        time=made.time,
        dof_pos=made.position,
        des_dof_pos=made.reference,
        dof_vel=made.velocity,
        dof_tau=made.torque,
        notes=objects,
        gains=np.ones(2),
    )
    found = opened(path)
    assert_read(found.recording, made, ["velocity", "torque", "reference"])
    assert found.guess is not None
    assert any("never opened" in line for line in found.guess.left_out)
    assert any(line.startswith("gains") for line in found.guess.left_out)


@pytest.mark.parametrize("suffix", [".pkl", ".npy.pickle", ".pt"])
def test_a_pickle_is_never_opened(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"run{suffix}"
    # Opened, this would write a file.
    path.write_bytes(b"cos\nsystem\n(S'touch opened'\ntR.")
    with pytest.raises(InputError, match="a pickle, which is never opened"):
        opened(path)
    assert [each.name for each in tmp_path.iterdir()] == [path.name]


def records() -> list[dict[str, Any]]:
    made = run()
    return [
        {
            "stamp": made.time[index],
            "state": {"q": made.position[index].tolist(), "tau": made.torque[index].tolist()},
            "mode": "run",
        }
        for index in range(len(made.time))
    ]


def test_json_lines_and_a_last_line_that_is_cut_off(tmp_path: Path) -> None:
    path = tmp_path / "run.jsonl"
    path.write_text("\n".join(json.dumps(record) for record in records()) + '\n{"stamp": 1.')
    assert_read(opened(path).recording, run(), ["torque"])


def test_a_list_of_objects(tmp_path: Path) -> None:
    path = tmp_path / "run.json"
    path.write_text(json.dumps(records(), indent=1))
    assert_read(opened(path).recording, run(), ["torque"])


def test_bams_entries_of_a_servo(tmp_path: Path) -> None:
    made = run(1)
    entries = [
        {
            "position": made.position[index, 0],
            "speed": made.velocity[index, 0],
            "load": round(500 * np.sin(20 * made.time[index])),
            "input_volts": 15.1,
            "temp": 31,
            "timestamp": made.time[index],
            "goal_position": made.reference[index, 0],
            "torque_enable": True,
        }
        for index in range(len(made.time))
    ]
    path = tmp_path / "run.json"
    path.write_text(json.dumps({"mass": 0.5, "length": 0.1, "kp": 32, "motor": "xl330", "entries": entries}))
    recording = opened(path, joints_named(["servo"])).recording
    np.testing.assert_allclose(recording.position, made.position)
    np.testing.assert_allclose(recording.velocity, made.velocity)
    np.testing.assert_allclose(recording.reference_position, made.reference)
    assert recording.duty is not None
    np.testing.assert_allclose(recording.duty[:, 0], [entry["load"] / 1000 for entry in entries])
    assert recording.voltage is None
    assert recording.provenance["recorded_kp"] == 32
    assert recording.provenance["recorded_mass"] == 0.5


def lerobot(folder: Path, names: Any, episodes: int) -> Path:
    """A data file of a LeRobot data set: one list a row, degrees, a gripper last."""
    made = run()
    meta = {"robot_type": "so101", "fps": int(RATE), "features": {}}
    for feature in ("observation.state", "action"):
        meta["features"][feature] = {"dtype": "float32", "shape": [3], "names": names}
    (folder / "meta").mkdir(parents=True)
    (folder / "meta" / "info.json").write_text(json.dumps(meta))
    gripper = np.full((len(made.time), 1), 50.0)
    state, action = (
        np.hstack([np.degrees(each), gripper]).tolist() for each in (made.position, made.reference)
    )
    rows: dict[str, list[Any]] = {
        "observation.state": state * episodes,
        "action": action * episodes,
        "timestamp": made.time.tolist() * episodes,
        "frame_index": list(range(len(made.time))) * episodes,
        "episode_index": [episode for episode in range(episodes) for _ in made.time],
    }
    path = folder / "data" / "chunk-000" / "file-000.parquet"
    path.parent.mkdir(parents=True)
    types = {"observation.state": pa.list_(pa.float64(), 3), "action": pa.list_(pa.float64())}
    pq.write_table(pa.table({name: pa.array(each, types.get(name)) for name, each in rows.items()}), path)
    return path


@pytest.mark.parametrize(
    "names",
    [
        [f"{joint}.pos" for joint in (*JOINTS, "gripper")],
        {"motors": [f"main_{joint}" for joint in (*JOINTS, "gripper")]},
        None,
    ],
    ids=["version 3", "version 2", "no names"],
)
def test_lerobots_parquet(tmp_path: Path, names: Any) -> None:
    found = opened(lerobot(tmp_path, names, 1))
    assert_read(found.recording, run(), ["reference"])
    assert found.recording.robot == "so101"
    assert found.guess is not None
    assert any("gripper" in line or "[2]" in line for line in found.guess.left_out)


def test_episodes_are_runs_of_their_own(tmp_path: Path) -> None:
    path = lerobot(tmp_path, [f"{joint}.pos" for joint in (*JOINTS, "gripper")], 3)
    runs = Door(arm_joints()).runs(path)
    assert [each.recording.provenance["episode"] for each in runs] == [0, 1, 2]
    for each in runs:
        assert_read(each.recording, run(), ["reference"])
    with pytest.raises(InputError, match="3 runs"):
        opened(path)


def test_scalar_columns_and_stamps_of_parquet(tmp_path: Path) -> None:
    made = run()
    stamps = 1_700_000_000_000_000_000 + np.round(1e9 * made.time).astype(np.int64)
    rows: dict[str, Any] = {"stamp": pa.array(stamps, pa.timestamp("ns"))}
    for index, joint in enumerate(JOINTS):
        rows[f"{joint}_position"] = made.position[:, index]
        rows[f"{joint}_effort"] = made.torque[:, index].tolist()
    rows["label"] = ["free motion"] * len(made.time)
    path = tmp_path / "run.parquet"
    pq.write_table(pa.table(rows), path)
    assert_read(opened(path).recording, made, ["torque"])
