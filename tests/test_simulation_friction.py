"""Exact Coulomb friction of the simulated robot, against closed forms and brute force."""

import itertools

import mujoco
import numpy as np
import pytest

from testbench.robot import Robot
from testbench.simulation import batch, layout
from testbench.simulation.friction import coulomb_friction
from testbench.simulation.plant import plant_model

from .simulated_arm import ARM, RATE, robot_from

BLOCK = """
<mujoco model="block"><worldbody><body><inertial pos="0 0 0" mass="2" diaginertia="1 1 1"/>
  <joint name="rail" type="slide" axis="1 0 0" frictionloss="3" actuatorfrcrange="-50 50"/>
</body></worldbody></mujoco>
"""


@pytest.fixture(scope="module")
def block(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    return robot_from(BLOCK, tmp_path_factory.mktemp("block"))


@pytest.fixture(scope="module")
def arm(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    return robot_from(ARM, tmp_path_factory.mktemp("arm"))


def pushed(robot: Robot, force: np.ndarray, timestep: float) -> np.ndarray:
    """Loop output of an uncontrolled robot pushed by a force (N, n) at 1 kHz."""
    samples, n = force.shape
    constants = np.zeros((layout.CONSTANTS, n))
    constants[layout.COULOMB], constants[layout.TORQUE_LIMIT] = robot.model.dof_frictionloss, np.inf
    inputs = np.zeros((samples, layout.INPUTS, n))
    inputs[:, layout.FEEDFORWARD] = force
    plant = plant_model(robot.model, timestep)
    loop = batch.Loop(plant, round(1e-3 / timestep), RATE, 0.0, constants, inputs, np.zeros(n), np.zeros(n))
    return batch.run_loops([loop], 1)[0]


@pytest.mark.parametrize("timestep", [1e-3, 1e-4])
def test_a_pushed_block_slides_and_stops_as_in_the_closed_form(block: Robot, timestep: float) -> None:
    mass, coulomb, push, pushing = 2.0, 3.0, 7.0, 0.4
    force = np.zeros((1500, 1))
    force[: round(pushing * RATE)] = push
    output = pushed(block, force, timestep)
    position, velocity = output[:, layout.POSITION, 0], output[:, layout.VELOCITY, 0]
    top = (push - coulomb) / mass * pushing
    distance = top * pushing / 2 + top**2 / (2 * coulomb / mass)
    # Piecewise constant acceleration: velocity is exact, position a rectangle rule.
    assert velocity.max() == pytest.approx(top, rel=1e-12)
    assert position[-1] == pytest.approx(distance, abs=top * timestep)
    # What the push put in, friction took out.
    work = push * position[round(pushing * RATE)]
    assert work == pytest.approx(coulomb * position[-1], abs=2 * push * top * timestep)
    at_rest = round((pushing + top / (coulomb / mass)) * RATE) + 2
    assert np.abs(velocity[at_rest:]).max() < 1e-15
    assert np.ptp(position[at_rest:]) < 1e-15


def test_a_block_pushed_with_less_than_its_friction_does_not_creep(block: Robot) -> None:
    force = 2.99 * np.sin(np.linspace(0, 30, 2000))[:, None]
    output = pushed(block, force, 1e-3)
    assert np.abs(output[:, layout.POSITION]).max() < 1e-15
    held = (force[:-1] + force[1:]) / 2
    np.testing.assert_allclose(output[1:, layout.FRICTION], held, atol=1e-12)


def test_friction_of_a_coupled_arm_is_the_solution_found_by_trying_every_mode(arm: Robot) -> None:
    plant, coulomb, h = plant_model(arm.model, 1e-3), np.array(arm.model.dof_frictionloss), 1e-3
    data, random = mujoco.MjData(plant), np.random.default_rng(3)
    modes = set()
    for _ in range(60):
        data.qpos[:], data.qvel[:] = random.normal(size=3), 0.02 * random.normal(size=3)
        mujoco.mj_forward(plant, data)
        force = 6 * random.normal(size=3)
        inverse = np.zeros((3, 3))
        mujoco.mj_solveM(plant, data, inverse, np.eye(3))
        friction = np.zeros(3)
        work = np.zeros((8, 3))
        coulomb_friction(plant._address, data._address, h, data.qvel.copy(), force, coulomb, friction, work)
        expected, mode = every_mode(np.array(data.qvel), force, inverse, coulomb, h)
        modes.add(mode)
        np.testing.assert_allclose(friction, expected, atol=1e-9)
    assert len(modes) > 10


def every_mode(
    velocity: np.ndarray, force: np.ndarray, inverse: np.ndarray, coulomb: np.ndarray, h: float
) -> tuple[np.ndarray, tuple[int, ...]]:
    """Friction of the one consistent choice among 3^n: sliding back (-1), sticking (0), sliding on (1)."""
    for mode in itertools.product((-1, 0, 1), repeat=len(velocity)):
        stuck = np.array(mode) == 0
        friction = coulomb * mode
        free = velocity + h * inverse @ (force - friction)
        friction[stuck] = np.linalg.solve(h * inverse[np.ix_(stuck, stuck)], free[stuck])
        after = velocity + h * inverse @ (force - friction)
        if (np.abs(friction) <= coulomb * (1 + 1e-12)).all() and (
            np.sign(after[~stuck]) == np.array(mode)[~stuck]
        ).all():
            return friction, mode
    raise AssertionError("no consistent mode")
