"""What cannot be written is reported before any work, and what is read is not replaced."""

from pathlib import Path

import pytest

from identification.errors import InputError
from testbench.files import replacing, require_writable

from .one_line import complaint
from .small_arm import ARM


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder to stand in, with a model and files that are not read so far."""
    (tmp_path / "arm.xml").write_text(ARM)
    for name in ("run.h5", "T.json"):
        (tmp_path / name).write_text("not read")
    (tmp_path / "folder").mkdir()
    monkeypatch.chdir(tmp_path)
    return tmp_path


BELOW_A_FILE = [
    "diagnose --model arm.xml run.h5 --out T.json",
    "identify --model arm.xml run.h5 --out T.json",
    "compare criteria --out T.json",
    "predict run.h5 --diagnosis d --out T.json/p.h5",
    "effects write --model arm.xml --effect payload --out T.json/x.xml",
    "effects page --model arm.xml --joint 1 --out T.json/x.md",
    "excite --model arm.xml --out T.json/x.json",
    "simulate --model arm.xml --trajectory T.json --out T.json/x.h5",
    "blind score cases --diagnoses d --out T.json",
]
A_FOLDER = [
    "predict run.h5 --diagnosis d --out folder",
    "effects write --model arm.xml --effect payload --out folder",
    "excite --model arm.xml --out folder",
    "simulate --model arm.xml --trajectory T.json --out folder",
]
READ = [
    "predict run.h5 --diagnosis d --out run.h5",
    "predict run.h5 --diagnosis d --out folder/../run.h5",
    "effects write --model arm.xml --effect payload --out arm.xml",
    "excite --model arm.xml --out arm.xml",
    "simulate --model arm.xml --trajectory T.json --out T.json",
    "identify --model arm.xml run.h5 --out d --write-model arm.xml",
]


@pytest.mark.parametrize("arguments", BELOW_A_FILE)
def test_a_path_below_a_file_is_refused(
    place: Path, arguments: str, capfd: pytest.CaptureFixture[str]
) -> None:
    line = complaint(arguments, capfd)
    assert f": out: expected a path below a folder, got the file {place / 'T.json'}\n" in line


@pytest.mark.parametrize("arguments", A_FOLDER)
def test_a_folder_in_place_of_a_file_is_refused(
    place: Path, arguments: str, capfd: pytest.CaptureFixture[str]
) -> None:
    assert complaint(arguments, capfd) == "folder: out: expected a file to write, got a folder\n"


@pytest.mark.parametrize("arguments", READ)
def test_what_is_read_is_not_replaced(place: Path, arguments: str, capfd: pytest.CaptureFixture[str]) -> None:
    line = complaint(arguments, capfd)
    assert ": out: expected another file than those that are read, got " in line


def test_a_folder_that_takes_no_files_is_found_by_trying(
    place: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(dir: Path) -> None:
        raise PermissionError(13, "Permission denied")

    require_writable(place / "new" / "x.json")
    assert not (place / "new").exists()
    monkeypatch.setattr("tempfile.TemporaryFile", refused)
    with pytest.raises(InputError, match=r"x\.json: out: expected a folder that may be .* Permission denied"):
        require_writable(place / "x.json")


def test_what_the_system_will_not_write_is_one_line(place: Path) -> None:
    def fill_the_disk() -> None:
        with replacing("run.h5") as temporary:
            temporary.write_text("half")
            raise OSError(28, "No space left on device")

    with pytest.raises(InputError, match=r"run\.h5: out: .* No space left"):
        fill_the_disk()
    assert (place / "run.h5").read_text() == "not read"
    assert sorted(path.name for path in place.iterdir()) == ["T.json", "arm.xml", "folder", "run.h5"]
