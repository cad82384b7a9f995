"""Joints that follow others at a constant ratio: torques, regressor, base parameters, limits, files."""

from pathlib import Path

import mujoco
import numpy as np
import pytest

from identification.base_parameters import base_parameters
from identification.chain import chain_from_model
from identification.energy import dissipation_regressor, energy_regressor
from identification.errors import InputError
from identification.estimators import estimate
from identification.inverse_dynamics import inverse_dynamics, mass_matrices
from identification.models import Preprocessing, equations
from identification.pipeline import IdentificationOptions, identify
from identification.problem import Problem
from identification.regressor import regressor
from identification.regressor_adjoint import regressor_adjoint
from identification.signals import Motion, Signals
from identification.springs import spring_torque
from testbench.chain_json import chain_document, read_chain
from testbench.clearance import robot_clearance
from testbench.effects.link_force import wrench_torques
from testbench.jobs.parity import mujoco_torques, parity, random_states
from testbench.model_file import write_model
from testbench.robot import Robot

from .palletizer import PALLETIZER
from .simulated_arm import robot_from

# Joints turn, lift, reach, roll; in the model's order upright comes third and level fifth.
MOVED = np.array([[1, 0, 0, 0], [0, 1, 0, 0], [0, -1.1, 0, 0], [0, 0, 1, 0], [0, 0, -1, 0], [0, 0, 0, 1]])
START = np.array([0, 0, 0.05, 0, 0, 0])
RATE = 500.0


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    return robot_from(PALLETIZER, tmp_path_factory.mktemp("palletizer"))


def test_torques_are_those_of_the_whole_tree_folded_by_the_ratios(robot: Robot) -> None:
    q, dq, ddq = random_states(robot, 100, 1)
    friction = (np.sign(dq @ MOVED.T) * robot.model.dof_frictionloss) @ MOVED
    of_links = mujoco_torques(robot.spec().compile(), q @ MOVED.T + START, dq @ MOVED.T, ddq @ MOVED.T)
    expected = of_links @ MOVED + friction
    torque = inverse_dynamics(robot.chain, robot.parameters, q, dq, ddq)
    rows = regressor(robot.chain, q, dq, ddq) @ robot.parameters + spring_torque(robot.chain.springs, q)
    np.testing.assert_allclose(torque, expected, rtol=0, atol=1e-9)
    np.testing.assert_allclose(rows, expected, rtol=0, atol=1e-9)


def test_a_joint_may_sit_on_one_that_follows_it() -> None:
    text = PALLETIZER.replace('joint1="upright" joint2="lift"', 'joint1="lift" joint2="upright"')
    model = mujoco.MjModel.from_xml_string(text)
    chain, parameters = chain_from_model(model)
    assert chain.joint_names == ("turn", "upright", "reach", "roll")
    assert chain.parent.tolist() == [-1, 0, 1, 2]
    q, dq, ddq = np.random.default_rng(0).uniform(-1, 1, (3, 20, 4))
    links = chain.link_positions(q), chain.link_motions(dq), chain.link_motions(ddq)
    friction = np.sign(links[1]) * model.dof_frictionloss
    expected = chain.at_joints(mujoco_torques(model, *links) + friction)
    np.testing.assert_allclose(inverse_dynamics(chain, parameters, q, dq, ddq), expected, rtol=0, atol=1e-9)


def test_torques_agree_with_pinocchio(robot: Robot) -> None:
    assert parity(robot, 50).sentence == "all three agree to rounding"


def test_chosen_columns_are_those_of_the_whole_regressor(robot: Robot) -> None:
    motion = random_states(robot, 20, 2)
    columns = np.array([70, 3, 14 * 4 + 9, 14 * 5 + 11, 25])
    out = np.empty((20, 4, len(columns)))
    regressor(robot.chain, *motion, columns, out=out)
    np.testing.assert_array_equal(out, regressor(robot.chain, *motion)[:, :, columns])


