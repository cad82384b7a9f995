"""A joint that warms through all runs of one clock: its cooling between them shows its time constant."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.data.preparation import prepare
from diagnosis.diagnose import diagnose
from diagnosis.fit.likeliest_shapes import at_likeliest_shape
from diagnosis.fit.normal_equations import fitted_to
from diagnosis.model.base_regressor import BaseRegressor
from diagnosis.model.candidates import candidates
from testbench.log import Recording
from testbench.robot import Robot

from ...diagnosed import RATE, simulated_runs

ELBOW, VISCOUS, COULOMB = 1, 1.0, 1.0
DROP, PAUSE = 0.5, 10.0


@pytest.fixture(scope="module")
def cold(arm: Robot) -> dict[str, Recording]:
    return simulated_runs(arm, [], runs=8)


def _warmed(cold: dict[str, Recording], time_constant: float) -> dict[str, Recording]:
    """The runs one after the other, with a rest between, less what warmth takes off the elbow's friction."""
    speeds = [np.gradient(run.position[:, ELBOW], 1 / RATE) for run in cold.values()]
    power = float(np.mean(np.concatenate([VISCOUS * v**2 + COULOMB * np.abs(v) for v in speeds])))
    start, warm, runs = 0.0, 0.0, {}
    for (name, run), speed in zip(cold.items(), speeds, strict=True):
        lost = np.empty(len(speed))
        for k, v in enumerate(speed):
            lost[k] = DROP * warm * VISCOUS * v
            heat = VISCOUS * v**2 + COULOMB * abs(v) - lost[k] * v
            warm += (heat / power - warm) / (RATE * time_constant)
        torque = run.torque.copy()
        torque[:, ELBOW] -= lost
        runs[name] = replace(run, time=run.time + start, torque=torque, torque_command=None)
        start, warm = float(runs[name].time[-1]) + PAUSE, warm * np.exp(-PAUSE / time_constant)
    return runs


@pytest.mark.parametrize("time_constant", [30.0, 150.0])
def test_a_rest_between_runs_tells_the_time_constant(arm, cold, time_constant):
    found = diagnose(arm, _warmed(cold, time_constant))
    assert [(each.effect, each.joint) for each in found.effects] == [("thermal_friction_drift", ELBOW)]
    quantity = found.effects[0].parameters["time_constant"]
    assert abs(quantity.value - time_constant) < 3 * quantity.std
    assert quantity.std < 0.3 * time_constant


def test_the_way_it_warms_is_chosen_again_beside_all_that_acts(arm, cold):
    """Taken in as warming by the clock, at work through every rest: it warms by heat, and rests."""
    prepared = prepare(arm, _warmed(cold, 30.0))
    (taken_in,) = (
        each
        for each in candidates(prepared, only=["thermal_friction_drift"])
        if each.family.joint == ELBOW and _shape(each.member.shape) == (20.0, 1.0, 0.0)
    )
    found = at_likeliest_shape(arm, *fitted_to(BaseRegressor(prepared), [taken_in]), 0)
    time_constant, even, paused = _shape(found.member.shape)
    assert (even, paused) == (0.0, 1.0)
    assert time_constant == pytest.approx(30.0, rel=0.2)


def _shape(shape: dict[str, float]) -> tuple[float, float, float]:
    return shape["time_constant"], shape["even"], shape["paused"]
