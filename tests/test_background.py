"""The background of a healthy robot, and nominal models drawn around the truth."""

from pathlib import Path

import numpy as np
import pytest

from identification.errors import InputError
from identification.inverse_dynamics import inverse_dynamics
from identification.parameters import pseudo_inertia
from testbench.background import background
from testbench.jobs.run import run_scenario, simulation_options
from testbench.model_error import ModelError, nominal_model, nominal_parameters
from testbench.robot import Robot, load_robot
from testbench.scenario import load_scenario
from testbench.simulation import SimulationOptions, sample_reference, simulate

from .simulated_arm import Sines
from .small_arm import ARM as SMALL_ARM


@pytest.fixture(scope="module")
def tx90(models: Path) -> Robot:
    return load_robot(models / "tx90.xml")


def test_a_background_repeats_with_its_seed_and_only_then(tx90: Robot) -> None:
    one, same, other = background(tx90, 3), background(tx90, 3), background(tx90, 4)
    assert one.effects == same.effects
    assert one.effects != other.effects
    assert np.array_equal(one.sensors.encoder_bits, same.sensors.encoder_bits)


def test_every_joint_has_every_imperfection(tx90: Robot) -> None:
    effects = background(tx90, 0).effects
    for joint in range(tx90.joints):
        names = {each.effect for each in effects if each.joint == joint}
        assert names == {
            "stribeck_friction",
            "asymmetric_friction",
            "load_dependent_friction",
            "transmission_ripple",
            "cable_spring",
        }


def test_a_background_is_small_and_scales(tx90: Robot) -> None:
    motion = sample_reference(Sines((0.6, 0.4, 0.5, 0.8, 0.6, 1.0), (1, 2, 3, 2, 3, 4), 3.0), 1000.0)
    options = [
        SimulationOptions(physics_timestep=5e-4, effects=background(tx90, 1, scale).effects)
        for scale in (0.0, 0.5, 1.0)
    ]
    none, half, full = simulate(tx90, [motion] * 3, options)
    torque = np.sqrt(np.mean(none.torque**2, axis=0))
    change = [np.sqrt(np.mean((run.torque - none.torque) ** 2, axis=0)) for run in (half, full)]
    assert (change[1] < 0.1 * torque).all()
    assert (change[1] > 0.003 * torque).all()
    np.testing.assert_allclose(change[0] / change[1], 0.5, atol=0.1)


def test_sensors_are_those_of_a_healthy_arm(tx90: Robot) -> None:
    sensors = background(tx90, 5).sensors
    assert set(np.asarray(sensors.encoder_bits).tolist()) <= {17, 18, 19}
    assert -0.002 <= float(np.asarray(sensors.torque_delay)) <= 0
    assert (np.asarray(sensors.torque_correlation_time) > 0).all()


def test_no_model_error_is_the_truth(tx90: Robot) -> None:
    found = nominal_parameters(tx90, ModelError(0, 0, 0, 0, 0, 0), 7)
    np.testing.assert_allclose(found, tx90.parameters, rtol=1e-12, atol=1e-12)


def test_drawn_links_could_be_built_however_wild(tx90: Robot) -> None:
    for seed in range(20):
        table = nominal_parameters(tx90, ModelError(0.5, 0.5, 0.5, 0.5, 0.5, 0.5), seed).reshape(6, 14)
        for row in table:
            assert np.linalg.eigvalsh(pseudo_inertia(row[:10])).min() > 0
            assert (row[10:13] > 0).all()


def test_errors_have_the_size_that_was_asked_for(tx90: Robot) -> None:
    truth = tx90.parameters.reshape(6, 14)
    drawn = np.array([nominal_parameters(tx90, ModelError(), seed).reshape(6, 14) for seed in range(100)])
    # 600 draws each: the deviation is known to 3 %, bounds at 5 of those.
    for column, deviation in ((9, 0.06), (10, 0.08), (11, 0.2), (12, 0.15)):
        ratio = np.log(drawn[:, :, column] / truth[:, column])
        assert ratio.std() == pytest.approx(deviation, rel=0.15)


def test_a_nominal_model_is_written_as_mjcf(tx90: Robot, tmp_path: Path) -> None:
    nominal = nominal_model(tx90, ModelError(), 2, tmp_path / "nominal.xml")
    assert nominal.joint_names == tx90.joint_names
    rng = np.random.default_rng(0)
    q, dq, ddq = (rng.uniform(-1, 1, (20, 6)) for _ in range(3))
    drawn = nominal_parameters(tx90, ModelError(), 2)
    wanted = inverse_dynamics(tx90.chain, drawn, q, dq, ddq)
    found = inverse_dynamics(nominal.chain, nominal.parameters, q, dq, ddq)
    np.testing.assert_allclose(found, wanted, rtol=1e-5, atol=1e-5)
    assert np.abs(found - inverse_dynamics(tx90.chain, tx90.parameters, q, dq, ddq)).max() > 1


def test_a_negative_error_is_refused() -> None:
    with pytest.raises(InputError, match="mass"):
        ModelError(mass=-0.1)


SCENARIO = """
name: hidden
model: arm.xml
effects:
  - {effect: backlash, joint: elbow, values: {gap: 0.003}}
  - {effect: joint_coupling, joint: 1, into: 2, law: smooth}
background: {scale: 0.5}
model_error: {scale: 1}
"""


def test_a_scenario_hides_effects_and_a_background(tmp_path: Path) -> None:
    (tmp_path / "arm.xml").write_text(SMALL_ARM)
    (tmp_path / "hidden.yaml").write_text(SCENARIO)
    scenario, _ = load_scenario(tmp_path / "hidden.yaml")
    robot = load_robot(scenario.model)
    options = simulation_options(scenario, robot)
    first, second = options.effects[:2]
    assert (first.effect, first.joint, first.values) == ("backlash", 1, {"gap": 0.003})
    assert (second.into, second.law) == (1, "smooth")
    assert len(options.effects) == 2 + 5 * robot.joints
    assert np.all(np.asarray(options.sensors.torque_noise) == 0.0025)


@pytest.mark.parametrize(
    ("entry", "says"),
    [
        ("{effect: backlash, joint: 2, play: 1}", "effects.0.play"),
        ("{effect: backlash, joint: hip}", "shoulder, elbow"),
        ("{effect: slack, joint: 2}", "transmission_ripple"),
        ("{effect: backlash, joint: 2, values: {gap: wide}}", "effects.0.values.gap"),
    ],
)
def test_a_wrong_effect_in_a_scenario_is_one_line(tmp_path: Path, entry: str, says: str) -> None:
    (tmp_path / "arm.xml").write_text(SMALL_ARM)
    (tmp_path / "hidden.yaml").write_text(f"name: hidden\nmodel: arm.xml\neffects: [{entry}]\n")
    with pytest.raises(InputError) as caught:
        run_scenario(tmp_path / "hidden.yaml", tmp_path / "out")
    assert "hidden.yaml" in str(caught.value)
    assert says in str(caught.value)
    assert not (tmp_path / "out").exists()