def test_the_adjoint_is_the_regressors_derivative(robot: Robot) -> None:
    motion, step = random_states(robot, 10, 3), 1e-6
    seeds = np.random.default_rng(0).normal(size=regressor(robot.chain, *motion).shape)
    found = regressor_adjoint(robot.chain, *motion, seeds, coulomb_velocity=0.3)
    for place in range(3):
        for joint, unit in enumerate(step * np.eye(4)):
            ahead, behind = (
                [each + sign * unit * (k == place) for k, each in enumerate(motion)] for sign in (1, -1)
            )
            rows = [regressor(robot.chain, *each, coulomb_velocity=0.3) for each in (ahead, behind)]
            expected = np.sum((rows[0] - rows[1]) * seeds, axis=(1, 2)) / (2 * step)
            np.testing.assert_allclose(found[place][:, joint], expected, rtol=1e-5, atol=1e-4)


def test_energy_takes_up_the_power_of_the_joints(robot: Robot) -> None:
    time = np.linspace(0, 1, 4001)[:, None]
    w, a = np.array([1, 2, 3, 1.5]), 0.3
    q, dq, ddq = a * np.sin(w * time), a * w * np.cos(w * time), -a * w**2 * np.sin(w * time)
    every = np.arange(len(robot.parameters))
    energy = energy_regressor(robot.chain, q, dq, every) @ robot.parameters
    taken = dissipation_regressor(robot.chain, dq, every) @ robot.parameters
    torque = inverse_dynamics(robot.chain.without_springs(), robot.parameters, q, dq, ddq)
    power = np.gradient(energy, time[:, 0]) + taken
    np.testing.assert_allclose(power[2:-2], np.sum(torque * dq, axis=1)[2:-2], rtol=0, atol=1e-4)


def test_the_mass_matrix_is_symmetric_and_positive(robot: Robot) -> None:
    mass = mass_matrices(robot.chain, robot.parameters, random_states(robot, 5, 4)[0])
    np.testing.assert_allclose(mass, mass.swapaxes(1, 2), atol=1e-12)
    assert np.linalg.eigvalsh(mass).min() > 0


def test_base_parameters_hold_friction_once_and_give_the_torque(robot: Robot) -> None:
    base, motion = base_parameters(robot.chain), random_states(robot, 50, 5)
    for symbol in ("fv", "fc"):
        assert [name for name in base.names if symbol in name] == [f"{symbol}_{j}" for j in (1, 2, 3, 4)]
    torque = inverse_dynamics(robot.chain.without_springs(), robot.parameters, *motion)
    rows = regressor(robot.chain, *motion, base.columns)
    np.testing.assert_allclose(rows @ base.values(robot.parameters), torque, rtol=0, atol=1e-8)


@pytest.mark.parametrize("model", ["energy", "inverse_dynamic", "power"])
def test_exact_signals_return_the_truth(robot: Robot, model: str) -> None:
    base, settings, signals = base_parameters(robot.chain), Preprocessing(model=model), _signals(robot)
    run = equations(robot.chain, base, signals, settings, "exact")
    motion = Motion(signals.q, signals.tau, RATE)
    problem = Problem(robot.chain, base, (run,), (motion,), settings, robot.parameters)
    truth = base.values(robot.parameters)
    # The balances integrate by quadrature.
    bound = 1e-6 if model == "inverse_dynamic" else 1e-3
    assert np.abs(estimate(problem, "wls").values - truth).max() < bound * np.abs(truth).max()


def test_noisy_logs_return_the_truth_within_stated_deviations(robot: Robot) -> None:
    signals, noise = _signals(robot), np.random.default_rng(2)
    level = 0.02 * np.sqrt(np.mean(signals.tau**2, axis=0))
    motion = Motion(signals.q, signals.tau + level * noise.standard_normal(signals.tau.shape), RATE)
    found = identify(
        robot.chain, 0.9 * robot.parameters, {"run": motion}, {}, IdentificationOptions()
    ).estimate
    scores = (found.values - found.base.values(robot.parameters)) / found.std
    # Of 36 standard normals, the mean square is below 1.8 but once in a thousand times.
    assert np.mean(scores**2) < 1.8


def _signals(robot: Robot) -> Signals:
    """A smooth random motion of 20 s with its exact torque."""
    rng, time = np.random.default_rng(1), np.arange(0, 20, 1 / RATE)[:, None]
    span = robot.limits.upper - robot.limits.lower
    q, dq, ddq = np.zeros((3, len(time), robot.joints))
    for harmonic in range(1, 8):
        w = 2 * np.pi * harmonic / 10
        a, phase = rng.uniform(0.02, 0.08, robot.joints) * span, rng.uniform(0, 2 * np.pi, robot.joints)
        angle = w * time + phase
        q, dq, ddq = q + a * np.sin(angle), dq + a * w * np.cos(angle), ddq - a * w**2 * np.sin(angle)
    return Signals(q, dq, ddq, inverse_dynamics(robot.chain, robot.parameters, q, dq, ddq), RATE, 0)


