"""The noise floor: what noise of the sensors passes the filters, and nothing that the robot does."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt

from diagnosis.data.preparation import prepare
from diagnosis.data.run import Prepared
from diagnosis.model.base_regressor import BaseRegressor
from diagnosis.residual.noise import noise
from testbench.log import Recording
from testbench.robot import Robot
from testbench.simulation import SensorOptions, SimulationOptions

from ..standing import standing_runs

# Share of each joint's torque limit.
NOISE = 0.001


def _recorded(arm: Robot, **sensors: float) -> dict[str, Recording]:
    options = SimulationOptions(sensors=SensorOptions(torque_noise=NOISE, **sensors), physics_timestep=5e-4)
    return standing_runs(arm, options)


def _passed(prepared: Prepared) -> np.ndarray:
    """RMS (n,) N·m that white noise of the torque has behind the filters."""
    gain = [np.sqrt(np.sum(each.taps**2)) for each in prepared.runs[0].filters]
    return NOISE * prepared.robot.limits.torque * np.array(gain)


def test_white_noise_of_the_torque_is_the_floor(arm):
    prepared = prepare(arm, _recorded(arm))
    # By chance .6 % (three runs of 85 segments, 42 frequencies), and some corner fits a white spectrum best.
    assert noise(BaseRegressor(prepared)).seen.all()
    assert noise(BaseRegressor(prepared)).rms == pytest.approx(_passed(prepared), rel=0.05)


def test_torque_that_is_zero_at_rest_has_the_floor_of_what_was_measured(arm):
    recorded = _recorded(arm)

    def rested(run: Recording) -> Recording:
        # A torque reported as exactly 0 in two thirds of the run.
        torque = run.torque.copy()
        torque[len(torque) // 3 :] = 0.0
        return replace(run, torque=torque)

    prepared = prepare(arm, {name: rested(run) for name, run in recorded.items()})
    assert noise(BaseRegressor(prepared)).rms == pytest.approx(_passed(prepared), rel=0.2)


def test_noise_of_encoders_far_above_the_motion_is_no_floor(arm):
    """Differentiated twice it is most of the residual at 40 Hz, and next to nothing below the low-pass."""
    prepared = prepare(arm, _recorded(arm, encoder_bits=18))
    # The drive answers the encoders, too: that torque is real, and white.
    assert np.all(noise(BaseRegressor(prepared)).rms < 2 * _passed(prepared))


def test_torque_that_was_low_passed_hides_its_noise(arm):
    low_passed = {
        name: replace(
            run, torque=sosfiltfilt(butter(5, 5.0, output="sos", fs=run.sample_rate), run.torque, axis=0)
        )
        for name, run in _recorded(arm, encoder_bits=18).items()
    }
    prepared = prepare(arm, low_passed)
    assert np.all(noise(BaseRegressor(prepared)).rms > _passed(prepared))
    assert not noise(BaseRegressor(prepared)).seen.any()
