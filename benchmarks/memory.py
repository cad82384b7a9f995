"""Memory of ``testbench identify`` and ``diagnose`` on long, fast and many logs, and how their time grows."""

import os
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from diagnosis.data.mended_log import rate_for
from diagnosis.data.preparation import prepare, thinned_by
from diagnosis.data.run import CUTOFF
from diagnosis.model.library import Library
from identification.base_parameters import base_parameters
from identification.filtering import decimation_step
from identification.inverse_dynamics import inverse_dynamics
from identification.observations import Preprocessing
from identification.parameters import DEFAULT_GROUPS
from testbench.log import Recording, write_log
from testbench.robot import Robot, load_robot

from ._arms import MODEL, ROOT
from ._report import Goal, Report

GIBIBYTES = 4.0
COMMAND = "from testbench.cli import main; main()"
# What a command imports, without any log.
EMPTY = (
    "import testbench.cli, testbench.jobs.identify, "
    "diagnosis.job, diagnosis.report.page, diagnosis.report.session"
)
# s of a motion that shows which effects have columns.
SHORT = 20.0
# s between two looks at the processes' memory.
PAUSE = 0.05
# A sum of sines of each joint: Hz, and their speeds in rad/s.
FREQUENCIES = np.array([0.11, 0.23, 0.37, 0.61, 0.97])
SPEED, NOISE, COUNT = 0.25, 0.01, 2 * np.pi / 2**19


@dataclass(frozen=True)
class Case:
    """Logs and the command that reads them. ten: a robot of ten joints, not of six."""

    what: str
    command: str
    ten: bool
    runs: int
    seconds: float
    rate: float


CASES = (
    Case("60 s at 10 kHz, ten joints", "identify", True, 1, 60.0, 10_000.0),
    Case("60 s at 10 kHz, ten joints", "diagnose", True, 1, 60.0, 10_000.0),
    Case("20 runs of 10 s at 1 kHz, ten joints", "diagnose", True, 20, 10.0, 1000.0),
    Case("half an hour at 500 Hz, six joints", "identify", False, 1, 1800.0, 500.0),
    Case("one hour at 500 Hz, six joints", "identify", False, 1, 3600.0, 500.0),
    Case("half an hour at 500 Hz, six joints", "diagnose", False, 1, 1800.0, 500.0),
    Case("one hour at 500 Hz, six joints", "diagnose", False, 1, 3600.0, 500.0),
)


def measure() -> Report:
    rows, largest = [], 0.0
    _, empty = watched([sys.executable, "-c", EMPTY])
    with tempfile.TemporaryDirectory() as name:
        for index, case in enumerate(CASES):
            folder = Path(name) / str(index)
            model, logs = made(case, folder)
            seconds, gibibytes = measured(case.command, model, logs, folder / "out")
            largest = max(largest, gibibytes)
            equations = _equations(load_robot(model), case)
            ratio = f"{(gibibytes - empty) / equations:.1f}"
            figures = f"{seconds:.0f}", f"{gibibytes:.2f}", f"{equations:.2f}", ratio
            rows.append((case.what, case.command, *figures))
            for log in logs:
                log.unlink()
    return Report(
        columns=("logs", "command", "s", "GiB", "equations, GiB", "ratio"),
        rows=tuple(rows),
        goals=(Goal("GiB of the largest", largest, GIBIBYTES, at_least=False),),
        notes=(
            "GiB: resident memory of the process and its children together, at its largest.",
            "equations: the decimated regressor along all runs, for diagnose with the columns of effects.",
            f"ratio: of all above the {empty:.2f} GiB that the program has without a log, to the equations.",
        ),
    )


def _equations(robot: Robot, case: Case) -> float:
    """GiB of the equations that are fitted."""
    seconds = case.runs * case.seconds
    if case.command == "identify":
        instants = seconds * case.rate / decimation_step(case.rate, Preprocessing().cutoff)
        return instants * robot.joints * base_parameters(robot.chain, DEFAULT_GROUPS).count * 8 / 2**30
    short = _recording(robot, replace(case, seconds=SHORT), np.random.default_rng(0))
    prepared, library = prepare(robot, {"short": short}), Library(())
    library.along(prepared)
    effects = [each for run in (*library.motions, *library.catalogue) for each in run.filtered]
    columns = sum(each[0].size for each in (*effects, *prepared.runs[0].rows))
    return columns * _kept(case, robot.joints) * 8 / 2**30


