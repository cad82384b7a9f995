"""The command line: what each command leaves, and one line for each kind of bad input."""

import json
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path

import h5py
import numpy as np
import pytest

from identification.base_parameters import base_parameters
from testbench.cli import app, main
from testbench.log import read_log
from testbench.robot import load_robot

from .one_line import complaint
from .small_arm import ARM, SCENARIO

COMMANDS = sorted(name for name in app if not name.startswith("-"))
DESIGN = ["--harmonics", "4", "--base-frequency", "0.25", "--starts", "1"]


@pytest.fixture(scope="module")
def chain(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the small arm, its excitation, two logs and what was identified from them."""
    folder = tmp_path_factory.mktemp("chain")
    model, motion = folder / "arm.xml", folder / "T.json"
    model.write_text(ARM)
    (folder / "scenario.yaml").write_text(SCENARIO)
    main(["excite", "--model", str(model), "--out", str(motion), *DESIGN])
    for seed, name in ((1, "fit.h5"), (2, "check.h5")):
        drive = ["--model", str(model), "--trajectory", str(motion), "--seed", str(seed)]
        main(["simulate", *drive, "--periods", "1", "--out", str(folder / name)])
    files = [str(folder / "fit.h5"), "--validate", str(folder / "check.h5")]
    written = ["--write-model", str(folder / "identified.xml")]
    main(["identify", "--model", str(model), *files, "--out", str(folder / "found"), *written])
    return folder


@pytest.fixture
def place(chain: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty folder to stand in, with links to the chain's files."""
    for name in ("arm.xml", "T.json", "fit.h5", "check.h5", "scenario.yaml"):
        (tmp_path / name).symlink_to(chain / name)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("command", [[], *([name] for name in COMMANDS)])
def test_help_is_there_and_fits_a_terminal(command: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    main([*command, "--help"])
    out = capsys.readouterr().out
    assert out.startswith("Usage: testbench")
    assert max(len(line) for line in out.splitlines()) <= 80
    assert "empty-" not in out
    assert "--no-" not in out


def test_the_commands_of_the_contract_are_there() -> None:
    assert {"run", "excite", "simulate", "identify", "list", "view"} <= set(COMMANDS)


def test_the_version_is_that_of_the_package(capsys: pytest.CaptureFixture[str]) -> None:
    main(["--version"])
    assert capsys.readouterr().out.strip() == version("identification-testbench")


def test_list_names_what_can_be_chosen(capsys: pytest.CaptureFixture[str]) -> None:
    main(["list", "--json"])
    names = json.loads(capsys.readouterr().out)
    assert list(names) == ["models", "estimators", "differentiation", "trajectories", "criteria", "effects"]
    assert {"ols", "wls", "irls", "tls"} <= set(names["estimators"])
    assert names["models"] == ["energy", "inverse_dynamic", "power"]
    assert names["criteria"] == ["condition", "hadamard", "logdet"]
    assert "stribeck_friction" in names["effects"]
    main(["list"])
    shown = capsys.readouterr().out
    assert [name for members in names.values() for name in members if name not in shown] == []


def test_identify_leaves_the_estimate_of_the_contract(chain: Path) -> None:
    assert sorted(path.name for path in (chain / "found").iterdir()) == ["estimate.json", "report.html"]
    found = json.loads((chain / "found" / "estimate.json").read_text())
    assert found["joint_names"] == ["shoulder", "elbow"]
    assert {"name", "value", "std", "truth"} <= set(found["base_parameters"][0])
    # A log's truth is never read.
    assert {row["truth"] for row in found["base_parameters"]} == {None}
    assert found["torque_rms"]["unit"] == "N·m"
    for key in ("torque_rms", "relative_residual"):
        assert len(found[key]["fit"]) == len(found[key]["validation"]) == 2
    assert found["condition_number"] > 1
    assert 1 < found["effective_samples"] < 10_000


def test_the_identified_model_is_one_that_identifies_the_same(chain: Path) -> None:
    given, written = (load_robot(chain / name) for name in ("arm.xml", "identified.xml"))
    base = base_parameters(given.chain)
    found = json.loads((chain / "found" / "estimate.json").read_text())["base_parameters"]
    values = dict(zip(base.names, base.values(written.parameters), strict=True))
    for row in found:
        if row["name"] in values:
            assert abs(values[row["name"]] - row["value"]) < 4 * row["std"] + 1e-9


def test_the_chain_of_commands_finds_the_friction_of_the_model(chain: Path) -> None:
    found = json.loads((chain / "found" / "estimate.json").read_text())
    rows = {row["name"]: row for row in found["base_parameters"]}
    truth = {"fv_1": 3.0, "fc_1": 2.0, "fv_2": 1.0, "fc_2": 1.0}
    # Four standard deviations: once in 16000 a parameter, by chance.
    assert {
        name for name, value in truth.items() if abs(rows[name]["value"] - value) > 4 * rows[name]["std"]
    } == set()
    assert max(rows[name]["std"] / value for name, value in truth.items()) < 0.2


def test_commands_leave_nothing_else_where_they_are_called(chain: Path) -> None:
    assert sorted(path.name for path in chain.iterdir()) == [
        "T.json",
        "arm.xml",
        "check.h5",
        "fit.h5",
        "found",
        "identified.xml",
        "scenario.yaml",
    ]


def test_one_seed_gives_one_log_on_any_number_of_threads(place: Path) -> None:
    for jobs in ("1", "2"):
        arguments = f"simulate --model arm.xml --trajectory T.json --seed 1 --periods 1 --jobs {jobs}"
        main([*arguments.split(), "--out", f"{jobs}.h5"])
    one, two, first = (read_log(name) for name in ("1.h5", "2.h5", "fit.h5"))
    assert np.array_equal(one.torque, two.torque)
    assert np.array_equal(one.torque, first.torque)


def test_simulate_says_what_it_wrote(place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    main(["simulate", "--model", "arm.xml", "--trajectory", "T.json", "--periods", "1", "--out", "new.h5"])
    assert capsys.readouterr().out == "new.h5: 4 s of 2 joints at 1000 Hz\n"


def test_an_effect_can_be_put_into_the_simulated_robot(place: Path) -> None:
    effect = "stribeck_friction:elbow:extra=5,velocity=0.1"
    drive = "simulate --model arm.xml --trajectory T.json --seed 1 --periods 1 --out with.h5 --effect"
    main([*drive.split(), effect])
    change = np.std(read_log("with.h5").torque - read_log("fit.h5").torque, axis=0)
    assert change[1] > 0.5


MISUSE = [
    ("fly", ["command", "'fly'", "valid: "]),
    ("run", ["SCENARIO", "expected a value, got none"]),
    ("excite --model arm.xml", ["--out", "expected a value, got none"]),
    ("excite --model arm.xml --out x --harmonics five", ["--harmonics", "a whole number", "'five'"]),
    ("excite --model arm.xml --out x --base-frequency slow", ["--base-frequency", "a number", "'slow'"]),
    ("excite --model arm.xml --out x --speed 3", ["option", "got --speed"]),
    ("excite --model arm.xml --out x --seed -1", ["--seed", "at least 0, got -1"]),
    ("excite --model arm.xml --out x --jobs 0", ["--jobs", "at least 1, got 0"]),
    ("run a.yaml b.yaml", ["b.yaml"]),
    (
        "identify --model arm.xml fit.h5 --parameters --out d",
        ["--parameters", "at least one value, got none"],
    ),
    ("identify --model arm.xml fit.h5 --validate --out d", ["--validate", "at least one value, got none"]),
    ("diagnose --model arm.xml fit.h5 --without --out d", ["--without", "at least one value, got none"]),
]


@pytest.mark.parametrize(("arguments", "says"), MISUSE, ids=[arguments for arguments, _ in MISUSE])
def test_wrong_arguments_are_reported_in_one_line(
    place: Path, arguments: str, says: list[str], capfd: pytest.CaptureFixture[str]
) -> None:
    line = complaint(arguments, capfd)
    assert line.startswith("testbench: ")
    assert [part for part in says if part not in line] == [], line


BAD_VALUES = [
    ("excite --model none.xml --out x.json", ["none.xml: model", "no such file"]),
    ("excite --model arm.xml --out x.json --criterion best", ["criterion", "'best'", "valid: hadamard"]),
    ("excite --model arm.xml --out x.json --trajectory spline", ["trajectory", "'spline'", "valid: fourier"]),
    ("excite --model arm.xml --out x.json --starts 0", ["starts", "at least 1", "got 0"]),
    ("excite --model arm.xml --out x.json --harmonics 1", ["harmonics", "got 1"]),
    ("excite --model arm.xml --out x.json --base-frequency -1", ["base_frequency", "got -1"]),
    ("excite --model arm.xml --out x.json --base-frequency nan", ["base_frequency", "got nan"]),
    ("excite --model arm.xml --out x.json --limit-share 2", ["limit_share", "got 2"]),
    ("excite --model arm.xml --out arm.xml/x.json", ["arm.xml/x.json: out", "below a folder"]),
    ("excite --model arm.xml --out .", ["out", "a file to write"]),
    ("simulate --model arm.xml --trajectory none.json --out x.h5", ["none.json", "no such file"]),
    ("simulate --model arm.xml --trajectory arm.xml --out x.h5", ["arm.xml: trajectory", "JSON"]),
    ("simulate --model arm.xml --trajectory T.json --out arm.xml/x.h5", ["arm.xml/x.h5: out"]),
    ("simulate --model arm.xml --trajectory T.json --out x.h5 --periods 0", ["periods", "at least 1, got 0"]),
    ("simulate --model arm.xml --trajectory T.json --out x.h5 --controller pid", ["controller", "'pid'"]),
    ("simulate --model arm.xml --trajectory T.json --out x.h5 --torque-noise -1", ["torque_noise", "-1"]),
    ("simulate --model arm.xml --trajectory T.json --out x.h5 --torque-noise nan", ["torque_noise", "nan"]),
    ("simulate --model arm.xml --trajectory T.json --out x.h5 --encoder-bits -3", ["encoder_bits", "-3"]),
    ("simulate --model arm.xml --trajectory T.json --out x.h5 --effect rust:elbow", ["'rust'", "backlash"]),
    ("simulate --model arm.xml --trajectory T.json --out x.h5 --effect backlash:knee", ["'knee'", "elbow"]),
    (
        "simulate --model arm.xml --trajectory T.json --out x.h5 --effect stribeck_friction:elbow:extra=inf",
        ["extra", "a finite number", "inf"],
    ),
    (
        "simulate --model arm.xml --trajectory T.json --out x.h5 --effect backlash:elbow:gap=0.1,gap=0.2",
        ["backlash gap", "one value", "another, '0.2'"],
    ),
    (
        "simulate --model arm.xml --trajectory T.json --out x.h5 --effect joint_elasticity:elbow:stiffness=0",
        ["joint_elasticity stiffness", "0.001 to inf N·m/rad", "got 0"],
    ),
    ("identify --model arm.xml none.h5 --out d", ["none.h5: log", "no such file"]),
    ("identify --model arm.xml T.json --out d", ["T.json: log", "an object of numbers a sample"]),
    ("identify --model arm.xml fit.h5 --out d --estimator best", ["estimator", "'best'", "wls"]),
    (
        "identify --model arm.xml fit.h5 --out d --differentiation best",
        ["differentiation", "'best'", "rloess"],
    ),
    ("identify --model arm.xml fit.h5 --out d --identification-model best", ["model", "'best'", "power"]),
    (
        "identify --model arm.xml fit.h5 --out d --identification-model energy --estimator extended_kalman",
        ["model", "inverse_dynamic for the estimator extended_kalman", "'energy'"],
    ),
    ("identify --model arm.xml fit.h5 --out d --parameters rust", ["'rust'", "viscous"]),
    ("identify --model arm.xml fit.h5 --out d --cutoff -2", ["cutoff", "-2"]),
    ("identify --model arm.xml fit.h5 --out d --cutoff nan", ["cutoff", "nan"]),
    ("identify --model arm.xml fit.h5 --out d --cutoff 0.1", ["at least 40 s", "got 4 s"]),
    ("identify --model arm.xml fit.h5 --out d --dead-zone -1", ["dead", "-1"]),
    ("identify --model arm.xml fit.h5 --out d --dead-zone 100", ["samples", "dead zone"]),
    ("identify --model arm.xml fit.h5 --out arm.xml", ["arm.xml", "out"]),
    ("identify --model arm.xml fit.h5 --validate none.h5 --out d", ["none.h5: log", "no such file"]),
    ("run none.yaml", ["none.yaml: scenario", "no such file"]),
    ("run scenario.yaml --out arm.xml", ["arm.xml", "out"]),
    ("compare weather --out d", ["question", "'weather'", "criteria, estimators"]),
    ("view .", ["session.rrd", "no such file"]),
]


@pytest.mark.parametrize(("arguments", "says"), BAD_VALUES, ids=[arguments for arguments, _ in BAD_VALUES])
def test_bad_input_is_reported_in_one_line(
    place: Path, arguments: str, says: list[str], capfd: pytest.CaptureFixture[str]
) -> None:
    line = complaint(arguments, capfd)
    assert ": expected " in line
    assert ", got " in line
    assert [part for part in says if part not in line] == [], line


BAD_SCENARIOS = [
    ("speed: 3", ["s.yaml: speed", "a known field", "'speed'"]),
    ("noise: {hum: 3}", ["s.yaml: noise.hum", "a known field", "encoder_bits"]),
    ("excitation: {base_frequency: 6 rad/s}", ["s.yaml: excitation.base_frequency", "Hz", "'6 rad/s'"]),
    ("simulation: {periods: two}", ["s.yaml: simulation.periods", "'two'"]),
    ("simulation: {physics_timestep: 0.0007}", ["s.yaml: physics_timestep", "0.001 s", "0.0007"]),
    ("identification: {estimator: best}", ["s.yaml: identification.estimator", "'best'", "wls"]),
    ("identification: {differentiation: best}", ["s.yaml: identification.differentiation", "'best'"]),
    ("identification: {model: best}", ["s.yaml: identification.model", "'best'", "power"]),
    ("identification: {parameters: [rust]}", ["s.yaml: identification.parameters", "'rust'", "viscous"]),
    ("identification: {parameters: []}", ["s.yaml: identification.parameters", "at least one"]),
    ("model: none.xml", ["none.xml: model", "no such file"]),
]


@pytest.mark.parametrize(("text", "says"), BAD_SCENARIOS, ids=[text for text, _ in BAD_SCENARIOS])
def test_a_bad_scenario_is_reported_in_one_line(
    place: Path, text: str, says: list[str], capfd: pytest.CaptureFixture[str]
) -> None:
    head = "name: s\n" if text.startswith("model") else "name: s\nmodel: arm.xml\n"
    (place / "s.yaml").write_text(f"{head}{text}\n")
    line = complaint("run s.yaml --out d", capfd)
    assert [part for part in says if part not in line] == [], line


def in_body(text: str) -> str:
    return f"<mujoco><worldbody>{text}</worldbody></mujoco>"


LINK = '<inertial pos=".1 0 0" mass="1" diaginertia=".01 .01 .01"/>'
BAD_MODELS = [
    (in_body(f"<body><freejoint/>{LINK}</body>"), ["joint 0", "got free"]),
    (in_body(f'<body><joint name="hip" type="ball"/>{LINK}</body>'), ["hip", "got ball"]),
    (
        in_body(f'<body><freejoint name="root"/>{LINK}<body><joint name="hip"/>{LINK}</body></body>'),
        ["root, which floats", "a fixed base", "--fix-base"],
    ),
    (in_body(f"<body>{LINK}</body>"), ["joint", "at least one"]),
    ("<mujoco><worldbody>", ["XML that MuJoCo loads"]),
    ("<mujoco><nonsense/></mujoco>", ["XML that MuJoCo loads", "nonsense"]),
    (in_body(f'<body><joint name="j" type="slide"/>{LINK}</body>'), ["position range of j", "finite"]),
    (ARM.replace("-80 80", "-.01 .01"), ["torque limit of shoulder", "hold the arm still"]),
    (ARM.replace('data="4 4"', 'data="4"'), ["velocity_limit", "2 positive values"]),
    (ARM.replace('armature=".05"', 'armature="-.005"'), ["armature of elbow", "zero or more", "got -0.005"]),
    (ARM.replace('damping="1"', 'damping="-1"'), ["damping of elbow", "zero or more", "got -1"]),
    (ARM.replace('frictionloss="2"', 'frictionloss="-2"'), ["frictionloss of shoulder", "got -2"]),
]


@pytest.mark.parametrize(("xml", "says"), BAD_MODELS, ids=[says[-1] for _, says in BAD_MODELS])
def test_a_model_that_will_not_do_is_reported_in_one_line(
    place: Path, xml: str, says: list[str], capfd: pytest.CaptureFixture[str]
) -> None:
    (place / "bad.xml").write_text(xml)
    line = complaint("excite --model bad.xml --out x.json --starts 1", capfd)
    assert line.startswith("bad.xml: ")
    assert [part for part in says if part not in line] == [], line


def changed(source: Path, target: Path, change: Callable[[h5py.File], None]) -> None:
    """A copy of a log with something changed."""
    target.write_bytes(source.read_bytes())
    with h5py.File(target, "a") as file:
        change(file)


def put_nan(file: h5py.File) -> None:
    file["joint/torque"][7:17, 1] = np.nan


def other_joints(file: h5py.File) -> None:
    file.attrs["joint_names"] = ["waist", "knee"]


def degrees(file: h5py.File) -> None:
    file["joint/position"].attrs["unit"] = "deg"


def stands_still(file: h5py.File) -> None:
    file["joint/position"][...] = 0.3


def one_joint_moves(file: h5py.File) -> None:
    file["joint/position"][:, 1] = 0.3


def few_samples(file: h5py.File) -> None:
    for name in [*(f"joint/{name}" for name in file["joint"]), "time"]:
        values, unit = file[name][:60], file[name].attrs["unit"]
        del file[name]
        file[name] = values
        file[name].attrs["unit"] = unit
    del file["reference"]


BAD_LOGS = [
    (put_nan, ["bad.h5: joint/torque", "nan at sample 7, joint elbow"]),
    (other_joints, ["bad.h5: joint_names", "'shoulder', 'elbow'", "'waist', 'knee'"]),
    (degrees, ["bad.h5: joint/position", "deg"]),
    (stands_still, ["bad.h5: motion", "dead zone", "got 0"]),
    (few_samples, ["bad.h5: time", "at least 0.2 s", "got 0.06 s"]),
]


def test_a_motion_that_leaves_parameters_open_is_refused_when_asked(
    place: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    changed(place / "fit.h5", place / "bad.h5", one_joint_moves)
    line = complaint("identify --strict --model arm.xml bad.h5 --out d", capfd)
    for part in ("bad.h5: motion", "nothing that reveals", "elbow"):
        assert part in line


@pytest.mark.parametrize(("change", "says"), BAD_LOGS, ids=[change.__name__ for change, _ in BAD_LOGS])
def test_a_log_that_will_not_do_is_reported_in_one_line(
    place: Path, change: Callable[[h5py.File], None], says: list[str], capfd: pytest.CaptureFixture[str]
) -> None:
    changed(place / "fit.h5", place / "bad.h5", change)
    line = complaint("identify --model arm.xml bad.h5 --out d", capfd)
    assert [part for part in says if part not in line] == [], line


def test_a_trajectory_of_another_robot_is_refused(place: Path, capfd: pytest.CaptureFixture[str]) -> None:
    (place / "other.xml").write_text(ARM.replace('"elbow"', '"knee"'))
    line = complaint("simulate --model other.xml --trajectory T.json --out x.h5", capfd)
    assert "T.json: joint_names: expected the model's joints shoulder, knee, got shoulder, elbow" in line


def test_what_was_there_survives_bad_input(place: Path, capfd: pytest.CaptureFixture[str]) -> None:
    (place / "d").mkdir()
    (place / "d" / "estimate.json").write_text("{}")
    changed(place / "fit.h5", place / "bad.h5", put_nan)
    complaint("identify --model arm.xml bad.h5 --out d", capfd)
    assert (place / "d" / "estimate.json").read_text() == "{}"
