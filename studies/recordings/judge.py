"""One split of a recording through the same doors as a user: diagnose, predict, compare with the log."""

import json
import subprocess
import sys
import time
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory

import h5py
import mujoco
import numpy as np
from numpy.typing import NDArray

from identification.filtering import zero_phase_lowpass
from testbench.log import read_log

from .plan import Split

Array = NDArray[np.float64]

# Hz: torque that is predicted and measured is compared below it.
CUTOFF = 20.0
# s: a diagnosis that takes longer counts as hanging.
PATIENCE = 600.0
# A stated probability from which a wrong name counts.
STATED = 0.5
ANY = "any"
# Of an error that is printed with four digits.
ROUNDING = 5e-4


@dataclass(frozen=True)
class Outcome:
    """Result of the diagnosis and the correction on one split of a recording.

    error: the program's line where it failed, or empty. warnings: lines on stderr of a run that succeeded.
    log_warnings: codes of the checks' warnings about the fitted logs.
    given, parameters, effects: RMS torque error on the held-out run by the model given, re-identified and
    with effects, both sides low-passed at CUTOFF, as a share of the RMS torque of all joints. unfiltered:
    the last of them without the low-pass. named: (effect, joint, probability). heaviest: the heaviest link
    of corrected.xml over the model's.
    """

    recording: str
    title: str
    error: str = ""
    warnings: tuple[str, ...] = ()
    verdict: str = ""
    sentence: str = ""
    log_warnings: tuple[str, ...] = ()
    given: float = float("nan")
    parameters: float = float("nan")
    effects: float = float("nan")
    unfiltered: float = float("nan")
    named: tuple[tuple[str, str, float], ...] = ()
    heaviest: float = float("nan")
    seconds: float = float("nan")

    @property
    def worse_by(self) -> float:
        """The most by which a column exceeds the one before it; 0 within the rounding of what is printed.

        Infinite where a column is no number.
        """
        columns = np.nan_to_num([self.given, self.parameters, self.effects], nan=np.inf)
        over = [after - before for before, after in pairwise(columns) if after > (1 + ROUNDING) * before]
        return float(max(over, default=0.0))


def judge(split: Split) -> Outcome:
    """Diagnose and predict in processes of their own; a crash, or a hang, is an outcome."""
    begin = time.perf_counter()
    with TemporaryDirectory() as folder:
        found, predicted = Path(folder) / "found", Path(folder) / "predicted.h5"
        names = [str(path) for path in split.fitted]
        warnings: list[str] = []
        for arguments in (
            ["diagnose", "--model", str(split.model), *names, "--out", str(found)],
            ["predict", "--diagnosis", str(found), str(split.held_out), "--out", str(predicted)],
        ):
            error, lines = _run(arguments)
            if error:
                return Outcome(split.recording, split.title, error)
            warnings += lines
        document = json.loads((found / "diagnosis.json").read_text(encoding="utf-8"))
        given, parameters, effects, unfiltered = _errors(split.held_out, predicted)
        return Outcome(
            recording=split.recording,
            title=split.title,
            warnings=tuple(warnings),
            verdict=document["verdict"],
            sentence=document.get("sentence", ""),
            log_warnings=tuple(
                dict.fromkeys(each["code"] for each in document["log_findings"] if each["severity"] == "warn")
            ),
            given=given,
            parameters=parameters,
            effects=effects,
            unfiltered=unfiltered,
            named=tuple(
                (each["effect"], each["joint"] or "", each["probability"]) for each in document["effects"]
            ),
            heaviest=_heaviest(found / "corrected.xml") / _heaviest(split.model),
            seconds=time.perf_counter() - begin,
        )


def wrong_names(split: Split, outcome: Outcome) -> list[str]:
    """The names stated at STATED or more that the owners know to be wrong."""
    wrong = set(split.robot.wrong)
    return [
        f"{effect}:{joint}" if joint else effect
        for effect, joint, probability in outcome.named
        if probability >= STATED and wrong & {ANY, effect, f"{effect}:{joint}"}
    ]


def _run(arguments: list[str]) -> tuple[str, list[str]]:
    """A command's error ('' when it has none) and what else it wrote to stderr."""
    command = [sys.executable, "-W", "default", "-m", "testbench", *arguments]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE, check=False)
    except subprocess.TimeoutExpired:
        return f"{arguments[0]}: longer than {PATIENCE:g} s", []
    lines = [line for line in done.stderr.splitlines() if line.strip()]
    if done.returncode:
        return f"{arguments[0]}: exit {done.returncode}: {lines[-1] if lines else ''}", []
    return "", lines


def _errors(log: Path, predicted: Path) -> tuple[float, float, float, float]:
    """Errors by the model given, re-identified, with effects; the last also without the low-pass."""
    recording = read_log(log)
    with h5py.File(predicted, "r") as file:
        torques = [np.asarray(file[f"{name}/torque"]) for name in ("nominal", "parameters", "joint")]
    rate = recording.sample_rate
    inside = recording.time >= 0

    def low(values: Array) -> Array:
        return zero_phase_lowpass(values, rate, min(CUTOFF, 0.4 * rate))

    measured = low(recording.torque)
    scale = np.sqrt(np.sum(np.mean(measured[inside] ** 2, axis=0)))
    shares = [
        float(np.sqrt(np.sum(np.mean((low(each) - measured) ** 2, axis=0))) / scale) for each in torques
    ]
    raw = np.sqrt(np.sum(np.mean((torques[2] - recording.torque) ** 2, axis=0)))
    whole = np.sqrt(np.sum(np.mean(recording.torque**2, axis=0)))
    return shares[0], shares[1], shares[2], float(raw / whole)


def _heaviest(model: Path) -> float:
    """Mass of the heaviest body, kg."""
    return float(mujoco.MjModel.from_xml_path(str(model)).body_mass.max())
