"""Robots with joints that follow others: simulated as what they amount to, designed for, diagnosed."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from diagnosis.correction.corrected_mjcf import write_corrected
from diagnosis.correction.file_error import MujocoTorque
from diagnosis.diagnose import diagnose
from identification.chain import chain_from_model
from identification.excitation.design import DesignOptions, random_excitation
from identification.inverse_dynamics import inverse_dynamics
from identification.parameters import COULOMB, PER_JOINT
from testbench.closed_loop import recorded_loops
from testbench.effects import injection
from testbench.model_error import ModelError, nominal_model
from testbench.robot import Robot, load_robot
from testbench.simulation import SimulationOptions, sample_reference, simulate
from testbench.simulation.tracking import tracking

from .diagnosed import simulated_runs
from .palletizer import GEARED, PALLETIZER, WITH_ITS_INERTIA
from .simulated_arm import Sines, robot_from

MOTION = sample_reference(Sines((0.5, 0.3), (1, 2)), 1000.0)


@pytest.fixture(scope="module")
def geared(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    return robot_from(GEARED, tmp_path_factory.mktemp("geared"))


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    return robot_from(WITH_ITS_INERTIA, tmp_path_factory.mktemp("plain"))


@pytest.fixture(scope="module")
def palletizer(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    return robot_from(PALLETIZER, tmp_path_factory.mktemp("palletizer"))


@pytest.mark.parametrize(
    ("effect", "joint", "values"),
    [
        (None, 0, {}),
        ("joint_elasticity", 1, {"stiffness": 2000, "damping": 2}),
        ("backlash", 1, {"gap": 0.01}),
        ("external_contact", 2, {"torque": 5, "start": 0.5, "duration": 0.5}),
        ("presliding_hysteresis", 1, {"stiffness": 500}),
    ],
)
def test_a_geared_wheel_moves_as_its_inertia_on_the_link(
    geared: Robot, plain: Robot, effect: str | None, joint: int | None, values: dict[str, float]
) -> None:
    found = []
    for robot in (geared, plain):
        hidden = () if effect is None else (injection(robot, effect, joint, values),)
        options = SimulationOptions(effects=hidden)
        found += simulate(robot, [MOTION], options, plain, threads=1)
    for name in ("position", "velocity", "acceleration", "torque", "friction_torque"):
        np.testing.assert_allclose(found[0].truth[name], found[1].truth[name], rtol=1e-6, atol=1e-6)


def test_the_simulated_palletizer_obeys_its_inverse_dynamics(palletizer: Robot) -> None:
    motion = sample_reference(Sines((0.5, 0.2, 0.2, 0.8), (1, 2, 1, 3)), 1000.0)
    run = simulate(palletizer, [motion], SimulationOptions(physics_timestep=1e-4), threads=1)[0]
    q, dq, ddq = (run.truth[name] for name in ("position", "velocity", "acceleration"))
    moving = np.all(np.abs(dq) > 0.05, axis=1)
    torque = inverse_dynamics(palletizer.chain, palletizer.parameters, q, dq, ddq)
    # Of first order in the step.
    np.testing.assert_allclose(torque[moving], run.truth["torque"][moving], rtol=0, atol=0.05)


def test_a_payload_hangs_on_the_last_body_though_it_follows(geared: Robot) -> None:
    loads = {"mass": 0.5, "first_moment_x": 0.1, "first_moment_y": 0.0, "first_moment_z": 0.05}
    hidden = (injection(geared, "payload", None, loads),)
    run = simulate(geared, [MOTION], SimulationOptions(physics_timestep=1e-4, effects=hidden), threads=1)[0]
    spec = geared.spec()
    spec.joint("wheel").parent.add_body(
        mass=0.5, ipos=[0.2, 0, 0.1], inertia=[1e-9] * 3, explicitinertial=True
    )
    loaded = chain_from_model(spec.compile())[1]
    changed = np.flatnonzero(np.abs(loaded - geared.parameters) > 1e-6)
    assert set(changed // PER_JOINT) == {geared.chain.last}
    q, dq, ddq = (run.truth[name] for name in ("position", "velocity", "acceleration"))
    moving = np.all(np.abs(dq) > 0.05, axis=1)
    torque = inverse_dynamics(geared.chain, loaded, q, dq, ddq)
    np.testing.assert_allclose(torque[moving], run.truth["torque"][moving], rtol=0, atol=0.05)


def test_a_design_keeps_followers_within_their_ranges(palletizer: Robot) -> None:
    options = DesignOptions(harmonics=3, base_frequency=0.2, seed=1)
    motion = random_excitation(palletizer.chain, palletizer.parameters, palletizer.limits, options).trajectory
    links = palletizer.chain.link_positions(motion.evaluate(np.arange(0, motion.duration, 0.01))[0])
    ranges = palletizer.model.jnt_range
    assert np.all(links >= ranges[:, 0])
    assert np.all(links <= ranges[:, 1])


def test_the_corrected_model_finds_the_robots_torque_and_keeps_the_coupling(
    palletizer: Robot, tmp_path: Path
) -> None:
    nominal = nominal_model(palletizer, ModelError(), 3, tmp_path / "nominal.xml")
    gain = injection(palletizer, "torque_gain_error", 3, {"relative": 0.1})
    diagnosis = diagnose(nominal, simulated_runs(palletizer, [gain]))
    assert [(each.effect, each.joint) for each in diagnosis.effects] == [("torque_gain_error", 2)]
    write_corrected(diagnosis, tmp_path / "corrected.xml")
    corrected = load_robot(tmp_path / "corrected.xml")
    assert corrected.chain.link_names == palletizer.chain.link_names


def test_mujocos_torque_of_a_file_is_that_of_the_joints(palletizer: Robot) -> None:
    motion = sample_reference(Sines((0.5, 0.2, 0.2, 0.8), (1, 2, 1, 3)), 200.0)
    q, dq, ddq = motion.position, motion.velocity, motion.acceleration
    smooth = replace(palletizer, model=palletizer.spec().compile())
    smooth.model.dof_frictionloss[:] = 0.0
    table = palletizer.parameters.reshape(-1, PER_JOINT).copy()
    table[:, COULOMB] = 0.0
    found = MujocoTorque(smooth.model, palletizer).along(q, dq, ddq, 200.0)
    np.testing.assert_allclose(
        found, inverse_dynamics(palletizer.chain, table, q, dq, ddq), rtol=0, atol=1e-6
    )


def test_candidates_are_simulated_with_followers(geared: Robot) -> None:
    run = simulate(geared, [MOTION], SimulationOptions(), threads=1)[0]
    loops = recorded_loops(geared, [run])
    assert loops is not None
    (again,) = loops.simulate(geared.parameters[None])[0]
    np.testing.assert_allclose(again.q, run.truth["position"], rtol=0, atol=1e-4)
    assert tracking(run, geared.limits.torque).warnings() == ()