def _kept(case: Case, joints: int) -> float:
    """Samples that a diagnosis keeps of all runs."""
    seconds = case.runs * case.seconds
    rate = case.rate / max(round(case.rate / rate_for(joints, seconds)), 1)
    kept = seconds * rate / decimation_step(rate, CUTOFF)
    return kept / thinned_by(joints, kept)


def made(case: Case, folder: Path) -> tuple[Path, list[Path]]:
    """A model that is a little wrong, and logs of the right one along sums of sines."""
    folder.mkdir()
    model = MODEL
    if case.ten:
        model = folder / "ten.xml"
        model.write_text(_ten_joints())
    robot = load_robot(model)
    logs = []
    for run in range(case.runs):
        logs.append(folder / f"run_{run}.h5")
        write_log(_recording(robot, case, np.random.default_rng(run)), logs[-1])
    return model, logs


def _recording(robot: Robot, case: Case, random: np.random.Generator) -> Recording:
    n, time = robot.joints, np.arange(round(case.seconds * case.rate)) / case.rate
    position, velocity, acceleration = (np.zeros((len(time), n)) for _ in range(3))
    for joint in range(n):
        # No two joints move alike.
        for omega in 2 * np.pi * FREQUENCIES * random.uniform(0.8, 1.25, len(FREQUENCIES)):
            phase = omega * time + random.uniform(0, 2 * np.pi)
            position[:, joint] += SPEED / omega * np.sin(phase)
            velocity[:, joint] += SPEED * np.cos(phase)
            acceleration[:, joint] -= SPEED * omega * np.sin(phase)
    truth = robot.parameters * np.random.default_rng(99).uniform(0.8, 1.25, len(robot.parameters))
    torque = inverse_dynamics(robot.chain, truth, position, velocity, acceleration)
    torque += NOISE * np.sqrt(np.mean(torque**2, axis=0)) * random.standard_normal(torque.shape)
    position = np.round(position / COUNT) * COUNT
    return Recording(
        robot.name, robot.joint_names, case.rate, "hardware", time, position, torque, velocity=velocity
    )


def _ten_joints() -> str:
    """An MJCF of ten hinges one on the other, their axes by turns along z, y and x."""
    inside = ""
    for joint in reversed(range(10)):
        axis = ("0 0 1", "0 1 0", "1 0 0")[joint % 3]
        inside = (
            f'<body name="link_{joint + 1}" pos="0.05 0 0.15"><joint name="joint_{joint + 1}" axis="{axis}"'
            ' range="-3 3" armature="0.1" damping="1" frictionloss="2"/>'
            f'<inertial pos="0.02 0.01 0.08" mass="{3.0 - 0.25 * joint}" diaginertia="0.02 0.015 0.01"/>'
            f"{inside}</body>"
        )
    return f'<mujoco model="ten"><compiler angle="radian"/><worldbody>{inside}</worldbody></mujoco>'


def measured(command: str, model: Path, logs: list[Path], out: Path) -> tuple[float, float]:
    """Seconds of one command, and GiB of it and its children at the largest."""
    return watched([sys.executable, "-c", COMMAND, command, "--model", model, *logs, "--out", out])


def watched(line: Sequence[str | Path]) -> tuple[float, float]:
    """Seconds of a process, and GiB of it and its children at the largest."""
    start = time.perf_counter()
    process = subprocess.Popen(line, cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    most = [0.0]
    watch = threading.Thread(target=_watch, args=(process, most))
    watch.start()
    _, said = process.communicate()
    seconds = time.perf_counter() - start
    watch.join()
    if process.returncode:
        raise RuntimeError(f"{' '.join(map(str, line))} failed:\n{said.decode()}")
    return seconds, most[0] / 2**30


def _watch(process: subprocess.Popen[bytes], most: list[float]) -> None:
    while process.poll() is None:
        most[0] = max(most[0], sum(_resident(each) for each in _family(process.pid)))
        time.sleep(PAUSE)


def _family(pid: int) -> Iterator[int]:
    """The process and all that it has started. Needs Linux."""
    yield pid
    for task in Path(f"/proc/{pid}/task").glob("*/children"):
        try:
            children = task.read_text().split()
        # It has ended since.
        except OSError:
            continue
        for child in children:
            yield from _family(int(child))


def _resident(pid: int) -> int:
    """Bytes of memory that a process has; 0 once it has ended."""
    try:
        return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")
    except OSError:
        return 0
