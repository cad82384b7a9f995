"""Drives identified from commanded and measured position: what is found, written, predicted and refused."""

import json
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from identification.output_error.plant import LOAD_FRICTION, plant_table
from studies.drives.leg import KD, KP, TRUTH, recorded, table, written
from testbench.cli import main
from testbench.drives.differences import differences
from testbench.drives.identified import identify_drives
from testbench.drives.reading import read_servo_logs
from testbench.log import Controller, Recording, read_log, write_log
from testbench.robot import load_robot

from ..one_line import complaint


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the leg, two of its logs, and what was identified from the first."""
    made = tmp_path_factory.mktemp("drives")
    model = written(made)
    for seed, name in ((0, "fit.h5"), (1, "check.h5")):
        write_log(recorded(model, seed=seed), made / name)
    logs = [str(made / "fit.h5"), "--validate", str(made / "check.h5")]
    found = ["--out", str(made / "found"), "--write-model", str(made / "found" / "identified.xml")]
    main(["identify", "--model", str(model), *logs, *found])
    return made


@pytest.fixture(autouse=True)
def own_place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Stand in a folder that no other test writes to."""
    monkeypatch.chdir(tmp_path)


def test_delay_armature_and_friction_are_found_within_their_deviations(folder: Path) -> None:
    document = json.loads((folder / "found" / "estimate.json").read_text())
    checked = 0
    for figure in document["figures"]:
        if figure["name"] in TRUTH:
            truth = TRUTH[figure["name"]][("hip", "knee").index(figure["joint"])]
            assert abs(figure["value"] - truth) < 3 * figure["std"], figure
            assert figure["std"] < 0.3 * figure["prior_std"], figure
            checked += 1
    assert checked == 8
    damping = {each["joint"]: each for each in document["figures"] if each["name"] == "damping"}
    for joint, truth in (("hip", 1.2), ("knee", 1.15)):
        assert abs(damping[joint]["value"] - truth) < 3 * damping[joint]["std"]


def test_what_differs_from_the_model_is_named_with_its_size(folder: Path) -> None:
    differing = json.loads((folder / "found" / "estimate.json").read_text())["differences"]
    named = {(each["joint"], each["name"]) for each in differing}
    for joint in ("hip", "knee"):
        assert {(joint, name) for name in ("armature", "coulomb", "delay")} <= named
    # The gains are as stated.
    assert not {name for _, name in named} & {"kp_scale", "kd_scale", "offset"}


def test_nothing_differs_where_the_robot_is_as_stated(folder: Path) -> None:
    robot = load_robot(folder / "leg.xml")
    plant = plant_table(robot.parameters, np.zeros(2), robot.limits.torque)
    logs = [recorded(robot.path, plant=plant, seed=seed) for seed in (3, 4)]
    for log, name in zip(logs, ("like_1.h5", "like_2.h5"), strict=True):
        write_log(log, folder / name)
    read = read_servo_logs([folder / "like_1.h5", folder / "like_2.h5"], robot, None)
    found = identify_drives(robot, [read[0].servo], [read[0].run])
    assert not differences(found, [read[1].run])


def test_the_position_of_another_run_is_missed_far_less_than_by_the_model_as_published(folder: Path) -> None:
    errors = json.loads((folder / "found" / "estimate.json").read_text())["position_rms"]["validation"]
    assert np.all(np.array(errors["identified"]) < 0.1 * np.array(errors["given"]))
    # Half a count, and little else.
    assert np.all(np.array(errors["identified"]) < 1e-3)


