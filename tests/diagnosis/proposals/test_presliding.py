"""An arm that stands between its moves: what holds it there tells bristles from friction that jumps."""

import numpy as np
import pytest

from diagnosis.data.preparation import Prepared, prepare
from diagnosis.diagnose import diagnose
from diagnosis.fit.score import Stage
from diagnosis.model.base_regressor import ground
from diagnosis.model.candidates import candidates
from diagnosis.proposals.presliding import held_by_bristles
from diagnosis.report.words import near_rest
from diagnosis.search.growth import attribute
from identification.parameters import COULOMB, PER_JOINT
from testbench.effects import parse_injection
from testbench.log import Recording
from testbench.robot import Robot, load_robot
from testbench.simulation import SensorOptions, SimulationOptions

from ..standing import standing_runs

SHOULDER, STIFFNESS = 0, 4000.0


@pytest.fixture(scope="module")
def bristled(arm: Robot) -> dict[str, Recording]:
    return _picks(arm, f"presliding_hysteresis:shoulder:stiffness={STIFFNESS}")


@pytest.fixture(scope="module")
def healthy(arm: Robot) -> dict[str, Recording]:
    return _picks(arm)


def _picks(arm: Robot, *faults: str) -> dict[str, Recording]:
    """Three runs of moves from one place to another, with a stand after each."""
    options = SimulationOptions(
        sensors=SensorOptions(encoder_bits=20, torque_noise=0.01),
        physics_timestep=5e-4,
        effects=tuple(parse_injection(arm, fault) for fault in faults),
    )
    return standing_runs(arm, options)


def _held(prepared: Prepared) -> frozenset[int]:
    """What bristles hold beside re-identification alone."""
    bristles = candidates(prepared, only=["presliding_hysteresis"])
    return held_by_bristles(prepared.robot, Stage.of(ground(prepared), []), bristles)


def test_bristles_are_told_by_what_holds_the_arm_between_its_moves(arm, bristled):
    assert _held(prepare(arm, bristled)) == {SHOULDER}


def test_friction_that_jumps_holds_the_arm_as_it_likes(arm, healthy):
    assert _held(prepare(arm, healthy)) == frozenset()


@pytest.mark.parametrize(("bristled_joints", "held"), [(3, {0, 1, 2}), (4, set())])
def test_what_most_joints_have_is_how_the_robot_is(models, bristled_joints, held):
    robot = load_robot(models / "tx90.xml")
    coulomb = robot.parameters.reshape(-1, PER_JOINT)[:bristled_joints, COULOMB]
    soft = zip(robot.joint_names, coulomb / 6e-4, strict=False)
    runs = _picks(robot, *(f"presliding_hysteresis:{name}:stiffness={k}" for name, k in soft))
    assert _held(prepare(robot, runs)) == held


def test_samples_near_rest_count_where_bristles_hold(arm, bristled):
    prepared = prepare(arm, bristled)
    found = attribute(prepared)
    assert found.prepared.held == {SHOULDER}
    for before, after in zip(prepared.runs, found.prepared.runs, strict=True):
        assert np.array_equal(after.used[:, SHOULDER], before.whole[:, SHOULDER])
        assert np.array_equal(after.used[:, 1:], before.used[:, 1:])


def test_they_are_named_and_leave_what_an_arm_without_them_does(arm, bristled, healthy):
    found = diagnose(arm, bristled)
    assert [(each.effect, each.joint) for each in found.effects] == [("presliding_hysteresis", SHOULDER)]
    assert near_rest(found) == ["Bristles hold shoulder at rest: there, samples near rest count, too."]
    stiffness = found.effects[0].parameters["stiffness"]
    assert abs(stiffness.value - STIFFNESS) < 3 * stiffness.std
    assert found.gap.parameters[SHOULDER] > 4 * found.gap.effects[SHOULDER]
    floor = diagnose(arm, healthy).gap.effects
    assert found.gap.effects[SHOULDER] < 1.1 * floor[SHOULDER]
