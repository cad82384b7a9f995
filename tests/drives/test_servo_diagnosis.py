"""Position servos diagnosed: the fault that acts, robots in order, what is written, what is refused."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import mujoco
import numpy as np
import pytest

from diagnosis.decision.probability import held_by
from diagnosis.servos.diagnose import diagnose_servos
from diagnosis.servos.evidence import Fitted, Weighed
from diagnosis.servos.findings import ServoDiagnosis
from diagnosis.servos.words import sentence
from identification.output_error.fit import Fit
from identification.output_error.plant import (
    DELAY,
    FRICTION_CENTRE,
    FRICTION_SLOPE,
    GAP,
    KP_SCALE,
    plant_table,
)
from identification.output_error.servo_loop import Window, simulate
from identification.output_error.servo_run import ServoRun
from identification.parameters import COULOMB, VISCOUS
from studies.drives.arm import KINDS
from studies.drives.leg import KD, KP, command, recorded
from testbench.cli import main
from testbench.drives.effects import drive_effects
from testbench.drives.stated import LONGEST_DELAY, Servo
from testbench.log import Controller, Recording, read_log, write_log
from testbench.robot import load_robot

from ..one_line import complaint

RATE = 50.0
LEG = KINDS[0]
# Columns and values of the knee's drive.
FAULTS = {
    "gain_error": {KP_SCALE: 1.25},
    "backlash": {GAP: np.radians(0.6)},
    # The middle is that of the knee's command.
    "position_dependent_friction": {COULOMB: 0.2, FRICTION_SLOPE: 0.5, FRICTION_CENTRE: -0.4},
}


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The leg's model, which states its friction."""
    return LEG.written(tmp_path_factory.mktemp("servos"))


@pytest.fixture(autouse=True)
def own_place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Stand in a folder that no other test writes to."""
    monkeypatch.chdir(tmp_path)


def log_of(model: Path, changes: dict[int, float], joint: int | slice = 1) -> Recording:
    """A run of the leg as its model has it, but for entries of the plant's table at a joint."""
    robot = load_robot(model)
    parameters = robot.parameters.copy().reshape(2, -1)
    # A model is never quite right.
    parameters[:, VISCOUS] *= 1.2
    plant = plant_table(parameters.ravel(), np.full(2, 0.001), robot.limits.torque)
    for column, value in changes.items():
        plant[joint, column] = value
    return recorded(model, rate=RATE, duration=6.0, seed=2, plant=plant)


def diagnosed(
    model: Path,
    changes: dict[int, float],
    without: tuple[str, ...] = (),
    joint: int | slice = 1,
) -> ServoDiagnosis:
    robot, log, full = load_robot(model), log_of(model, changes, joint), np.ones(2)
    assert log.reference_position is not None
    servo = Servo(KP, KD, 0.03 * full, 0 * full, LONGEST_DELAY * full, robot.limits.torque, 0 * full)
    run = ServoRun("run", log.position, log.reference_position, RATE, KP, KD)
    return diagnose_servos(robot, [servo], [run], without)


@pytest.mark.parametrize("fault", FAULTS)
def test_the_fault_that_acts_is_stated_at_its_joint(model: Path, fault: str) -> None:
    found = diagnosed(model, FAULTS[fault])
    assert [(each.effect, each.joint) for each in found.effects] == [(fault, "knee")]
    (quantity,) = found.effects[0].parameters.values()
    truth = FAULTS[fault][drive_effects()[fault].moves[0][0]]
    assert abs(float(np.asarray(quantity.value)) - truth) < 0.25 * truth
    # One run does not show what another would.
    assert 0.95 * held_by(1) < found.effects[0].probability <= held_by(1)
    assert "the catalogue lacks (90%)" in sentence(replace(found, unknown=0.9))
    assert "the catalogue lacks" not in sentence(replace(found, unknown=0.1))


def test_a_delay_that_re_identification_takes_in_is_stated_beside_what_is_left(model: Path) -> None:
    late_and_loose = {DELAY: 0.02, GAP: np.radians(0.5)}
    found = diagnosed(model, late_and_loose, without=("backlash",), joint=slice(None))
    # What is left of the position error has nothing to do with the delay.
    assert np.all(found.corrected > 0.9 * found.parameters)
    assert np.sum(found.parameters**2) > 4 * np.sum(found.noise**2)
    assert [(each.effect, each.joint) for each in found.effects] == [("command_delay", None)]


def test_a_joint_with_two_faults_gets_the_likelier_name_and_a_note(model: Path) -> None:
    found = diagnosed(model, FAULTS["backlash"] | FAULTS["gain_error"])
    assert [each.joint for each in found.effects] == ["knee"]
    assert any("another effect is, at that joint" in note for note in found.notes)


