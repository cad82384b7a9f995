"""A drive that two joints share stands still while they turn against each other, whatever holds it."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from diagnosis.data.preparation import prepare
from diagnosis.data.run import DEAD_ZONE
from diagnosis.decision.attribution import Attribution
from diagnosis.search.growth import attribute
from testbench.effects.logged import logged_run
from testbench.log import Recording
from testbench.robot import Robot
from testbench.simulation import SensorOptions, SimulationOptions, simulate
from testbench.simulation.reference import Reference

from ...diagnosed import RATE
from ..standing import MOVES, RUNS, SEED, move

VISCOUS, COULOMB, WIDTH, NOISE = 0.5, 0.6, 0.02, 0.01
# Cycles a second and rad of the joints against each other, whatever their sum does.
SWINGS = ((0.31, 0.8), (0.83, 0.25), (1.7, 0.08))


def _runs(arm: Robot, sticks: bool) -> dict[str, Recording]:
    """Runs whose joints' sum moves and stands in turn while their difference swings, beside shared friction.

    sticks: whether what holds the drive is anything within its Coulomb friction, not that of a slow slide.
    """
    rng, references = np.random.default_rng(SEED), []
    for _ in range(RUNS):
        sums = np.concatenate(
            [move(a, b) for a, b in pairwise(rng.uniform(-1.0, 1.0, (MOVES + 1, 1)))], axis=1
        )
        references.append(Reference(*_of_both(sums, _swings(sums.shape[1], rng.uniform(0, 2 * np.pi, 3)))))
    options = SimulationOptions(
        sensors=SensorOptions(encoder_bits=20, torque_noise=NOISE), physics_timestep=5e-4
    )
    runs = {}
    for index, run in enumerate(simulate(arm, references, options, seed=SEED)):
        speed = logged_run(arm, run, arm.parameters, 80.0).dq.sum(axis=1)
        direction = np.tanh(speed / WIDTH)
        if sticks:
            held = np.repeat(rng.uniform(-1, 1, len(speed) // 100 + 1), 100)[: len(speed)]
            direction = np.where(np.abs(speed) > DEAD_ZONE / 2, np.sign(speed), held)
        shared = VISCOUS * speed + COULOMB * direction
        runs[f"run_{index + 1}"] = replace(run, torque=run.torque + shared[:, None])
    return runs


def _swings(samples: int, phases: np.ndarray) -> np.ndarray:
    """Position, velocity and acceleration (3, N, 1) of the difference."""
    time, found = np.arange(samples) / RATE, np.zeros((3, samples, 1))
    for (frequency, size), phase in zip(SWINGS, phases, strict=True):
        w = 2 * np.pi * frequency
        waves = (np.sin, np.cos, lambda x: -np.sin(x))
        for order, wave in enumerate(waves):
            found[order, :, 0] += size * w**order * wave(w * time + phase)
    return found


def _of_both(sums: np.ndarray, differences: np.ndarray) -> np.ndarray:
    """The two joints (3, N, 2) of a sum and a difference."""
    return np.concatenate([sums + differences, sums - differences], axis=2) / 2


@pytest.fixture(scope="module")
def sticking(arm: Robot) -> Attribution:
    return attribute(prepare(arm, _runs(arm, sticks=True)))


def test_a_shared_drive_that_sticks_is_found_by_where_it_slides(sticking):
    (item,) = [a for a in sticking.accepted if a.named]
    assert item.candidate.place[:2] == ("joint_coupling", 0)
    assert sticking.prepared.standing == {(0, 1)}


def test_its_friction_is_found_to_what_noise_allows(sticking):
    place = next(k for k, a in enumerate(sticking.accepted) if a.named)
    own = sticking.hypothesis.parts[place]
    viscous, coulomb = sticking.fitted.values[own][:2]
    deviations = np.sqrt(np.diag(sticking.fitted.covariance)[own])
    assert abs(viscous - VISCOUS) < 4 * deviations[0]
    assert abs(coulomb - COULOMB) < 4 * deviations[1]


def test_where_its_law_holds_at_rest_all_samples_count(arm):
    assert attribute(prepare(arm, _runs(arm, sticks=False))).prepared.standing == frozenset()
