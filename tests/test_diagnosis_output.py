import io
import json
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import h5py
import mujoco
import numpy as np
import pytest
from rerun.chunk import RrdReader
from rich.console import Console

from diagnosis.correction import Term, corrected_model, correction_document, read_correction
from diagnosis.discrimination import next_experiment
from diagnosis.document import diagnosis_document, write_diagnosis
from diagnosis.experiments import why
from diagnosis.findings import Diagnosis
from diagnosis.forward import forward_gap
from diagnosis.job import diagnose_logs
from diagnosis.predict import logged_motion, predict, predict_torque, term_torque
from diagnosis.remedy import corrections, write_corrected
from diagnosis.report.page import render
from diagnosis.report.session import write_session
from diagnosis.report.summary import summary
from identification.errors import InputError
from identification.filtering import zero_phase_lowpass
from testbench.effects import effects, injection
from testbench.effects.base import Scope
from testbench.excitation_file import read_trajectory, write_excitation
from testbench.log import CHANNELS, Recording, read_log, write_log
from testbench.recording import POSE_RATE
from testbench.robot import Robot, load_robot

from .diagnosed import diagnosed, simulated_runs

# Two hinges and a slide, small enough that a run takes a moment.
ARM = """
<mujoco model="small_arm">
  <compiler angle="radian"/>
  <custom>
    <numeric name="velocity_limit" data="3 3 1"/>
    <numeric name="acceleration_limit" data="15 15 6"/>
  </custom>
  <worldbody>
    <body name="turret" pos="0 0 .2">
      <inertial pos=".02 0 .1" mass="6" diaginertia=".05 .05 .04"/>
      <joint name="turn" axis="0 0 1" range="-3 3" armature=".1" damping="4" frictionloss="3"/>
      <geom name="shell" type="box" size=".08 .1 .15" rgba=".9 .6 .1 1" contype="0" conaffinity="0"/>
      <body name="arm" pos="0 0 .3" quat=".7071068 .7071068 0 0">
        <inertial pos=".2 0 .02" mass="4" diaginertia=".02 .06 .06"/>
        <joint name="lift" axis="0 0 1" range="-2 2" armature=".08" damping="3" frictionloss="4"/>
        <body name="ram" pos=".4 0 0" quat=".7071068 0 .7071068 0">
          <inertial pos="0 .01 .1" mass="2" diaginertia=".01 .01 .002"/>
          <joint name="reach" type="slide" axis="0 0 1" range="0 .4"
                 armature="2" damping="20" frictionloss="6"/>
        </body>
      </body>
    </body>
  </worldbody>
  <actuator>
    <motor name="drive_turn" joint="turn" ctrlrange="-80 80"/>
    <motor name="drive_lift" joint="lift" ctrlrange="-80 80"/>
    <motor name="drive_reach" joint="reach" ctrlrange="-150 150"/>
  </actuator>
</mujoco>
"""
LIFT = 1


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    path = tmp_path_factory.mktemp("robot") / "arm.xml"
    path.write_text(ARM)
    return load_robot(path)


@pytest.fixture(scope="module")
def runs(robot: Robot) -> dict[str, Recording]:
    """Three runs of an arm with Stribeck friction on its second joint; the last is never diagnosed."""
    law = {"extra": 4.0, "velocity": 0.2, "exponent": 1.0}
    return simulated_runs(robot, [injection(robot, "stribeck_friction", "lift", law)], 3)


@pytest.fixture(scope="module")
def answer(robot: Robot, runs: dict[str, Recording]) -> Diagnosis:
    known = {name: runs[name] for name in ("run_1", "run_2")}
    return diagnosed(robot, known, [("stribeck_friction", LIFT, None)], ("presliding_hysteresis",))