def test_ranges_and_rated_speeds_of_followers_are_kept(robot: Robot) -> None:
    np.testing.assert_allclose(robot.limits.lower, [-2.5, -0.6, -0.4, -3])
    np.testing.assert_allclose(robot.limits.upper, [2.5, 0.9, 0.9, 3])
    np.testing.assert_allclose(robot.limits.velocity, [2, 2, 1.5, 4])


def test_clearance_is_of_the_moved_followers_and_its_gradient_their_leaders(robot: Robot) -> None:
    clearance = robot_clearance(robot, 0.1)
    assert clearance is not None
    q, step = np.array([[0.3, 0.8, 0.85, 0.5]]), 1e-6
    data = mujoco.MjData(robot.model)
    data.qpos[:] = MOVED @ q[0] + START
    mujoco.mj_forward(robot.model, data)
    geoms = [robot.model.geom(name).id for name in ("tool", "lower")]
    apart = mujoco.mj_geomDistance(robot.model, data, *geoms, 2.0, None)
    assert clearance.distances(q) == pytest.approx(min(apart, 0.25))
    gradient = clearance.gradients(q)[1][0, 0]
    moved = [clearance.distances(q + sign * step * np.eye(4)) for sign in (1, -1)]
    np.testing.assert_allclose(gradient, (moved[0] - moved[1])[:, 0] / (2 * step), atol=1e-6)


def test_a_force_on_a_link_loads_the_joints_whose_followers_move_it(robot: Robot) -> None:
    q = random_states(robot, 1, 6)[0]
    data = mujoco.MjData(robot.model)
    data.qpos[:] = MOVED @ q[0] + START
    mujoco.mj_forward(robot.model, data)
    body, jacobian = robot.model.body("tool").id, np.zeros((3, 6))
    mujoco.mj_jac(robot.model, data, jacobian, None, data.xanchor[5], body)
    axes = data.xmat[body].reshape(3, 3)
    # The link's z is the joint's axis, which is the body's turned over.
    force_along_z = wrench_torques(robot.chain, q, 3)[0][:, 2]
    np.testing.assert_allclose(force_along_z, MOVED.T @ jacobian.T @ axes @ [0, 0, -1], atol=1e-12)


def test_the_chain_reads_back_from_json(robot: Robot) -> None:
    document = chain_document(robot.chain)
    motion = random_states(robot, 5, 7)
    again = inverse_dynamics(read_chain(document), robot.parameters, *motion)
    np.testing.assert_array_equal(again, inverse_dynamics(robot.chain, robot.parameters, *motion))
    document["followers"]["leader"][0] = 9
    with pytest.raises(ValueError, match="of every link"):
        read_chain(document)


def test_a_written_model_has_its_coupling(robot: Robot, tmp_path: Path) -> None:
    write_model(robot, robot.parameters, tmp_path / "written.xml")
    again, motion = robot_from((tmp_path / "written.xml").read_text(), tmp_path), random_states(robot, 20, 8)
    assert again.chain.link_names == robot.chain.link_names
    np.testing.assert_array_equal(again.limits.velocity, robot.limits.velocity)
    expected = inverse_dynamics(robot.chain, robot.parameters, *motion)
    # MuJoCo writes six digits.
    np.testing.assert_allclose(
        inverse_dynamics(again.chain, again.parameters, *motion), expected, rtol=0, atol=1e-3
    )


def test_a_follower_that_carries_an_earlier_joint_than_its_leader_is_refused() -> None:
    text = PALLETIZER.replace('joint1="upright" joint2="lift"', 'joint1="upright" joint2="roll"')
    model = mujoco.MjModel.from_xml_string(text)
    with pytest.raises(InputError, match="it carries reach, which comes before roll"):
        chain_from_model(model)


def test_methods_for_joints_of_their_own_refuse_followers(robot: Robot) -> None:
    with pytest.raises(InputError, match=r"none of whose joints follows another.*upright, level"):
        _ = robot.chain.arrays
