"""A first motion that leaves two effects open, the motion that the diagnosis proposes, what it resolves."""

import json
import re
from pathlib import Path

import h5py
import pytest

from identification.errors import InputError
from studies.loop.job import close_loop
from studies.loop.outcome import Place, read_round
from studies.loop.scenario import load_loop_scenario
from studies.loop.summary import summary

from ..small_arm import ARM

# The elbow turns so little that its cable may as well be a gravity spring.
SCENARIO = """
name: small
model: arm.xml
effects: [{effect: cable_spring, joint: elbow, values: {stiffness: 3.0}}]
first: {harmonics: 4, base_frequency: 0.25 Hz, limit_share: 0.22}
simulation: {periods: 1, control_rate: 500 Hz, physics_timestep: 0.0005 s}
"""
CABLE, GRAVITY = Place("cable_spring", "elbow"), Place("gravity_spring", "elbow")


@pytest.fixture(scope="module")
def scenario_file(tmp_path_factory):
    folder = tmp_path_factory.mktemp("loop")
    (folder / "arm.xml").write_text(ARM)
    (folder / "scenario.yaml").write_text(SCENARIO)
    return folder / "scenario.yaml"


@pytest.fixture(scope="module")
def closed(scenario_file):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("diagnosis.experiment.discriminating_motion.FREQUENCY", 0.25)
        patch.setattr("diagnosis.experiment.discriminating_motion.HARMONICS", (5, 12))
        patch.setattr("diagnosis.experiment.discriminating_motion.DRAWS", 2)
        patch.setattr("diagnosis.experiment.discriminating_motion.IMPROVEMENTS", 4)
        return close_loop(scenario_file, scenario_file.parent / "out"), scenario_file.parent / "out"


def test_the_proposed_motion_resolves_what_the_first_left_open(closed):
    found, _ = closed
    first, last = found.rounds
    # A tilt that would look like either on these few degrees is larger than bases have it.
    assert {*first.named, *first.confused} == {CABLE, GRAVITY}
    assert first.proposes
    assert last.named == found.acts == (CABLE,)
    assert found.is_resolved
    assert found.is_right


def test_every_round_leaves_logs_diagnosis_report_and_the_motion_that_it_proposes(closed):
    found, out = closed
    for name in ("run_1.h5", "run_2.h5", "diagnosis.json", "report.html", "next_experiment.json"):
        assert (out / "round_1" / name).is_file(), name
    assert (out / "round_2" / "run_3.h5").is_file()
    proposed, run = out / "round_1" / "next_experiment.json", out / "round_2" / "motion_1.json"
    assert proposed.read_bytes() == run.read_bytes()
    document = json.loads((out / "loop.json").read_text())
    assert (document["resolved"], document["right"]) == (True, True)
    assert document["acts"][0]["parameters"]["stiffness"] == 3.0
    assert [each["runs"] for each in document["rounds"]] == [2, 3]
    assert (out / "report.html").is_file()
    assert len(summary(found).plain.splitlines()) <= 10


def test_nothing_that_a_diagnosis_reads_tells_the_truth(closed):
    _, out = closed
    for path in sorted(out.glob("round_*/run_*.h5")):
        with h5py.File(path) as file:
            assert "truth" not in file
            assert "cable" not in str({key: str(value) for key, value in file.attrs.items()})
    assert "cable" not in (out / "nominal.xml").read_text()


def test_finished_rounds_are_not_run_again(closed, scenario_file):
    found, out = closed
    written = {path: path.stat().st_mtime_ns for path in out.glob("round_*/*")}
    (out / "loop.json").unlink()
    again = close_loop(scenario_file, out)
    assert {path: path.stat().st_mtime_ns for path in out.glob("round_*/*")} == written
    assert again.rounds == found.rounds
    assert (out / "loop.json").is_file()


def test_a_folder_of_another_scenario_is_refused(closed, scenario_file):
    nominal = (closed[1] / "nominal.xml").read_text()
    with pytest.raises(InputError, match="the scenario and seed that the folder was begun with"):
        close_loop(scenario_file, closed[1], seed=5)
    assert (closed[1] / "nominal.xml").read_text() == nominal


def test_one_seed_gives_one_log(closed, scenario_file, tmp_path, monkeypatch):
    monkeypatch.setattr("studies.loop.job.diagnose_logs", _stopped)
    with pytest.raises(KeyboardInterrupt):
        close_loop(scenario_file, tmp_path)
    with h5py.File(tmp_path / "round_1/run_2.h5") as one, h5py.File(closed[1] / "round_1/run_2.h5") as two:
        assert (one["joint/torque"][...] == two["joint/torque"][...]).all()


def _stopped(*_, **__):
    """In place of the diagnosis: logs are all that is made."""
    raise KeyboardInterrupt


def test_a_rival_of_the_whole_robot_keeps_its_place():
    document = {
        "effects": [
            {
                "effect": "actuator_lag",
                "joint": "elbow",
                "probability": 0.6,
                "confusable_with": ["torque_delay"],
            }
        ],
        "candidates": [{"effect": "torque_delay", "joint": None, "probability": 0.3}],
        "not_observable": [],
        "runs": ["run_1"],
        "next_experiment": None,
    }
    found = read_round(1, document)
    assert found.confused == (Place("torque_delay", None),)
    assert found.probabilities[Place("torque_delay", None)] == 0.3
    assert not found.is_settled


GOOD = "name: arm\nmodel: arm.xml\n"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (GOOD + "first: {speed: 3}\n", "first.speed: expected a known field.*'speed'.*limit_share"),
        (GOOD + "rounds: 0\n", "rounds: expected greater than or equal to 1, got 0"),
        (GOOD + "follow: nothing\n", "follow: expected 'proposed', 'random' or 'first', got 'nothing'"),
        (GOOD + "first: {base_frequency: 3 s}\n", "first.base_frequency: expected a number in Hz"),
        (GOOD + "effects: [{joint: elbow}]\n", "effects.0.effect: expected a value, got nothing"),
        ("name: arm\nmodel: missing.xml\n", "model: expected an existing MJCF or URDF file, got missing.xml"),
        ("- name\n", "scenario: expected a mapping of fields, got list"),
    ],
)
def test_a_faulty_scenario_is_one_clear_line(scenario_file: Path, text: str, message: str) -> None:
    path = scenario_file.parent / "faulty.yaml"
    path.write_text(text)
    with pytest.raises(InputError) as caught:
        load_loop_scenario(path)
    assert re.search(message, str(caught.value))
    assert "\n" not in str(caught.value)


def test_an_effect_that_the_model_cannot_have_is_refused_before_anything_is_written(scenario_file):
    path = scenario_file.parent / "impossible.yaml"
    path.write_text(GOOD + "effects: [{effect: cable_spring, joint: wrist}]\n")
    out = scenario_file.parent / "impossible"
    with pytest.raises(InputError, match="wrist"):
        close_loop(path, out)
    assert not out.exists()


def test_the_shipped_scenarios_load_and_bear_their_files_names():
    paths = sorted((Path(__file__).parents[2] / "scenarios").glob("loop_*.yaml"))
    assert [load_loop_scenario(path).name for path in paths] == [path.stem for path in paths]
