"""The logs on which servos' identifications compete: a leg robot and a hobby servo, recorded on hardware."""

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from identification.output_error.servo_run import ServoRun
from testbench.drives.identified import split
from testbench.drives.reading import ServoLog, read_servo_logs
from testbench.drives.stated import Servo, StatedDrive
from testbench.model_reading.reading import Choice
from testbench.robot import Robot, load_robot

Array = NDArray[np.float64]

# Names the folder of recordings: go2/ and xl330/ in it.
FOLDER = "SERVO_RECORDINGS"
# Of the hobby servo: fitted motions and gains; s after which lift_and_drop has the drive off.
FITTED = ("sin_sin_kp100", "sin_sin_kp800", "sin_time_square_kp100", "sin_time_square_kp800")
OFF_AFTER = 2.0
# Of the hobby servo's data sheet, at 7.4 V: stall torque N·m, and N·m/rad of one unit of the firmware's kp.
STALL = 0.52 * 7.4 / 5
FACTOR = STALL * 4096 / (2 * np.pi) / (256 * 885)


@dataclass(frozen=True)
class Case:
    """Runs that are fitted and runs that judge, of servos as stated. bounds: of PACE's search."""

    name: str
    robot: Robot
    servo: Servo
    fitted: tuple[ServoRun, ...]
    judged: tuple[ServoRun, ...]
    effects: tuple[str, ...]
    bounds: "Bounds"


@dataclass(frozen=True)
class Bounds:
    """Highest armature kg·m², damping N·m·s/rad, friction N·m; bias ± rad; delay in samples."""

    armature: float
    damping: float
    friction: float
    bias: float = 0.1
    delay: float = 5.0


def cases() -> tuple[Case, ...]:
    """Both cases, from the folder that the environment names."""
    folder = Path(os.environ[FOLDER])
    return _go2(folder / "go2"), _xl330(folder / "xl330")


def _go2(folder: Path) -> Case:
    """The first half of the chirp is fitted, the second judges; PACE's bounds are those of its own Go2."""
    robot = load_robot(folder / "go2.xml", Choice(fix_base=True))
    stated = StatedDrive(kp=20, kd=1.5, delay=(0, 0.05))
    log = read_servo_logs([folder / "air_chirp.npz"], robot, stated)[0]
    first, second = split(log.run, 0.5)
    effects = ("position_dependent_friction",)
    return Case("go2", robot, log.servo, (first,), (second,), effects, Bounds(1.0, 7.0, 1.0))


def _xl330(folder: Path) -> Case:
    """Two motions at two gains are fitted; all other motions and gains judge, while the drive is on.

    PACE's bounds are those of BAM for this servo. The servo is as its data sheet has it: 0.52 N·m and 1.47 A
    at stall and 103 rev/min without load at 5 V, here at 7.4 V; 1.75 A at most; a duty of kp / 256 / 885 for
    a count of 4096.
    """
    robot = load_robot(folder / "nominal.xml")
    paths = sorted(folder.glob("*.h5"))
    stated = StatedDrive(
        kp={path.stem: float(path.stem.rsplit("kp", 1)[1]) for path in paths},
        factor=FACTOR,
        spread=0.3,
        delay=(0, 0.01),
        limit=0.52 / 1.47 * 1.75,
        limit_spread=0.3,
        stall=STALL,
        no_load_speed=103 / 60 * 2 * np.pi * 7.4 / 5,
        stall_spread=0.3,
    )
    logs = {log.path.stem: log for log in read_servo_logs(paths, robot, stated)}
    fitted = tuple(logs[name].run for name in FITTED)
    judged = tuple(_while_on(log) for name, log in logs.items() if name not in FITTED)
    bounds = Bounds(0.05, 1.0, 0.2)
    effects = ("load_dependent_friction",)
    return Case("xl330", robot, logs[FITTED[0]].servo, fitted, judged, effects, bounds)


def _while_on(log: ServoLog) -> ServoRun:
    run = log.run
    last = round(OFF_AFTER * run.rate) if run.name.startswith("lift_and_drop") else len(run.position)
    return replace(run, position=run.position[:last], command=run.command[:last])


@dataclass(frozen=True)
class Rival:
    """Predictions of the judging runs by one way, (N, n) rad each, and its cost.

    seconds, processor: s of the fit, by the clock and of all processes. how: what was fitted, and when it
    stopped.
    """

    name: str
    predicted: Sequence[Array]
    seconds: float
    processor: float
    how: str


def rms_of(case: Case, rival: Rival) -> Array:
    """RMS (n,) rad of simulated less measured position, all judging runs pooled."""
    return np.asarray(np.sqrt(np.mean(np.concatenate(_missed(case, rival)) ** 2, axis=0)))


def mean_absolute(case: Case, rival: Rival) -> float:
    """Mean over the judging runs of the mean absolute error, rad."""
    return float(np.mean([np.mean(np.abs(each)) for each in _missed(case, rival)]))


def _missed(case: Case, rival: Rival) -> list[Array]:
    return [found - run.position for found, run in zip(rival.predicted, case.judged, strict=True)]