def test_predict_writes_position_velocity_and_torque_of_the_simulated_loop(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    given = ["--diagnosis", str(folder / "found"), "--out", str(folder / "p.h5")]
    main(["predict", str(folder / "check.h5"), *given, "--repeat", str(folder / "check.h5")])
    predicted, measured = read_log(folder / "p.h5"), read_log(folder / "check.h5")
    assert np.sqrt(np.mean((predicted.position - measured.position) ** 2)) < 1e-3
    assert predicted.velocity is not None
    slope = np.gradient(predicted.position, predicted.time, axis=0)
    assert np.sqrt(np.mean((slope - predicted.velocity) ** 2)) < 0.1
    assert 0.1 < np.abs(predicted.torque).max() < 25
    assert "repeatability" in capsys.readouterr().out


def test_the_written_model_moves_so_in_plain_mujoco(folder: Path) -> None:
    model = mujoco.MjModel.from_xml_path(str(folder / "found" / "identified.xml"))
    data, measured = mujoco.MjData(model), read_log(folder / "check.h5")
    assert measured.reference_position is not None
    data.qpos[:] = measured.position[0]
    steps, moved = round(1 / (measured.sample_rate * model.opt.timestep)), []
    for now in measured.reference_position:
        moved.append(data.qpos.copy())
        data.ctrl[:] = now
        mujoco.mj_step(model, data, steps)
    # Its history of controls begins with zeros, and its friction is a soft constraint.
    missed = (np.array(moved) - measured.position)[100:]
    assert np.sqrt(np.mean(missed**2)) < 2e-3


def test_gains_that_are_wrong_within_their_spread_are_scaled_by_known_masses(folder: Path) -> None:
    robot = load_robot(folder / "leg.xml")
    log = read_log(folder / "fit.h5")
    stated = replace(log, controller=Controller("position_servo", 100.0, 1.2 * KP, 1.2 * KD))
    write_log(stated, folder / "stated.h5")
    (read,) = read_servo_logs([folder / "stated.h5"], robot, None)
    wide = replace(read.servo, spread=np.full(2, 0.3))
    apart = replace(wide, ratio_spread=1.0)
    stds = []
    for servo in (wide, apart):
        found = identify_drives(robot, [servo], [read.run])
        scales = [each for each in found.figures if each.name in ("kp_scale", "kd_scale")]
        assert len(scales) == 4
        for figure in scales:
            assert abs(figure.value - 1 / 1.2) < 3 * figure.std
            assert figure.prior_std == pytest.approx(0.3)
        stds.append([each.std for each in scales if each.name == "kd_scale"])
    # A ratio of the gains that is known makes kd as well known as kp.
    assert np.all(np.array(stds[0]) < 0.7 * np.array(stds[1]))


def test_friction_that_grows_with_the_load_is_distinguished_from_coulomb_friction(folder: Path) -> None:
    robot = load_robot(folder / "leg.xml")
    plant = table(robot.path)
    plant[:, LOAD_FRICTION] = 0.12
    write_log(recorded(robot.path, plant=plant, seed=2), folder / "loaded.h5")
    (read,) = read_servo_logs([folder / "loaded.h5"], robot, None)
    found = identify_drives(robot, [read.servo], [read.run], ("load_dependent_friction",))
    for figure in found.figures:
        if figure.name == "load_friction":
            assert abs(figure.value - 0.12) < 3 * figure.std
            assert figure.std < 0.03
        if figure.name == "coulomb":
            truth = TRUTH["coulomb"][("hip", "knee").index(figure.joint)]
            assert abs(figure.value - truth) < 3 * figure.std


def _without_command(log: Recording) -> Recording:
    return replace(log, reference_position=None)


def _its_own_command(log: Recording) -> Recording:
    assert log.reference_position is not None
    return replace(
        log, reference_position=np.column_stack([log.position[:, 0], log.reference_position[:, 1]])
    )


def _firmware_gains(log: Recording) -> Recording:
    return replace(log, controller=Controller("position_servo", 100.0, 400 * KP, 400 * KD))


@pytest.mark.parametrize(
    ("spoil", "field", "said"),
    [
        (_without_command, "reference/position", "commanded positions"),
        (_its_own_command, "reference/position", "identical arrays of hip"),
        (_firmware_gains, "kp", "--gain-factor"),
    ],
)
def test_bad_logs_get_their_line(
    folder: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str], spoil: object, field: str, said: str
) -> None:
    assert callable(spoil)
    path = tmp_path / "bad.h5"
    write_log(spoil(read_log(folder / "fit.h5")), path)
    command = f"identify --model {folder / 'leg.xml'} {path} --out {tmp_path / 'out'}"
    line = complaint(command, capfd)
    assert line.startswith(f"{path}: {field}: ")
    assert said in line


def test_a_log_without_gains_says_where_to_state_them(
    folder: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    log, path = read_log(folder / "fit.h5"), tmp_path / "bare.npz"
    np.savez(path, time=log.time, position=log.position, reference_position=log.reference_position)
    command = f"identify --model {folder / 'leg.xml'} {path} --out {tmp_path / 'out'}"
    with pytest.raises(SystemExit):
        main([*command.split(), "--drive", "position_servo"])
    assert "--kp and --kd" in capfd.readouterr().err
    assert "--drive" in complaint(f"{command} --kp 20", capfd)


def test_what_is_for_logs_without_torque_is_refused_for_others(
    folder: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    log, path = read_log(folder / "fit.h5"), tmp_path / "torque.h5"
    write_log(replace(log, torque=np.zeros_like(log.position), controller=None), path)
    command = f"identify --model {folder / 'leg.xml'} {path} --out {tmp_path / 'out'} --fit-share 0.5"
    assert "--fit-share: expected logs without torque" in complaint(command, capfd)
    servo = (
        f"identify --model {folder / 'leg.xml'} {folder / 'fit.h5'} --out {tmp_path / 'out'} --estimator irls"
    )
    assert "expected logs with torque" in complaint(servo, capfd)