@pytest.fixture(scope="module")
def folder(answer: Diagnosis, runs: dict[str, Recording], tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("diagnosis")
    write_diagnosis(answer, out / "diagnosis.json", ("something",), forward_gap(answer, runs, 1))
    write_log(runs["run_3"], out / "unseen.h5")
    return out


def test_document_follows_the_contract(folder: Path, answer: Diagnosis) -> None:
    document = json.loads((folder / "diagnosis.json").read_text())
    assert (document["format"], document["format_version"]) == ("gap-diagnosis", 1)
    assert document["verdict"] == "effect"
    (effect,) = document["effects"]
    assert (effect["effect"], effect["joint"]) == ("stribeck_friction", "lift")
    assert effect["confusable_with"] == ["presliding_hysteresis"]
    assert set(effect["parameters"]) == {"extra", "velocity", "exponent"}
    assert effect["parameters"]["extra"]["unit"] == "N·m"
    probabilities = [each["probability"] for each in document["candidates"]]
    assert probabilities == sorted(probabilities, reverse=True)
    gap = document["gap"]
    assert gap["joint_names"] == ["turn", "lift", "reach"]
    assert gap["unit"] == "N·m (N for a slide joint)"
    summed = {stage: sum(gap[stage]) for stage in ("parameters", "effects", "noise_floor")}
    closed = (summed["parameters"] - summed["effects"]) / (summed["parameters"] - summed["noise_floor"])
    assert gap["closed"] == pytest.approx(closed, rel=1e-12)
    first = document["where"][0]
    assert {"joint", "share", "regime", "gap_rms", "noise_rms", "unit", "regimes"} == set(first)
    assert first["joint"] == "lift"
    for part in first["regimes"]:
        low, high = part["interval"]
        assert 0 <= low <= high <= 1
    assert document["not_in_mjcf"] == ["something"]
    assert document["next_experiment"] is None


def test_coupling_names_its_second_joint(robot: Robot, runs: dict[str, Recording], tmp_path: Path) -> None:
    coupled = diagnosed(robot, {"run_1": runs["run_1"]}, [("joint_coupling", 0, 1)])
    write_diagnosis(coupled, tmp_path / "diagnosis.json")
    (effect,) = json.loads((tmp_path / "diagnosis.json").read_text())["effects"]
    assert (effect["joint"], effect["parameters"]["into"]) == ("turn", "lift")


def test_corrected_model_survives_its_file(answer: Diagnosis) -> None:
    model = corrected_model(answer)
    text = json.dumps(correction_document(model), allow_nan=False)
    again = read_correction(json.loads(text), "file")
    assert json.dumps(correction_document(again)) == text
    np.testing.assert_array_equal(again.limits.upper, model.limits.upper)


def test_prediction_closes_the_gap_of_a_run_never_diagnosed(
    folder: Path, runs: dict[str, Recording], answer: Diagnosis
) -> None:
    predict(folder, folder / "unseen.h5", folder / "predicted.h5")
    unseen = runs["run_3"]
    moving = np.abs(np.gradient(unseen.position[:, LIFT], 1e-3)) > 0.05

    def error(torque: np.ndarray) -> float:
        smooth = zero_phase_lowpass((torque - unseen.torque)[:, [LIFT]], 1000.0, 20.0)
        return float(np.sqrt(np.mean(smooth[moving] ** 2)))

    with h5py.File(folder / "predicted.h5") as file:
        assert list(file["joint/torque"].attrs["unit"]) == ["N·m", "N·m", "N"]
        nominal, parameters, corrected = (
            error(np.array(file[f"{stage}/torque"])) for stage in ("nominal", "parameters", "joint")
        )
        np.testing.assert_array_equal(file["time"], unseen.time)
    assert corrected < 0.5 * min(nominal, parameters)
    np.testing.assert_array_equal(
        read_log(folder / "predicted.h5").torque, predict_torque(corrected_model(answer), unseen).corrected
    )


def test_prediction_never_reads_the_logs_torque(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    predict(folder, folder / "unseen.h5", tmp_path / "one.h5")
    with h5py.File(folder / "unseen.h5") as source, h5py.File(tmp_path / "scrambled.h5", "w") as target:
        for key, value in source.attrs.items():
            target.attrs[key] = value
        for key in source:
            source.copy(key, target)
        rng = np.random.default_rng(0)
        for name in ("joint/torque", "joint/torque_command"):
            target[name][...] = 100 * rng.standard_normal(target[name].shape)
    predict(folder, tmp_path / "scrambled.h5", tmp_path / "two.h5")
    with h5py.File(tmp_path / "scrambled.h5", "a") as target:
        del target["joint/torque"]
    predict(folder, tmp_path / "scrambled.h5", tmp_path / "three.h5")
    for name in ("joint/torque", "nominal/torque", "parameters/torque"):
        with h5py.File(tmp_path / "one.h5") as one:
            for other in ("two.h5", "three.h5"):
                with h5py.File(tmp_path / other) as found:
                    np.testing.assert_array_equal(one[name], found[name])
    said = capsys.readouterr().out.splitlines()
    assert len(said) == 3
    assert said[0].startswith(f"{tmp_path / 'one.h5'}: predicted torque of 3 joints at ")


@pytest.mark.parametrize("name", effects())
def test_every_effect_of_the_catalogue_can_be_predicted(
    answer: Diagnosis, runs: dict[str, Recording], name: str
) -> None:
    # Gravity keeps the second joint's load from changing its sign, so backlash would not show there.
    joint: int | None = 0 if name == "backlash" else LIFT
    scope = effects()[name].DESCRIPTION.scope
    joint, into = (None, None) if scope is Scope.ROBOT else (joint, 2 if scope is Scope.PAIR else None)
    run = runs["run_3"]
    logged = logged_motion(corrected_model(answer), run)
    members = effects()[name].signature([logged], joint, into).members
    # A contact shows in no torque of the model; where it recurs, its shape says when.
    assert bool(members) == (name != "external_contact")
    shape = dict(members[0].shape) if members else {"kind": 2.0, "stretch": 1.0, "first": 0.5, "last": 1.0}
    size = members[0].count if members else 2
    torque = term_torque(Term(name, joint, into, shape, np.ones(size)), logged)
    assert torque.shape == run.position.shape
    assert np.isfinite(torque).all()
    assert np.any(torque != 0)


def test_shapes_of_another_version_are_one_clear_line(answer: Diagnosis, runs: dict[str, Recording]) -> None:
    logged = logged_motion(corrected_model(answer), runs["run_3"])
    old = Term("thermal_friction_drift", LIFT, None, {"time_constant": 20.0, "carried": 0.0}, np.ones(2))
    with pytest.raises(
        InputError, match="expected the shapes carried, power, time_constant, got carried, time"
    ):
        term_torque(old, logged)


def test_folder_without_a_diagnosis_is_one_clear_line(folder: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="diagnosis.json: expected a folder that diagnose has written"):
        predict(tmp_path, folder / "unseen.h5", tmp_path / "out.h5")
    (tmp_path / "diagnosis.json").write_text('{"format": "gap-diagnosis"}')
    with pytest.raises(InputError, match="correction"):
        predict(tmp_path, folder / "unseen.h5", tmp_path / "out.h5")


def test_corrected_model_runs_in_plain_mujoco_and_keeps_names_and_exterior(
    answer: Diagnosis, tmp_path: Path, robot: Robot
) -> None:
    write_corrected(answer, tmp_path / "corrected.xml")
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "corrected.xml"))
    assert [model.joint(j).name for j in range(3)] == list(robot.joint_names)
    assert model.geom("shell").rgba[0] == pytest.approx(0.9)
    assert [model.actuator(i).name for i in range(3)] == ["drive_turn", "drive_lift", "drive_reach"]
    assert list(tmp_path.iterdir()) == [tmp_path / "corrected.xml"]
    data = mujoco.MjData(model)
    for _ in range(500):
        mujoco.mj_step(model, data)
    assert np.isfinite(data.qpos).all()
    assert data.time == pytest.approx(500 * model.opt.timestep)


