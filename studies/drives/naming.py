"""How often the diagnosis of position servos names what acts, and what it names on robots in order.

    python -m studies.drives.naming FOLDER [SEEDS] [FIRST_SEED] [JOBS]

Each case is a leg or an arm drawn about its model, with small imperfections everywhere and one fault or none,
recorded with 12-bit encoders at 50, 100 or 200 Hz. The folder keeps each case: a second call resumes.
"""

import sys
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import binomtest

from diagnosis.servos.diagnose import diagnose_servos
from identification.output_error.plant import (
    DELAY,
    ENCODER_AFTER,
    EXTRA,
    GAP,
    KD_SCALE,
    KP_SCALE,
    STRIBECK_VELOCITY,
    plant_table,
)
from identification.output_error.servo_loop import Window, simulate
from identification.output_error.servo_run import ServoRun
from identification.parameters import COULOMB
from testbench.drives.stated import LONGEST_DELAY, Servo
from testbench.model_error import ModelError, nominal_parameters
from testbench.robot import Robot, load_robot

from ..cases import run_cases
from .arm import KINDS, Kind
from .leg import COUNT

Array = NDArray[np.float64]

RATES = (50.0, 100.0, 200.0)
FAULTS = (
    "gain_error",
    "command_delay",
    "backlash",
    "stiction",
    "torque_constant_error",
)
# Robots in order for each seed, robot and rate.
IN_ORDER = 2
DURATION = 15.0
# Of a joint in order: deviation of its gains, highest delay s, highest play rad, highest rise of Coulomb
# friction near rest.
GAINS, LATE, PLAY, RISE = 0.02, 0.002, 0.0005, 0.1
# Of faults: gains, delay s, play rad, torque constant; the rise of friction, in Coulomb's, and its velocity.
WRONG_GAIN, LONG_DELAY, WIDE_PLAY, WRONG_CONSTANT = 0.2, 0.02, np.radians(0.5), 0.3
STICTION, STRIBECK = (0.7, 2.0), (0.03, 0.15)
# Steps of the simulated robot, s: far finer than those of the fit.
STEP = 2.5e-4
FREQUENCIES = (0.15, 0.4, 0.9, 1.7, 2.8, 4.5)


def command(kind: Kind, rate: float, rng: np.random.Generator) -> Array:
    """Sums of sines of .15 to 4.5 Hz, (N, n) rad."""
    time = np.arange(round(DURATION * rate)) / rate
    waves = np.zeros((len(time), len(kind.kp)))
    for frequency in FREQUENCIES:
        phase = rng.uniform(0, 2 * np.pi, len(kind.kp))
        waves += 0.35 / (1 + frequency) * np.sin(2 * np.pi * frequency * time[:, None] + phase)
    return waves + kind.centre


def drawn(kind: Kind, robot: Robot, fault: str, rng: np.random.Generator) -> tuple[Array, int | None]:
    """A plant (n, WIDTH) with a fault, or none, and the joint of it; None for all."""
    n = robot.joints
    parameters = nominal_parameters(robot, ModelError(), int(rng.integers(2**31)))
    plant = plant_table(parameters, rng.uniform(0, LATE, n), robot.limits.torque)
    plant[:, [KP_SCALE, KD_SCALE]] += GAINS * rng.standard_normal((n, 2))
    plant[:, GAP], plant[:, ENCODER_AFTER] = rng.uniform(0, PLAY, n), kind.encoder_after
    plant[:, STRIBECK_VELOCITY] = rng.uniform(*STRIBECK, n)
    plant[:, EXTRA] = rng.uniform(0, RISE, n) * plant[:, COULOMB]
    joint, sign = int(rng.integers(n)), float(rng.choice((-1.0, 1.0)))
    if fault == "gain_error":
        plant[joint, KP_SCALE] *= 1 + sign * WRONG_GAIN
    elif fault == "torque_constant_error":
        plant[joint, [KP_SCALE, KD_SCALE]] *= 1 + sign * WRONG_CONSTANT
    elif fault == "command_delay":
        # A bus that is late is late for all; a slow servo is one.
        own = slice(None) if sign > 0 else slice(joint, joint + 1)
        plant[own, DELAY] = LONG_DELAY
        return plant, None if sign > 0 else joint
    elif fault == "backlash":
        plant[joint, GAP] = WIDE_PLAY
    elif fault == "stiction":
        plant[joint, EXTRA] = rng.uniform(*STICTION) * plant[joint, COULOMB]
    return plant, joint