def test_an_effect_that_two_rounds_weigh_is_two_hypotheses() -> None:
    fits = [Fit(cast(Any, None), *(np.zeros(2) for _ in range(6)), iterations=1) for _ in range(2)]
    first, second = (Weighed(Fitted(None, each), 0.5, 0.0, 0.0) for each in fits)
    assert second not in (first,)
    assert second in (first, second)


def test_nothing_is_stated_of_a_robot_in_order(model: Path) -> None:
    found = diagnosed(model, {})
    assert not found.effects
    assert found.verdict in ("none", "parameters")
    assert found.unknown < 0.5


def test_a_fault_outside_the_catalogue_gets_no_other_name(model: Path) -> None:
    found = diagnosed(model, FAULTS["backlash"], without=("backlash",))
    assert "backlash" not in {each.effect for each in (*found.effects, *found.candidates)}
    assert found.verdict != "none"


def test_every_effect_changes_the_simulated_motion_and_none_has_no_size(model: Path) -> None:
    robot = load_robot(model)
    plant = plant_table(robot.parameters, np.zeros(2), np.full(2, 2.0))
    follow = command(RATE, 4.0, 1)
    window = Window(follow, KP, KD, 0, len(follow), follow[0], np.zeros(2))
    tables = [plant]
    for effect in drive_effects().values():
        changed = plant.copy()
        for column, value, _ in effect.laws[-1].fixed:
            changed[:, column] = value
        for column, weight in effect.moves:
            changed[:, column] += weight * effect.smallest
        tables.append(changed)
        assert 0 < effect.healthy < effect.smallest < effect.largest
        assert set(effect.confused_with) <= set(drive_effects())
    runs = [run.position for (run,) in simulate(robot.chain, np.stack(tables), [window], RATE)]
    for name, moved in zip(drive_effects(), runs[1:], strict=True):
        assert np.abs(moved - runs[0]).max() > 1e-5, name


def test_the_command_writes_what_it_says_and_predict_reads_it(
    model: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log, out = tmp_path / "late.h5", tmp_path / "out"
    write_log(log_of(model, {DELAY: 0.03}, slice(None)), log)
    main(["diagnose", "--model", str(model), str(log), "--out", str(out)])
    said = capsys.readouterr().out
    document = json.loads((out / "diagnosis.json").read_text())
    (effect,) = document["effects"]
    assert (effect["effect"], effect["joint"]) == ("command_delay", None)
    assert abs(effect["parameters"]["delay"]["value"] - 0.03) < 0.005
    assert document["verdict"] == "effect"
    assert "command delay at hip, knee" in said
    gap = document["gap"]
    assert np.all(np.array(gap["effects"]) < 0.2 * np.array(gap["nominal"]))
    assert sum(each["share"] for each in document["where"]) == pytest.approx(1)
    assert "command delay" in (out / "report.html").read_text()
    assert mujoco.MjModel.from_xml_path(str(out / "corrected.xml")).nu == 2
    main(["predict", str(log), "--diagnosis", str(out), "--out", str(tmp_path / "p.h5")])
    missed = read_log(tmp_path / "p.h5").position - read_log(log).position
    assert np.sqrt(np.mean(missed**2)) < 2e-3


def _its_own_command(log: Recording) -> Recording:
    assert log.reference_position is not None
    own = np.column_stack([log.position[:, 0], log.reference_position[:, 1]])
    return replace(log, reference_position=own)


def _firmware_gains(log: Recording) -> Recording:
    return replace(log, controller=Controller("position_servo", RATE, 400 * KP, 400 * KD))


@pytest.mark.parametrize(
    ("spoil", "field", "said"),
    [
        (_its_own_command, "reference/position", "identical arrays of hip"),
        (_firmware_gains, "kp", "--gain-factor"),
    ],
)
def test_bad_logs_get_their_line(
    model: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str], spoil: object, field: str, said: str
) -> None:
    assert callable(spoil)
    path = tmp_path / "bad.h5"
    write_log(spoil(log_of(model, {})), path)
    line = complaint(f"diagnose --model {model} {path} --out {tmp_path / 'out'}", capfd)
    assert line.startswith(f"{path}: {field}: ")
    assert said in line
    assert not (tmp_path / "out").exists()


def test_options_for_torque_and_names_of_no_effect_are_refused(
    model: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "log.h5"
    write_log(log_of(model, {}), path)
    base = f"diagnose --model {model} {path} --out {tmp_path / 'out'}"
    assert "--cutoff: expected logs with torque" in complaint(f"{base} --cutoff 20", capfd)
    assert "backlash" in complaint(f"{base} --without payload", capfd)
    bare = tmp_path / "bare.h5"
    write_log(replace(log_of(model, {}), controller=None, torque=np.zeros((300, 2))), bare)
    command = f"diagnose --model {model} {bare} --out {tmp_path / 'out'} --drive position_servo"
    assert "--kp and --kd" in complaint(command, capfd)
