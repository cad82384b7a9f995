"""The robot-log format: what is written is read back, and every broken rule is named."""

from collections.abc import Callable
from dataclasses import fields, replace
from pathlib import Path

import h5py
import numpy as np
import pytest

from identification.errors import InputError
from testbench.drive import Drive
from testbench.log import Controller, Recording, check_joints, read_log, write_log

REAL_LOGS = sorted((Path(__file__).parents[2] / "shared" / "data").glob("*/*.h5"))
SAMPLES, JOINTS = 40, 3


def recording(slide: bool = False) -> Recording:
    random = np.random.default_rng(0)
    channels = ("position", "torque", "velocity", "torque_command", "temperature")
    references = ("reference_position", "reference_velocity", "reference_acceleration")
    values = {name: random.normal(size=(SAMPLES, JOINTS)) for name in (*channels, *references)}
    return Recording(
        robot="arm",
        joint_names=("a", "b", "c"),
        sample_rate=250.0,
        source="simulation",
        time=0.1 + np.arange(SAMPLES) / 250,
        controller=Controller("pd_with_model_feedforward", 250.0, np.ones(JOINTS), 2 * np.ones(JOINTS), 0.05),
        truth={"velocity": random.normal(size=(SAMPLES, JOINTS)), "parameters": np.arange(14.0 * JOINTS)},
        provenance={"created": "2026-01-02T03:04:05+00:00", "seed": 7, "note": "Stäubli"},
        is_slide=(False, False, True) if slide else (),
        **values,
    )


def equal(one: object, other: object) -> bool:
    """Fields equal, arrays bit for bit."""
    if isinstance(one, (Recording, Controller)):
        pairs = [(getattr(one, field.name), getattr(other, field.name)) for field in fields(one)]
        return type(one) is type(other) and all(equal(a, b) for a, b in pairs)
    if isinstance(one, dict):
        return (
            isinstance(other, dict)
            and one.keys() == other.keys()
            and all(equal(one[k], other[k]) for k in one)
        )
    if isinstance(one, np.ndarray):
        return np.array_equal(one, other)
    return one == other


@pytest.mark.parametrize("slide", [False, True])
def test_what_is_written_is_read_back(tmp_path: Path, slide: bool) -> None:
    written = recording(slide)
    write_log(written, tmp_path / "run.h5")
    assert equal(read_log(tmp_path / "run.h5", with_truth=True), written)
    assert [path.name for path in tmp_path.iterdir()] == ["run.h5"]


def test_only_what_is_required_need_be_there(tmp_path: Path) -> None:
    full = recording()
    least = Recording("arm", full.joint_names, 250.0, "hardware", full.time, full.position, full.torque)
    write_log(least, tmp_path / "run.h5")
    got = read_log(tmp_path / "run.h5")
    assert equal(replace(got, provenance={}), least)
    assert list(got.provenance) == ["created"]


def test_gains_need_no_unit(tmp_path: Path) -> None:
    write_log(recording(), tmp_path / "run.h5")
    with h5py.File(tmp_path / "run.h5", "r+") as file:
        for name in ("kp", "kd"):
            del file[f"controller/{name}"].attrs["unit"]
    assert equal(read_log(tmp_path / "run.h5").controller, recording().controller)


def test_an_unknown_controller_needs_no_rate(tmp_path: Path) -> None:
    write_log(recording(), tmp_path / "run.h5")
    with h5py.File(tmp_path / "run.h5", "r+") as file:
        for name in ("rate", "coulomb_smoothing"):
            del file["controller"].attrs[name]
        del file["controller/kp"], file["controller/kd"]
        file["controller"].attrs["kind"] = "unknown"
    assert read_log(tmp_path / "run.h5").controller == Controller("unknown", 250.0)


def test_truth_is_left_out_unless_asked_for(tmp_path: Path) -> None:
    write_log(recording(), tmp_path / "run.h5")
    assert read_log(tmp_path / "run.h5").truth == {}


def test_one_recording_makes_one_file_byte_for_byte(tmp_path: Path) -> None:
    for name in ("one.h5", "two.h5"):
        write_log(recording(), tmp_path / name)
    assert (tmp_path / "one.h5").read_bytes() == (tmp_path / "two.h5").read_bytes()