def test_injections_carry_the_named_values(answer: Diagnosis) -> None:
    first = corrections(answer)[0]
    assert (first.effect, first.joint) == ("stribeck_friction", LIFT)
    assert first.values["extra"] == answer.effects[0].parameters["extra"].value


def test_closed_loop_gap_shrinks_with_the_effect(answer: Diagnosis, runs: dict[str, Recording]) -> None:
    gap = forward_gap(answer, {"run_3": runs["run_3"]}, 1)
    assert gap is not None
    assert not gap.failed
    assert gap.torque["effects"][LIFT] < 0.6 * gap.torque["parameters"][LIFT]
    assert gap.torque["effects"][LIFT] < 0.6 * gap.torque["nominal"][LIFT]


def test_no_closed_loop_without_a_known_controller(answer: Diagnosis, runs: dict[str, Recording]) -> None:
    assert forward_gap(answer, {"run_1": replace(runs["run_1"], controller=None)}) is None
    assert forward_gap(answer, {"run_1": replace(runs["run_1"], reference_position=None)}) is None


def test_next_experiment_parts_the_rivals_further_and_can_be_simulated(
    answer: Diagnosis, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("diagnosis.discrimination.KINDS", ((0.2, 5), (0.2, 12)))
    monkeypatch.setattr("diagnosis.discrimination.IMPROVEMENTS", 6)
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
    monkeypatch.setattr("diagnosis.discrimination.KINDS", ((0.2, 5),))
    monkeypatch.setattr("diagnosis.discrimination.IMPROVEMENTS", 2)
    nothing = diagnosed(robot, {"run_1": runs["run_1"]}, [], hidden=(("payload", None),))
    found = next_experiment(nothing)
    assert found is not None
    assert "known payload on and off" in found.why
    assert found.file is None


def test_what_no_motion_shows_does_not_keep_others_from_being_shown(
    robot: Robot, runs: dict[str, Recording], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("diagnosis.discrimination.KINDS", ((0.2, 12),))
    monkeypatch.setattr("diagnosis.discrimination.IMPROVEMENTS", 2)
    monkeypatch.setattr("diagnosis.discrimination.BETTER", 0.0)
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
    monkeypatch.setattr("diagnosis.discrimination.KINDS", ((0.4, 5),))
    monkeypatch.setattr("diagnosis.discrimination.IMPROVEMENTS", 2)
    found = next_experiment(
        diagnosed(robot, {"run_1": runs["run_1"]}, [], hidden=(("transmission_ripple", 0),))
    )
    assert found is not None
    assert "ripple" in found.why


def test_a_motion_that_settles_one_answer_only_says_which() -> None:
    both = ("cable_spring", "gravity_spring")
    assert why(both, both, 12.0, "").endswith("The proposed motion parts them by 12 times the noise.")
    assert why(both, both[:1], 12.0, "").endswith("by 12 times the noise if it is cable spring.")
    assert "by only 2 times the noise" in why(both, both, 2.0, "")


def test_nothing_open_asks_for_nothing(robot: Robot, answer: Diagnosis) -> None:
    settled = replace(answer, effects=tuple(replace(each, confusable_with=()) for each in answer.effects))
    assert next_experiment(settled) is None


class Page(HTMLParser):
    """The page's sources and ids."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.sources: list[str] = []
        self.ids: set[str] = set()
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        values = dict(attrs)
        if tag in ("script", "link", "img", "iframe"):
            self.sources += [v for k in ("src", "href") if (v := values.get(k))]
        if values.get("id"):
            self.ids.add(str(values["id"]))


def test_page_shows_every_section_without_network(answer: Diagnosis, runs: dict[str, Recording]) -> None:
    text = render(answer, "today", ("nothing carries it",), forward_gap(answer, runs, 1))
    page = Page(text)
    assert page.sources == []
    assert {"where", "evidence", "waterfall", "gap", "signature-0", "residual", "forward"} <= page.ids
    for words in ("Stribeck friction", "presliding hysteresis", "nothing carries it", "explains less"):
        assert words in text
    figures = re.findall(r'<script type="application/json" id="[\w-]+-data">(.*?)</script>', text, re.DOTALL)
    assert all(json.loads(figure)["data"] for figure in figures)


def test_page_of_a_clean_robot_names_nothing(robot: Robot, runs: dict[str, Recording]) -> None:
    plain = diagnosed(robot, {"run_1": runs["run_1"]}, [])
    page = Page(render(replace(plain, ranked=(), where=()), "today"))
    assert not {"where", "evidence", "signature-0", "forward"} & page.ids


def test_summary_is_at_most_ten_lines(answer: Diagnosis) -> None:
    console = Console(width=400, record=True, file=io.StringIO())
    console.print(summary(answer))
    lines = console.export_text().splitlines()
    assert len(lines) <= 10
    assert any("Stribeck friction, lift: 93 %" in line for line in lines)


def test_where_there_is_no_gap_nothing_is_closed_and_no_place_is_told(answer: Diagnosis) -> None:
    none = replace(answer, verdict="none", effects=())
    assert answer.gap.closed is not None
    assert diagnosis_document(none)["gap"]["closed"] is None
    assert "where" in summary(answer).plain
    assert "where" not in summary(none).plain


def test_session_holds_both_residuals_and_the_moving_arm(answer: Diagnosis, tmp_path: Path) -> None:
    write_session(answer, tmp_path / "session.rrd")
    rows: dict[str, int] = {}
    for chunk in RrdReader(tmp_path / "session.rrd").stream():
        rows[chunk.entity_path] = max(rows.get(chunk.entity_path, 0), chunk.num_rows)
    for run in answer.prepared.runs:
        for joint in answer.robot.joint_names:
            for series in ("before", "after"):
                assert rows[f"/{run.name}/joints/{joint}/residual/{series}"] == len(run.time)
        assert rows[f"/{run.name}/joints/lift/effects/1_stribeck_friction"] == len(run.time)
        assert f"/{run.name}/joints/turn/effects/1_stribeck_friction" not in rows
        assert rows[f"/{run.name}/arm/measured/ram"] == len(run.logged.time[:: round(1000 / POSE_RATE)])
    assert {"/summary", "/evidence"} <= set(rows)


def test_a_log_that_is_too_short_is_named_by_its_path(robot: Robot, folder: Path, tmp_path: Path) -> None:
    run, end = read_log(folder / "unseen.h5"), slice(150)
    names = ("time", *(channel for _, channel, _, _ in CHANNELS))
    short = {name: None if getattr(run, name) is None else getattr(run, name)[end] for name in names}
    write_log(replace(run, **short), tmp_path / "short.h5")
    with pytest.raises(InputError, match=rf"{tmp_path}/short\.h5: time: expected at least 200 samples"):
        diagnose_logs(robot.path, [tmp_path / "short.h5"], tmp_path / "d")
    with pytest.raises(InputError, match=rf"{tmp_path}/short\.h5: time: expected at least 200 samples"):
        predict(folder, tmp_path / "short.h5", tmp_path / "p.h5")


def test_job_refuses_an_unknown_effect_and_another_robots_log(
    robot: Robot, folder: Path, tmp_path: Path
) -> None:
    with pytest.raises(InputError, match="without: expected the name of an effect"):
        diagnose_logs(robot.path, [folder / "unseen.h5"], tmp_path, without=["friction"])
    other = tmp_path / "other.xml"
    other.write_text(ARM.replace('"lift"', '"raise"'))
    with pytest.raises(InputError, match=r"unseen.h5: joint_names"):
        diagnose_logs(other, [folder / "unseen.h5"], tmp_path)