def case(models: dict[str, Path], drawn_as: tuple[str, float, str, int]) -> dict[str, Any]:
    """What was said of one robot. drawn_as: robot, rate, fault, seed."""
    name, rate, fault, seed = drawn_as
    kind = next(each for each in KINDS if each.name == name)
    robot = load_robot(models[name])
    places = [each.name for each in KINDS].index(name), round(rate), ("none", *FAULTS).index(fault)
    rng = np.random.default_rng([*places, seed])
    plant, joint = drawn(kind, robot, fault, rng)
    follow, n = command(kind, rate, rng), robot.joints
    window = Window(follow, kind.kp, kind.kd, 0, len(follow), follow[0], np.zeros(n))
    ((run,),) = simulate(robot.chain, plant[None], [window], rate, threads=1, step=STEP)
    position = np.round(run.position / COUNT) * COUNT
    full = np.ones(n)
    servo = Servo(
        kind.kp, kind.kd, 0.03 * full, 0 * full, LONGEST_DELAY * full, robot.limits.torque, 0 * full
    )
    found = diagnose_servos(
        robot, [servo], [ServoRun("run", position, follow, rate, kind.kp, kind.kd)], threads=1
    )
    truth = None if joint is None else robot.joint_names[joint]
    return {
        "robot": name,
        "rate": rate,
        "fault": fault,
        "seed": seed,
        "joint": truth,
        "verdict": found.verdict,
        "stated": [[each.effect, each.joint, each.probability] for each in found.effects],
        "likeliest": [[each.effect, each.joint, each.probability] for each in found.candidates[:3]],
        "right": [[each.effect, each.joint] for each in found.effects] == [[fault, truth]],
    }


def main(folder: Path, seeds: int = 1, first: int = 1000, jobs: int | None = None) -> None:
    """Run the study and print what was named, by fault."""
    folder.mkdir(parents=True, exist_ok=True)
    models = {kind.name: kind.written(folder) for kind in KINDS}
    cases = {
        f"{kind.name}_{rate:g}_{fault}_{seed}": (kind.name, rate, fault, seed)
        for seed in range(first, first + seeds * IN_ORDER)
        for rate in RATES
        for kind in KINDS
        for fault in (*FAULTS, "none")
        if fault == "none" or seed < first + seeds
    }
    results = run_cases(partial(case, models), cases, folder, jobs)
    print(table(results))


def table(results: list[dict[str, Any]]) -> str:
    """A row a fault: cases, named right, wrong, nothing named, with 95 % intervals over all faults."""
    lines = ["| fault | robots | right | wrong | nothing stated |", "| --- | --- | --- | --- | --- |"]
    for fault in (*FAULTS, "none"):
        lines.append(_row(fault, [each for each in results if each["fault"] == fault]))
    lines.append(_row("all faults", [each for each in results if each["fault"] != "none"]))
    for rate in RATES:
        own = [each for each in results if each["fault"] != "none" and each["rate"] == rate]
        lines.append(_row(f"all at {rate:g} Hz", own))
    return "\n".join(lines)


def _row(label: str, results: list[dict[str, Any]]) -> str:
    count = len(results)
    right = sum(each["right"] for each in results)
    silent = sum(not each["stated"] for each in results)
    shares = [_share(part, count) for part in (right, count - right - silent, silent)]
    return f"| {label} | {count} | {shares[0] if label != 'none' else '–'} | {shares[1]} | {shares[2]} |"


def _share(part: int, count: int) -> str:
    """A share with its 95 % interval (Clopper & Pearson)."""
    if count == 0:
        return "–"
    low, high = binomtest(part, count).proportion_ci()
    return f"{part / count:.0%} ({low:.0%} to {high:.0%})"


if __name__ == "__main__":
    given = sys.argv[1:]
    main(Path(given[0]), *(int(text) for text in given[1:]))
