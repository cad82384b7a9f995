"""Currents that have lost their sign: identified and diagnosed nearly as well as with it."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

import testbench
from identification.lost_sign import likeliest_signs
from identification.parameters import ARMATURE, COULOMB, PER_JOINT, VISCOUS
from testbench.drive import Drive
from testbench.log import write_log

from ..small_arm import ARM

CONSTANT = np.array([20.0, 10.0])
EFFECT = "transmission_ripple:elbow"


@dataclass(frozen=True)
class Logged:
    """An arm's runs, as they are and with the size of their current alone."""

    robot: testbench.Robot
    signed: dict[str, testbench.Recording]
    sizes: dict[str, testbench.Recording]
    lines: str


@pytest.fixture(scope="module")
def logged(tmp_path_factory: pytest.TempPathFactory) -> Logged:
    folder = tmp_path_factory.mktemp("sign")
    (folder / "arm.xml").write_text(ARM)
    robot = testbench.load_robot(folder / "arm.xml")
    motion = testbench.excite(robot, harmonics=4, base_frequency=0.25, starts=1, iterations=20)
    signed, paths = {}, []
    for seed, name in enumerate(("one", "two")):
        run = testbench.simulate(robot, motion, effects=[EFFECT], periods=1, seed=seed)
        signed[name] = run
        drive = Drive("current", CONSTANT)
        size = np.abs(run.torque) / CONSTANT
        paths.append(folder / f"{name}.h5")
        # One says that it has no sign, of the other it is plain to see.
        unsigned = ("current",) if seed == 0 else ()
        bare = replace(run, torque=np.full_like(size, np.nan), current=size, drive=drive, unsigned=unsigned)
        write_log(replace(bare, truth={}, truth_effects=[]), paths[-1])
    with pytest.MonkeyPatch.context() as patch:
        lines: list[str] = []
        patch.setattr("testbench.api.logs.note", lines.extend)
        sizes = testbench.read_logs(paths, robot)
    return Logged(robot, signed, sizes, "\n".join(lines))


def test_what_gave_the_sign_is_said(logged: Logged) -> None:
    assert logged.lines.count("the current has no sign: it is that of the model's torque") == 2


@pytest.mark.parametrize("friction", [1.0, 0.0])
def test_signs_are_right_wherever_they_are_clear(logged: Logged, friction: float) -> None:
    nominal = 1.2 * logged.robot.parameters.reshape(-1, PER_JOINT)
    nominal[:, [ARMATURE, VISCOUS, COULOMB]] *= friction
    for run in logged.signed.values():
        size = np.abs(run.torque)
        found = likeliest_signs(logged.robot.chain, nominal.ravel(), run.position, run.sample_rate, size)
        wrong = (np.sign(found.expected) != np.sign(run.torque)) & (np.abs(found.expected) > 0.95)
        # One of 40 would be wrong at the limit of what is clear.
        assert np.all(wrong.mean(axis=0) < 1 / 40)
        assert np.all(found.clear > 0.95)


def test_parameters_are_those_of_the_signed_current_within_their_deviations(logged: Logged) -> None:
    bare, whole = (testbench.identify(logged.robot, runs).estimate for runs in (logged.sizes, logged.signed))
    std = np.sqrt(np.diag(whole.covariance))
    assert np.all(np.abs(bare.values - whole.values) < 3 * std)


def test_the_effect_is_named_all_the_same(logged: Logged) -> None:
    why = testbench.diagnose(logged.robot, logged.sizes)
    assert [(each.effect, each.joint) for each in why.effects] == [("transmission_ripple", 1)]
