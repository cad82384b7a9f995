"""The folder of results: what is there and not ours stays, and nobody else writes to it meanwhile."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from identification.errors import InputError
from testbench.containment.folder import results_folder
from testbench.files import replacing, require_writable, write_json

WRITTEN = ("estimate.json", "report.html", "session.rrd", "corrected.xml")
HOLDS = """
import sys, time
from pathlib import Path
from testbench.containment.folder import results_folder
with results_folder(Path(sys.argv[1]), ()):
    print("held", flush=True)
    time.sleep(60)
"""


@pytest.mark.parametrize("name", WRITTEN)
@pytest.mark.parametrize("content", [b"mine", b'{"mine": 1}', b"<html>mine</html>", b""])
def test_a_file_of_another_making_is_never_replaced(tmp_path: Path, name: str, content: bytes) -> None:
    (tmp_path / name).write_bytes(content)
    with (
        pytest.raises(InputError, match=f"one with a {name} of another making"),
        results_folder(tmp_path, WRITTEN),
    ):
        raise AssertionError
    assert (tmp_path / name).read_bytes() == content


def test_a_link_in_the_folder_is_never_replaced(tmp_path: Path) -> None:
    (tmp_path / "other.json").write_text('{"format": "identification-estimate"}')
    (tmp_path / "estimate.json").symlink_to(tmp_path / "other.json")
    with pytest.raises(InputError, match="of another making"), results_folder(tmp_path, WRITTEN):
        raise AssertionError


def test_results_are_replaced_and_a_line_says_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for _ in range(2):
        with results_folder(tmp_path / "new", WRITTEN):
            write_json({"format": "identification-estimate"}, tmp_path / "new" / "estimate.json")
    line = f"{tmp_path / 'new'}: results that were there were replaced (estimate.json)\n"
    assert capsys.readouterr().err == line


def test_where_nothing_is_written_nothing_stays(tmp_path: Path) -> None:
    with pytest.raises(InputError), results_folder(tmp_path / "a" / "b", WRITTEN):
        raise InputError("log", "time", "more", "less")
    assert list(tmp_path.iterdir()) == []


def test_of_a_command_that_resumes_only_what_became_other_is_replaced(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "cases").mkdir()
    (tmp_path / "table.csv").write_text("one")
    for content, says in (
        ("one", ""),
        ("two", f"{tmp_path}: results that were there were replaced (table.csv)\n"),
    ):
        with results_folder(tmp_path, ("cases", "table.csv"), resumes=True):
            (tmp_path / "cases" / "case_1").touch()
            (tmp_path / "table.csv").write_text(content)
        assert capsys.readouterr().err == says


@pytest.mark.skipif(sys.platform == "win32", reason="locks of folders are the system's")
def test_a_second_process_says_that_another_writes_there(tmp_path: Path) -> None:
    with subprocess.Popen([sys.executable, "-c", HOLDS, str(tmp_path)], stdout=subprocess.PIPE) as other:
        assert other.stdout is not None
        assert other.stdout.readline() == b"held\n"
        with pytest.raises(InputError, match="another testbench writes to now"), results_folder(tmp_path, ()):
            raise AssertionError
        other.kill()
    with results_folder(tmp_path, ()):
        pass


def special(folder: Path, kind: str) -> Path:
    path = folder / "out"
    if kind == "pipe":
        os.mkfifo(path)
    elif kind == "link":
        (folder / "target").write_text("target")
        path.symlink_to(folder / "target")
    elif kind == "broken link":
        path.symlink_to(folder / "none")
    return Path("/dev/null") if kind == "device" else path


@pytest.mark.skipif(sys.platform == "win32", reason="pipes and devices are the system's")
@pytest.mark.parametrize("kind", ["pipe", "device", "link", "broken link"])
def test_what_is_no_plain_file_stays_what_it_is(tmp_path: Path, kind: str) -> None:
    path = special(tmp_path, kind)
    before = path.lstat().st_mode
    with pytest.raises(InputError, match="out: expected a file to write, got a"):
        require_writable(path)
    with pytest.raises(InputError, match="out: expected a file to write, got a"), replacing(path):
        raise AssertionError
    with pytest.raises(InputError, match="out: expected a"), results_folder(path, WRITTEN):
        raise AssertionError
    assert path.lstat().st_mode == before
