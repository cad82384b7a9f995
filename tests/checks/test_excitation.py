"""What a motion does not determine is reported with its joint."""

from dataclasses import replace

import numpy as np
import pytest

from recordings.checks.excitation import check
from recordings.checks.subject import Subject

from ..synthetic import synthetic_result, synthetic_robot


@pytest.fixture(scope="module")
def robot(tmp_path_factory):
    return synthetic_robot(tmp_path_factory.mktemp("arm"))


def _sentences(robot, recording):
    return {each.code: each.sentence for each in check(Subject(robot, {"run": recording}))}


def test_a_joint_that_stands_still_keeps_the_models_parameters(robot):
    healthy = synthetic_result(robot, 12.0).fit_recordings[0]
    still = healthy.position.copy()
    # Counts of an encoder are no motion.
    still[:, 1] = 0.3 + 1e-6 * (np.arange(len(still)) % 2)
    assert set(_sentences(robot, healthy)) == set()
    assert _sentences(robot, replace(healthy, position=still))["still"].startswith("lift stood still")


def test_one_sine_on_every_joint_is_said(robot):
    healthy = synthetic_result(robot, 12.0).fit_recordings[0]
    angle = 2 * np.pi * 0.3 * healthy.time[:, None] + np.arange(3)
    swinging = np.array([0.0, 0.0, 0.2]) + np.array([0.8, 0.6, 0.1]) * np.sin(angle)
    sentence = _sentences(robot, replace(healthy, position=swinging))["one_sine"]
    assert sentence.startswith("One sine of one frequency on every joint (0.3 Hz)")