def test_units_are_spelled_as_in_the_format(tmp_path: Path) -> None:
    write_log(recording(), tmp_path / "hinges.h5")
    write_log(recording(slide=True), tmp_path / "mixed.h5")
    with h5py.File(tmp_path / "hinges.h5") as file:
        expected = {"time": "s", "joint/position": "rad", "joint/torque": "N·m", "joint/velocity": "rad/s"}
        expected |= {
            "joint/temperature": "degC",
            "reference/acceleration": "rad/s^2",
            "truth/velocity": "rad/s",
        }
        assert {name: file[name].attrs["unit"] for name in expected} == expected
        without: list[str] = []
        file.visititems(
            lambda name, item: (
                without.append(name) if isinstance(item, h5py.Dataset) and "unit" not in item.attrs else None
            )
        )
        assert without == []
    with h5py.File(tmp_path / "mixed.h5") as file:
        assert list(file["joint/torque"].attrs["unit"]) == ["N·m", "N·m", "N"]


def test_a_failed_write_leaves_the_old_log(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "run.h5"
    write_log(recording(), path)
    before = path.read_bytes()

    def full_disk(self: Path, target: Path) -> None:
        raise OSError("No space left on device")

    monkeypatch.setattr(Path, "replace", full_disk)
    with pytest.raises(InputError, match=r"run\.h5: out: .* No space left"):
        write_log(recording(slide=True), path)
    assert path.read_bytes() == before
    assert [found.name for found in tmp_path.iterdir()] == ["run.h5"]


def test_datasets_the_format_does_not_know_are_not_read(tmp_path: Path) -> None:
    write_log(recording(), tmp_path / "run.h5")
    with h5py.File(tmp_path / "run.h5", "a") as file:
        file["vendor/blob"] = "text"
        file["joint/current"] = np.full(3, np.nan)
    assert equal(read_log(tmp_path / "run.h5", with_truth=True), recording())


def attribute(name: str, value: object, holder: str = "/") -> Callable[[h5py.File], None]:
    return lambda file: file[holder].attrs.__setitem__(name, value)


def without(name: str, holder: str = "/") -> Callable[[h5py.File], None]:
    return lambda file: file[holder].attrs.__delitem__(name)


def values(name: str, change: Callable[[np.ndarray], np.ndarray]) -> Callable[[h5py.File], None]:
    def edit(file: h5py.File) -> None:
        old, unit = file[name][...], file[name].attrs["unit"]
        del file[name]
        file[name] = change(old)
        file[name].attrs["unit"] = unit

    return edit


def put(index: object, value: float) -> Callable[[np.ndarray], np.ndarray]:
    def change(array: np.ndarray) -> np.ndarray:
        array[index] = value
        return array

    return change


def driven() -> Recording:
    """A run without torque: a servo's, with its duty and an unsigned current."""
    random = np.random.default_rng(1)
    shape = (SAMPLES, JOINTS)
    drive = Drive("duty", torque_per_unit=np.array([2.0, np.nan, 3.0]), spread=np.full(JOINTS, 0.2))
    return replace(
        recording(),
        torque=np.full(shape, np.nan),
        duty=random.uniform(-1, 1, shape),
        current=random.uniform(0, 1, shape),
        unsigned=("current",),
        drive=drive,
        controller=Controller("position_servo", 250.0, np.ones(JOINTS), np.zeros(JOINTS), delay=0.004),
    )


def test_a_log_without_torque_says_what_the_drives_did(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    write_log(driven(), path)
    found = read_log(path)
    assert not found.has_torque
    for name in ("duty", "current", "position"):
        np.testing.assert_array_equal(getattr(found, name), getattr(driven(), name))
    assert (found.voltage, found.unsigned) == (None, ("current",))
    assert found.drive is not None
    assert found.drive.kind == "duty"
    np.testing.assert_array_equal(found.drive.torque_per_unit, [2.0, np.nan, 3.0])
    np.testing.assert_array_equal(found.drive.spread, [0.2, 0.2, 0.2])
    assert found.drive.limit is None
    assert equal(found.controller, driven().controller)
    with h5py.File(path) as file:
        assert file.attrs["format_version"] == 1.1
        assert "joint/torque" not in file


def test_a_log_with_torque_alone_stays_of_version_1(tmp_path: Path) -> None:
    write_log(recording(), tmp_path / "run.h5")
    with h5py.File(tmp_path / "run.h5") as file:
        assert file.attrs["format_version"] == 1
        assert file.attrs["format_version"].dtype.kind == "i"


BROKEN_DRIVES = [
    (attribute("kind", "belt", "drive"), ["drive kind", "'belt'", "duty"]),
    (values("drive/spread", put(1, -0.1)), ["drive/spread", "-0.1 at b"]),
    (values("drive/torque_per_unit", lambda array: array[:2]), ["drive/torque_per_unit", "(3,)", "(2,)"]),
    (attribute("delay", -1.0, "controller"), ["controller delay", "from 0 on"]),
    (attribute("format_version", 1), ["joint/torque", "a dataset"]),
]


@pytest.mark.parametrize(("damage", "says"), BROKEN_DRIVES)
def test_a_broken_rule_of_drives_is_named(
    tmp_path: Path, damage: Callable[[h5py.File], None], says: list[str]
) -> None:
    write_log(driven(), tmp_path / "broken.h5")
    with h5py.File(tmp_path / "broken.h5", "a") as file:
        damage(file)
    with pytest.raises(InputError) as error:
        read_log(tmp_path / "broken.h5")
    assert [part for part in says if part not in str(error.value)] == []


BROKEN = [
    (attribute("format", "log"), ["format", "'robot-log'", "'log'"]),
    (without("format"), ["format", "none"]),
    (attribute("format_version", 2), ["format_version", "expected the number 1", "got 2"]),
    (attribute("format_version", "1"), ["format_version", "expected the number 1", "got '1'"]),
    (attribute("joint_names", "a,b,c"), ["joint_names", "a list of 3 strings", "got one string, 'a,b,c'"]),
    (without("robot"), ["robot"]),
    (without("source"), ["source"]),
    (attribute("joint_names", ["a", "b"]), ["joint/position", "(40, 2)", "(40, 3)"]),
    (attribute("joint_names", ["a", "b", "b"]), ["joint_names", "distinct"]),
    (attribute("joint_names", [1, 2, 3]), ["joint_names", "strings"]),
    (attribute("sample_rate", 1000.0), ["sample_rate", "250 Hz", "1000"]),
    (attribute("sample_rate", "fast"), ["sample_rate", "a number"]),
    (lambda file: file.__delitem__("time"), ["time", "a dataset", "none"]),
    (lambda file: file.__delitem__("joint/torque"), ["joint/torque", "a dataset", "none"]),
    (without("unit", "joint/torque"), ["joint/torque", "'unit'"]),
    (attribute("unit", "deg", "joint/position"), ["joint/position", "unit", "deg"]),
    (attribute("unit", "mNm", "joint/torque"), ["joint/torque", "'N·m'", "'mNm'"]),
    (attribute("unit", "ms", "time"), ["time", "'s'", "'ms'"]),
    (attribute("unit", "rad/s", "reference/acceleration"), ["reference/acceleration", "'rad/s^2'"]),
    (values("time", put(7, 0.0)), ["time", "strictly increasing", "sample 7"]),
    (values("time", put(7, np.nan)), ["time", "finite", "sample 7"]),
    (values("time", lambda array: array[:1]), ["time", "N >= 2"]),
    (
        values("joint/position", put((slice(5, 15), 1), np.nan)),
        ["joint/position", "finite", "nan at sample 5, joint b"],
    ),
    (values("joint/torque", put((0, 2), np.inf)), ["joint/torque", "inf at sample 0, joint c"]),
    (values("joint/torque", lambda array: array[:-1]), ["joint/torque", "(40, 3)", "(39, 3)"]),
    (values("joint/velocity", lambda array: array[:, 0]), ["joint/velocity", "(40, 3)", "(40,)"]),
    (values("joint/position", lambda array: array.astype("S8")), ["joint/position", "real numbers"]),
    (values("joint/position", lambda array: array.astype("S8").tolist()), ["joint/position", "got text"]),
    (values("time", lambda array: h5py.Empty("f8")), ["time", "real numbers", "empty dataset"]),
    (values("controller/kp", lambda array: array[:2]), ["controller/kp", "(3,)", "(2,)"]),
    (lambda file: file.__delitem__("controller/kd"), ["controller/kd", "a dataset"]),
    (
        attribute("kind", "pid", "controller"),
        ["controller kind", "'pid'", "valid: pd, pd_with_model_feedforward, position_servo, unknown"],
    ),
    (without("rate", "controller"), ["controller rate"]),
    (attribute("rate", -1.0, "controller"), ["controller rate", "positive"]),
    (without("coulomb_smoothing", "controller"), ["coulomb_smoothing"]),
]


@pytest.mark.parametrize(("damage", "says"), BROKEN)
def test_a_broken_rule_is_named(tmp_path: Path, damage: Callable[[h5py.File], None], says: list[str]) -> None:
    path = tmp_path / "broken.h5"
    write_log(recording(), path)
    with h5py.File(path, "a") as file:
        damage(file)
    with pytest.raises(InputError) as error:
        read_log(path)
    line = str(error.value)
    assert line.startswith(str(path))
    assert "\n" not in line
    assert [part for part in says if part not in line] == []


ODD = [
    (attribute("provenance", "recorded by hand"), {}),
    (attribute("provenance", "[1, 2]"), {}),
    (attribute("provenance", 7), {}),
    (attribute("provenance", '{"cell": 4}'), {"cell": 4}),
]


@pytest.mark.parametrize(("change", "provenance"), ODD)
def test_provenance_may_be_anything(
    tmp_path: Path, change: Callable[[h5py.File], None], provenance: dict[str, int]
) -> None:
    write_log(recording(), tmp_path / "run.h5")
    with h5py.File(tmp_path / "run.h5", "a") as file:
        change(file)
    assert read_log(tmp_path / "run.h5").provenance == provenance


def test_attributes_of_one_element_are_that_element(tmp_path: Path) -> None:
    write_log(recording(), tmp_path / "run.h5")
    with h5py.File(tmp_path / "run.h5", "a") as file:
        for holder in (file, file["controller"]):
            for name in set(holder.attrs) - {"joint_names"}:
                holder.attrs[name] = [holder.attrs[name]]
    assert equal(read_log(tmp_path / "run.h5", with_truth=True), recording())


@pytest.mark.parametrize(
    "change",
    [lambda file: file.__delitem__("joint/torque"), values("joint/torque", put(slice(None), np.nan))],
)
def test_torque_that_is_not_asked_for_may_be_missing(
    tmp_path: Path, change: Callable[[h5py.File], None]
) -> None:
    write_log(recording(), tmp_path / "run.h5")
    with h5py.File(tmp_path / "run.h5", "a") as file:
        change(file)
    got = read_log(tmp_path / "run.h5", with_truth=True, with_torque=False)
    assert equal(got, replace(recording(), torque=np.zeros((SAMPLES, JOINTS))))
    with pytest.raises(InputError, match="joint/torque"):
        read_log(tmp_path / "run.h5")


def test_a_file_that_is_no_log_is_named(tmp_path: Path) -> None:
    (tmp_path / "text.h5").write_text("time,q\n")
    (tmp_path / "folder").mkdir()
    (tmp_path / "null").symlink_to("/dev/null")
    for name, says in (
        ("text.h5", "an HDF5 file"),
        ("none.h5", "no such file"),
        ("folder", "got a folder"),
        ("null", "no regular file"),
    ):
        with pytest.raises(InputError, match=says):
            read_log(tmp_path / name)


def test_a_recording_that_could_not_be_read_is_not_written(tmp_path: Path) -> None:
    bad = replace(recording(), torque=np.full((SAMPLES, JOINTS), np.nan))
    with pytest.raises(InputError, match="nan at sample 0, joint a"):
        write_log(bad, tmp_path / "run.h5")
    with pytest.raises(InputError, match="existing folder"):
        write_log(recording(), tmp_path / "nowhere" / "run.h5")
    assert list(tmp_path.iterdir()) == []


def test_joints_must_be_those_of_the_model() -> None:
    check_joints(recording(), ["a", "b", "c"])
    with pytest.raises(
        InputError, match=r"run\.h5: joint_names: expected the model's joints \['a', 'c', 'b'\]"
    ):
        check_joints(recording(), ["a", "c", "b"], "run.h5")


@pytest.mark.skipif(not REAL_LOGS, reason="no recordings of real robots beside the checkout")
@pytest.mark.parametrize("path", REAL_LOGS, ids=lambda path: f"{path.parent.name}/{path.name}")
def test_recordings_of_real_robots_obey_the_format(path: Path, tmp_path: Path) -> None:
    original = read_log(path)
    assert original.source == "hardware"
    write_log(original, tmp_path / "copy.h5")
    assert equal(replace(read_log(tmp_path / "copy.h5"), provenance=original.provenance), original)
