"""How often the 95 % intervals of drives' figures hold.

    python -m studies.drives.coverage FOLDER [CASES] [RATE] [GAINS]

Each case is the leg with links, rotors, friction, gains and delays drawn about its model, recorded with
12-bit encoders; the gains are stated up to 30 % wrong: ``apart``, kp and kd each by itself, and their ratio
is stated to be as uncertain; or ``together``, their ratio within 3 %, as is taken where nothing is stated.
The folder keeps each case: a second call resumes.
"""

import sys
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.output_error.plant import DELAY, KD_SCALE, KP_SCALE, plant_table
from identification.output_error.servo_run import ServoRun
from identification.parameters import (
    ARMATURE,
    COULOMB,
    INERTIAL,
    MASS,
    PER_JOINT,
    VISCOUS,
    inertial_parameters,
    pseudo_inertia,
)
from testbench.drives.identified import identify_drives
from testbench.drives.stated import RATIO_SPREAD, Servo
from testbench.robot import Robot, load_robot

from ..cases import run_cases
from .leg import KD, KP, recorded, written

Array = NDArray[np.float64]

# A uniform draw of this half-width has the deviation that is stated.
WRONG_GAINS = 0.3
SPREAD = WRONG_GAINS / np.sqrt(3)
INTERVAL = 1.96
# Relative deviation of kd over kp as it is stated, by how the gains are wrong.
RATIO = {"apart": SPREAD * np.sqrt(2), "together": RATIO_SPREAD}


def drawn(robot: Robot, rng: np.random.Generator, gains: str) -> Array:
    """A plant (n, WIDTH) about the leg's model, its links and rotors within the widths of ``prior.py``.

    gains: a key of RATIO.
    """
    table = robot.parameters.reshape(robot.joints, PER_JOINT).copy()
    for row in table:
        pseudo = pseudo_inertia(row[:INERTIAL])
        centre = pseudo[:3, 3] / row[MASS]
        second = pseudo[:3, :3] - row[MASS] * np.outer(centre, centre)
        mass = row[MASS] * (1 + 0.1 * rng.standard_normal())
        second = second * max(0.3, 1 + 0.2 * rng.standard_normal())
        moved = centre + 0.02 * rng.standard_normal(3)
        row[:INERTIAL] = inertial_parameters(mass, moved, np.trace(second) * np.eye(3) - second)
    n = robot.joints
    table[:, ARMATURE] = rng.uniform(0.005, 0.04, n)
    table[:, VISCOUS] = rng.uniform(0.05, 0.4, n)
    table[:, COULOMB] = rng.uniform(0.05, 0.5, n)
    plant = plant_table(table.ravel(), rng.uniform(0.0, 0.03, n), robot.limits.torque)
    plant[:, [KP_SCALE, KD_SCALE]] = 1 + rng.uniform(-WRONG_GAINS, WRONG_GAINS, (n, 2))
    if gains == "together":
        plant[:, KD_SCALE] = plant[:, KP_SCALE] + RATIO_SPREAD * rng.standard_normal(n)
    return plant


def case(seed: int, rate: float, gains: str, model: Path) -> dict[str, Any]:
    """Error over deviation of every figure of one drawn leg, by name and joint."""
    robot, rng = load_robot(model), np.random.default_rng([seed, round(rate)])
    plant = drawn(robot, rng, gains)
    log = recorded(model, rate=rate, duration=20.0, seed=seed, plant=plant)
    assert log.reference_position is not None
    full = np.ones(robot.joints)
    stated = SPREAD * full, 0 * full, 0.05 * full, robot.limits.torque, 0 * full
    servo = Servo(KP, KD, *stated, ratio_spread=RATIO[gains])
    found = identify_drives(
        robot, [servo], [ServoRun("run", log.position, log.reference_position, rate, KP, KD)]
    )
    columns = {"armature": ARMATURE, "viscous": VISCOUS, "coulomb": COULOMB, "kp_scale": KP_SCALE}
    truth = {name: plant[:, column] for name, column in columns.items()}
    truth |= {"kd_scale": plant[:, KD_SCALE], "delay": plant[:, DELAY]}
    truth["damping"] = plant[:, VISCOUS] + KD * plant[:, KD_SCALE]
    names = robot.joint_names
    return {
        f"{each.name} {each.joint}": (each.value - float(truth[each.name][names.index(each.joint)]))
        / each.std
        for each in found.figures
        if each.name in truth
    }


def main(folder: Path, cases: int = 30, rate: float = 100.0, gains: str = "apart") -> None:
    """Run the study and print how many intervals hold, by figure."""
    folder.mkdir(parents=True, exist_ok=True)
    model = written(folder)
    work = partial(_numbered, rate, gains, model)
    results = run_cases(work, {f"{gains}_{rate:g}_{seed}": seed for seed in range(cases)}, folder)
    errors: dict[str, list[float]] = {}
    for result in results:
        for name, error in result.items():
            errors.setdefault(name.split()[0], []).append(error)
    pooled = [error for own in errors.values() for error in own]
    for name, own in (*errors.items(), ("all", pooled)):
        held = float(np.mean(np.abs(own) <= INTERVAL))
        print(f"{name:10} {held:6.1%} of {len(own)}, deviation of error/σ {np.std(own):.2f}")


def _numbered(rate: float, gains: str, model: Path, seed: int) -> dict[str, Any]:
    return case(seed, rate, gains, model)


if __name__ == "__main__":
    given = sys.argv[1:]
    main(Path(given[0]), *(kind(text) for kind, text in zip((int, float, str), given[1:], strict=False)))
