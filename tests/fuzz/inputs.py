"""Good inputs of every kind that is read, small enough to be damaged by the thousand."""

import json
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from rosbags.rosbag2 import StoragePlugin

from diagnosis.correction.prediction import read_diagnosed
from recordings.door import Door
from recordings.readers.ros_messages import typestores
from studies.blind.scenario import load_blind_scenario
from studies.loop.scenario import load_loop_scenario
from testbench.excitation_file import read_trajectory
from testbench.log import Controller, Recording, read_log, write_log
from testbench.robot import load_robot
from testbench.scenario import load_scenario

from ..recordings.runs import run
from ..recordings.test_ros_bags import joint_states, write_bag
from ..small_arm import ARM, SCENARIO

SAMPLES = 150
LOOP = "name: small\nmodel: arm.xml\nrounds: 1\nfirst: {runs: 1, harmonics: 4, base_frequency: 0.25 Hz}\n"
BLIND = """
name: small
cases: {single: 1, pair: 0, triple: 0, none: 1, unknown: 0}
robots:
  - {model: arm.xml}
runs: {fewest: 2, most: 2, shortest: 4 s, longest: 4.5 s, sample_rates: [500]}
"""
MOTION = {
    "joint_names": ["shoulder", "elbow"],
    "trajectory": {
        "type": "fourier",
        "base_frequency": 0.25,
        "centre": [0.1, 0.2],
        "a": [[0.5, -0.5], [0.3, -0.3]],
        "b": [[0.4, -0.2], [0.2, -0.1]],
    },
}


@dataclass(frozen=True)
class Input:
    """A file that is read. name: of the file. content: a good one. read: what reads it."""

    name: str
    content: bytes
    read: Callable[[Path], Any]


def inputs(folder: Path) -> list[Input]:
    """Every kind of file, with what it needs beside it in ``folder``."""
    (folder / "arm.xml").write_text(ARM)
    motion = np.sin(np.linspace(0.0, 6.0, SAMPLES))[:, np.newaxis] * [1.0, 0.7]
    controller = Controller("pd", 250.0, np.ones(2), np.ones(2))
    log = Recording(
        "arm",
        ("shoulder", "elbow"),
        250.0,
        "hardware",
        np.arange(SAMPLES) / 250,
        motion,
        20 * motion,
        velocity=motion,
        controller=controller,
        provenance={"created": "2026-01-02T03:04:05+00:00", "seed": 7},
    )
    write_log(log, folder / "run.h5")
    return [
        Input("run.h5", (folder / "run.h5").read_bytes(), read_log),
        Input("model.xml", ARM.encode(), load_robot),
        Input("scenario.yaml", SCENARIO.encode(), load_scenario),
        Input("loop.yaml", LOOP.encode(), load_loop_scenario),
        Input("blind.yaml", BLIND.encode(), load_blind_scenario),
        Input("motion.json", json.dumps(MOTION).encode(), read_trajectory),
        Input(
            "diagnosis.json",
            json.dumps(_diagnosis(folder)).encode(),
            lambda path: read_diagnosed(path.parent),
        ),
        *_recordings(folder, log),
    ]


def _recordings(folder: Path, log: Recording) -> list[Input]:
    """The same run in other formats."""
    columns = {"time": log.time}
    for joint, name in enumerate(log.joint_names):
        columns |= {f"q_{name}": log.position[:, joint], f"tau_{name}": log.torque[:, joint]}
    rows = np.column_stack(list(columns.values())).round(6).tolist()
    lines = [",".join(columns), *(",".join(map(str, row)) for row in rows)]
    records = [json.dumps(dict(zip(columns, row, strict=True))) for row in rows]
    np.savez(folder / "run.npz", **columns)
    pq.write_table(pa.table(columns), folder / "run.parquet")
    made = {
        "run.csv": "\n".join(lines).encode(),
        "run.jsonl": "\n".join(records).encode(),
        "run.npz": (folder / "run.npz").read_bytes(),
        "run.parquet": (folder / "run.parquet").read_bytes(),
    }
    store = typestores()[0]
    for plugin in StoragePlugin:
        bag = write_bag(folder / plugin.name, store, joint_states(store, run())[:60], plugin)
        (file,) = (each for each in bag.iterdir() if each.suffix != ".yaml")
        made[f"run{file.suffix}"] = file.read_bytes()
        shutil.rmtree(bag)
    return [Input(name, content, lambda path: Door(None).runs(path)) for name, content in made.items()]


def _diagnosis(folder: Path) -> dict[str, Any]:
    robot = load_robot(folder / "arm.xml")
    n, chain = robot.joints, robot.chain
    standard = robot.parameters.tolist()
    term = {
        "effect": "payload",
        "joint": None,
        "into": None,
        "shape": {},
        "coefficients": [1.0],
        "carried": False,
    }
    return {
        "format": "gap-diagnosis",
        "correction": {
            "chain": {
                "joint_names": list(chain.joint_names),
                "is_slide": chain.is_slide.tolist(),
                "rotation": chain.rotation.tolist(),
                "translation": chain.translation.tolist(),
                "gravity": chain.gravity.tolist(),
                "springs": chain.springs.tolist(),
            },
            "limits": {name: [None] * n for name in ("lower", "upper", "velocity", "acceleration", "torque")},
            "nominal": standard,
            "coulomb_smoothing": [0.0] * n,
            "coulomb_lead": 0.0,
            "lag": {"delay": 0.0, "order": 0, "time_constant": 0.0},
            "zeros": [0.0] * n,
            "parameters": {"standard": standard, "timing": 0.0},
            "effects": {"standard": standard, "timing": 0.0, "linearised_at": standard, "terms": [term]},
            "last_body": {"rotation": np.eye(3).tolist(), "origin": [0.0, 0.0, 0.0]},
        },
    }
