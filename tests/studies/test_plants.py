"""The independent plants: their physics against MuJoCo's inverse dynamics, their faults, their seeds."""

from functools import cache
from pathlib import Path

import mujoco
import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt

from identification.errors import InputError
from studies.plants import draw, plant, plants
from studies.plants.case import Case
from studies.plants.drawing import LEAST, MOST, SHARES, kind_of, moved
from testbench.log import Recording, read_log
from testbench.robot import load_robot

# Hz: motions stay below it, and what noise and differences do above it does not count.
BAND = 20.0
# Of the torque, RMS: late by half a step, differentiated without filter.
TOLERANCE = 0.03
# Seeds of one fault so large that the encoders' steps, which the controllers answer, are nothing beside it.
LARGE_FAULT = {"cobot": 0, "industrial": 8, "palletizer": 2, "redundant": 0, "scara": 5, "servo_arm": 2}


def low(values: np.ndarray, rate: float) -> np.ndarray:
    return sosfiltfilt(butter(4, BAND / (rate / 2), output="sos"), values, axis=0)


def predicted(xml: str, recording: Recording) -> np.ndarray:
    """MuJoCo's inverse dynamics along a log, (N, n)."""
    model = mujoco.MjModel.from_xml_string(xml)
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    data, step = mujoco.MjData(model), 1 / recording.sample_rate
    q = low(recording.position, recording.sample_rate)
    dq = np.gradient(q, step, axis=0)
    ddq = np.gradient(dq, step, axis=0)
    torque = np.empty(q.shape)
    for k in range(len(q)):
        data.qpos[:], data.qvel[:], data.qacc[:] = q[k], dq[k], ddq[k]
        mujoco.mj_inverse(model, data)
        torque[k] = data.qfrc_inverse
    return torque


def test_there_are_six() -> None:
    assert plants() == ("cobot", "industrial", "palletizer", "redundant", "scara", "servo_arm")
    with pytest.raises(InputError, match="'hexapod'"):
        plant("hexapod")


@pytest.mark.parametrize("name", plants())
def test_without_faults_and_imperfections_torque_is_that_of_mujoco(name: str) -> None:
    own = plant(name)
    rng = np.random.default_rng(5)
    robot = own.ideal(own.robot(rng))
    recording = own.run(robot, own.motion(robot, rng), None)
    rate = recording.sample_rate
    expected, torque = (
        low(values, rate) for values in (predicted(own.links(robot).mjcf(name), recording), recording.torque)
    )
    edge = round(0.5 * rate)
    off = np.sqrt(((torque - expected)[edge:-edge] ** 2).mean(axis=0))
    assert (off < TOLERANCE * np.sqrt((torque[edge:-edge] ** 2).mean(axis=0))).all()


# Healthy robots: no fault has to be sized.
def healthy_seeds(name: str) -> list[int]:
    return [seed for seed in range(60) if kind_of(name, seed) == "healthy"]


@cache
def healthy_case(name: str) -> Case:
    return draw(name, healthy_seeds(name)[0])


@pytest.mark.parametrize("name", plants())
def test_one_seed_one_robot(name: str) -> None:
    seed, next_seed = healthy_seeds(name)[:2]
    one, same, other = healthy_case(name), draw(name, seed), draw(name, next_seed)
    assert one.model == same.model
    assert one.faults == same.faults
    for a, b in zip(one.runs, same.runs, strict=True):
        assert np.array_equal(a.position, b.position)
        assert np.array_equal(a.torque, b.torque)
    assert one.model != other.model
    assert 2 <= len(one.runs) <= 4


@pytest.mark.parametrize("name", plants())
def test_what_is_drawn_reads_as_any_log_and_model(name: str, tmp_path: Path) -> None:
    case = healthy_case(name)
    model, logs = case.write(tmp_path)
    robot = load_robot(model)
    for log, recording in zip(logs, case.runs, strict=True):
        read = read_log(log)
        assert read.joint_names == robot.joint_names
        assert np.array_equal(read.torque, recording.torque)
        assert not read.truth
        assert not read.truth_effects
        within = (robot.limits.lower - 0.3 < read.position) & (read.position < robot.limits.upper + 0.3)
        assert within.all()


@pytest.mark.parametrize("name", plants())
def test_a_fault_moves_the_torque_by_its_stated_share(name: str) -> None:
    seed = LARGE_FAULT[name]
    sick, well = draw(name, seed), draw(name, seed, healthy=True)
    (fault,) = sick.faults
    assert fault.share > 0.1
    assert not well.faults
    assert LEAST <= fault.share <= MOST
    joint = None if fault.joint is None else sick.runs[0].joint_names.index(fault.joint)
    first, clean = sick.runs[0], well.runs[0]
    assert moved(first.torque, clean.torque, joint) == pytest.approx(fault.share, rel=0.2)


def test_kinds_are_drawn_in_their_shares() -> None:
    kinds = [kind_of("cobot", seed) for seed in range(800)]
    for kind, share in SHARES.items():
        assert kinds.count(kind) / len(kinds) == pytest.approx(share, abs=0.05)


def test_a_pair_is_two_effects_at_different_joints() -> None:
    seed = next(seed for seed in range(60) if kind_of("servo_arm", seed) == "pair")
    first, second = draw("servo_arm", seed).faults
    assert first.effect != second.effect
    assert not {first.joint, first.into} & {second.joint, second.into} - {None}
