"""The next experiment, and what it says of itself."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from diagnosis.decision.findings import Diagnosis
from diagnosis.experiment.discriminating_motion import next_experiment
from diagnosis.experiment.reasons import why
from diagnosis.experiment.rivals import still_open
from diagnosis.experiment.separation import Separation
from testbench.excitation_file import read_trajectory, write_excitation
from testbench.log import Recording
from testbench.robot import Robot

from ...diagnosed import diagnosed


def _designed_quickly(
    patch: pytest.MonkeyPatch, frequency: float, *harmonics: int, improvements: int = 2, better: float = 2.0
) -> None:
    """Few kinds of motion and improvements; a motion is worth it that is so many times better."""
    patch.setattr("diagnosis.experiment.discriminating_motion.FREQUENCY", frequency)
    patch.setattr("diagnosis.experiment.discriminating_motion.HARMONICS", harmonics)
    patch.setattr("diagnosis.experiment.discriminating_motion.IMPROVEMENTS", improvements)
    patch.setattr("diagnosis.experiment.discriminating_motion.BETTER", better)


def test_next_experiment_parts_the_rivals_further_and_can_be_simulated(
    answer: Diagnosis, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    _designed_quickly(monkeypatch, 0.2, 5, 12, improvements=6)
    found = next_experiment(answer, seed=1)
    assert found is not None
    assert found.excitation is not None
    assert "small reversals" in found.why
    assert set(found.separates) == {"stribeck_friction", "presliding_hysteresis"}
    assert found.excitation.margins.kept
    # A design for these rivals on runs as long as those at hand, which were drawn for nothing.
    assert found.separation > 0.5 * found.separation_now
    write_excitation(found.excitation, tmp_path / "next.json")
    names, motion = read_trajectory(tmp_path / "next.json")
    assert (names, motion.duration) == (("turn", "lift", "reach"), 5.0)
    again = next_experiment(answer, seed=1)
    assert again is not None
    assert again.separation == found.separation


def test_gain_error_asks_for_a_load_not_for_a_motion(
    robot: Robot, runs: dict[str, Recording], monkeypatch: pytest.MonkeyPatch
) -> None:
    _designed_quickly(monkeypatch, 0.2, 5)
    nothing = diagnosed(robot, {"run_1": runs["run_1"]}, [], hidden=(("payload", None),))
    found = next_experiment(nothing)
    assert found is not None
    assert "known payload on and off" in found.why
    assert found.file is None


def test_what_no_motion_shows_does_not_keep_others_from_being_shown(
    robot: Robot, runs: dict[str, Recording], monkeypatch: pytest.MonkeyPatch
) -> None:
    _designed_quickly(monkeypatch, 0.2, 12, better=0.0)
    hidden = (("payload", None), ("stribeck_friction", 0))
    found = next_experiment(diagnosed(robot, {"run_1": runs["run_1"]}, [], hidden=hidden))
    assert found is not None
    assert found.excitation is not None
    assert found.separates == ("none", "stribeck_friction")
    assert "The proposed motion shows stribeck friction" in found.why
    assert "Left: payload: record the same motion with a known payload on and off" in found.why


def test_a_motion_of_another_length_than_the_logs_is_judged(
    robot: Robot, runs: dict[str, Recording], monkeypatch: pytest.MonkeyPatch
) -> None:
    _designed_quickly(monkeypatch, 0.4, 5)
    found = next_experiment(
        diagnosed(robot, {"run_1": runs["run_1"]}, [], hidden=(("transmission_ripple", 0),))
    )
    assert found is not None
    assert "ripple" in found.why


def test_a_fast_run_is_judged_by_few_of_its_samples(
    answer: Diagnosis, monkeypatch: pytest.MonkeyPatch
) -> None:
    open_, run = still_open(answer), answer.prepared.runs[0].logged
    assert open_ is not None
    judge = Separation(answer, open_)
    few = judge.of_run(run)
    monkeypatch.setattr("diagnosis.experiment.separation.SAMPLE_RATE", run.sample_rate)
    # The rows that are kept are a little denser at one rate than at the other.
    np.testing.assert_allclose(np.sqrt(few), np.sqrt(judge.of_run(run)), rtol=0.12)


def test_a_motion_that_settles_one_answer_only_says_which() -> None:
    both = ("cable_spring", "gravity_spring")
    assert why(both, both, 12.0, "").endswith("The proposed motion parts them by 12 times the noise.")
    assert why(both, both[:1], 12.0, "").endswith("by 12 times the noise if it is cable spring.")
    assert "by only 2 times the noise" in why(both, both, 2.0, "")


def test_nothing_open_asks_for_nothing(robot: Robot, answer: Diagnosis) -> None:
    settled = replace(answer, effects=tuple(replace(each, confusable_with=()) for each in answer.effects))
    assert next_experiment(settled) is None


def test_where_the_model_sets_no_limit_the_motion_keeps_to_what_the_runs_reached(
    robot: Robot, runs: dict[str, Recording], monkeypatch: pytest.MonkeyPatch
) -> None:
    _designed_quickly(monkeypatch, 0.2, 12, better=0.0)
    none = np.full(robot.joints, np.inf)
    limits = replace(robot.limits, lower=-none, upper=none, velocity=none, acceleration=none, torque=none)
    free = replace(robot, limits=limits)
    given = {"run_1": runs["run_1"]}
    found = next_experiment(diagnosed(free, given, [], hidden=(("stribeck_friction", 0),)))
    assert found is not None
    assert found.excitation is not None
    assert found.why.endswith("Where the model sets no limit, it keeps to what these runs reached.")
    q, dq, _ = found.excitation.trajectory.evaluate(np.linspace(0, 5, 2001))
    reached = runs["run_1"].position
    assert np.all(q >= reached.min(axis=0) - 1e-3)
    assert np.all(q <= reached.max(axis=0) + 1e-3)
    speed = np.abs(np.gradient(reached, runs["run_1"].time, axis=0)).max(axis=0)
    assert np.all(np.abs(dq).max(axis=0) <= speed)
    assert found.excitation.margins.kept
