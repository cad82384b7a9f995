"""When a push was, from what is left of the torque at the joints where it stands out."""

from dataclasses import replace

import numpy as np
import pytest

from testbench.effects.logged import Logged
from testbench.effects.push import windows

from .exact_motion import exactly
from .small_arm import small_arm

RATE, SAMPLES = 1000.0, 6000
TOLERANCE = 30


@pytest.fixture(scope="module")
def still(tmp_path_factory) -> Logged:
    """The small arm along a slow motion, with a little noise of the torque."""
    arm = small_arm(tmp_path_factory.mktemp("arm"))
    time = np.arange(SAMPLES) / RATE
    q = 0.3 * np.sin(time)[:, None] * np.ones(2)
    run = exactly(arm, time, 20.0, (q, np.gradient(q, time, axis=0), -q))
    noise = 0.02 * np.random.default_rng(1).normal(size=(SAMPLES, 2))
    return replace(run, tau=run.predicted + noise)


def with_torque(run: Logged, joint: int, extra: np.ndarray) -> Logged:
    tau = run.tau.copy()
    tau[:, joint] += extra
    return replace(run, tau=tau)


def between(first: int, last: int, size: float) -> np.ndarray:
    extra = np.zeros(SAMPLES)
    extra[first:last] = size
    return extra


def assert_is(found: tuple[int, int], first: int, last: int) -> None:
    assert found == (pytest.approx(first, abs=TOLERANCE), pytest.approx(last, abs=TOLERANCE))


def test_it_is_between_half_heights_though_only_its_peaks_stand_out(still):
    # What is slow makes the usual size large: only the horns of this one are four times that.
    slow = np.sin(2 * np.pi * np.arange(SAMPLES) / 3000)
    push = between(2000, 3000, 4.5) + between(2000, 2150, 2.0) + between(2850, 3000, 2.0)
    (found,) = windows(with_torque(still, 1, push + slow), [1])
    assert_is(found, 2000, 3000)


def test_what_stands_out_at_other_joints_does_not_change_it(still):
    run = with_torque(still, 1, between(2000, 2600, 1.0))
    run = with_torque(run, 0, between(2500, 3400, 40.0))
    (found,) = windows(run, [1])
    assert_is(found, 2000, 2600)


def test_two_pushes_are_two_windows(still):
    extra = between(1000, 1400, 1.0) + between(4000, 4300, -2.0)
    first, second = windows(with_torque(still, 1, extra), [0, 1])
    assert_is(first, 1000, 1400)
    assert_is(second, 4000, 4300)


def test_no_push_no_window(still):
    assert windows(replace(still, tau=still.predicted), [0, 1]) == []
