"""BAM's models M1 to M6, fitted and simulated by its own program: the package better-actuator-models.

It asks for Python 3.12: an interpreter that has it, with optuna below 4.4 (whose CMA-ES still restarts), is
named by the environment.
"""

import json
import os
import subprocess
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from identification.output_error.servo_run import ServoRun

from ._servo_case import Case

Array = NDArray[np.float64]

# Names the interpreter.
PYTHON = "BAM_PYTHON"
MODELS = ("m1", "m2", "m3", "m4", "m5", "m6")
# Its own default is 100000; the best score changes in the fourth digit after some 1500.
TRIALS = 4000
# kg, m, V: of the recordings.
MASS, LENGTH, VOLTAGE = 0.49, 0.1, 7.4
SIMULATE = """
import json, sys
import numpy as np
from bam.logs import Logs
from bam.model import load_model
from bam.simulate import Simulator
model, out = load_model(sys.argv[1]), {}
for log in Logs(sys.argv[2]).logs:
    position, _, _ = Simulator(model).rollout_log(log, simulate_control=True)
    times = [entry["timestamp"] for entry in log["entries"]]
    out[log["trajectory"]] = [times, [float(each) for each in position]]
json.dump(out, sys.stdout)
"""


def fitted(case: Case, model: str, folder: Path) -> tuple[Path, str]:
    """The parameters' file of a model, fitted in a folder."""
    logs, found = _processed(case.fitted, folder / "fit"), folder / f"{model}.json"
    _bam("-m", "bam.fit", "--actuator", "xl330", "--model", model, "--logdir", logs,
         "--trials", str(TRIALS), "--output", found)  # fmt: skip
    return found, f"{model.upper()} by bam.fit, {TRIALS} trials"


def predicted(case: Case, parameters: Path, folder: Path) -> list[Array]:
    """Positions (N, 1) of the judging runs by BAM's own simulator, at their own samples."""
    said = json.loads(_bam("-c", SIMULATE, parameters, _processed(case.judged, folder / "judge")))
    out = []
    for run in case.judged:
        times, position = said[run.name]
        out.append(np.interp(np.arange(len(run.position)) / run.rate, times, position)[:, None])
    return out


def is_there() -> bool:
    """Whether the environment names an interpreter."""
    return PYTHON in os.environ


def _bam(*arguments: str | Path) -> str:
    command = [os.environ[PYTHON], *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout


def _processed(runs: tuple[ServoRun, ...], folder: Path) -> Path:
    """The runs as BAM records them, processed by its own program to its own step of 5 ms."""
    raw, logs = folder / "raw", folder / "processed"
    for each in (raw, logs):
        each.mkdir(parents=True, exist_ok=True)
    for run in runs:
        velocity = run.smoothed[1]
        entries = [
            {
                "timestamp": sample / run.rate,
                "position": float(run.position[sample, 0]),
                "speed": float(velocity[sample, 0]),
                "goal_position": float(run.command[sample, 0]),
                "torque_enable": True,
            }
            for sample in range(len(run.position))
        ]
        gain = int(run.name.rsplit("kp", 1)[1])
        recorded = {
            "mass": MASS, "arm_mass": 0.0, "length": LENGTH, "vin": VOLTAGE, "kp": gain,
            "motor": "xl330", "trajectory": run.name, "entries": entries,
        }  # fmt: skip
        (raw / f"{run.name}.json").write_text(json.dumps(recorded))
    _bam("-m", "bam.process", "--raw", raw, "--logdir", logs)
    return logs
