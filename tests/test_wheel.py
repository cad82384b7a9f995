"""The wheel in an empty folder: models, scenarios and types are in it."""

import os
import shutil
import subprocess
import sys
from pathlib import Path
from zipfile import ZipFile

import pytest

from testbench.shipped import shipped

ROOT = Path(__file__).parents[1]
PACKAGES = ("diagnosis", "identification", "recordings", "studies", "testbench")


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the wheel's content, made from a copy of the sources."""
    source, folder = tmp_path_factory.mktemp("source"), tmp_path_factory.mktemp("installed")
    for name in (*PACKAGES, "models", "scenarios"):
        shutil.copytree(
            ROOT / name, source / name, symlinks=True, ignore=shutil.ignore_patterns("__pycache__")
        )
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, source)
    build = f"from setuptools.build_meta import build_wheel; build_wheel({str(folder)!r})"
    subprocess.run([sys.executable, "-c", build], cwd=source, check=True, capture_output=True)
    (wheel,) = folder.glob("*.whl")
    with ZipFile(wheel) as file:
        file.extractall(folder)
    return folder


def outside(installed: Path, folder: Path, *arguments: str) -> str:
    """What the installed program prints, started in a folder."""
    environment = os.environ | {"PYTHONPATH": str(installed)}
    command = [sys.executable, "-P", *arguments]
    done = subprocess.run(command, cwd=folder, env=environment, check=True, capture_output=True, text=True)
    return done.stdout


def test_shipped_models_and_scenarios_are_found_from_an_empty_folder(installed: Path, tmp_path: Path) -> None:
    program = (
        "import testbench; from testbench.scenario import load_scenario\n"
        "robot = testbench.load_robot('models/rail_arm.xml')\n"
        "scenario, _ = load_scenario('scenarios/tx90.yaml')\n"
        "print(testbench.__file__, robot.joints, scenario.model.is_file())"
    )
    inside = installed / "testbench" / "__init__.py"
    assert outside(installed, tmp_path, "-c", program).split() == [str(inside), "8", "True"]


def test_shipped_files_can_be_copied_out(installed: Path, tmp_path: Path) -> None:
    outside(installed, tmp_path, "-m", "testbench", "scenarios")
    for name in ("models", "scenarios"):
        copied = {path.name: path.read_bytes() for path in (tmp_path / name).iterdir()}
        assert copied == {path.name: path.read_bytes() for path in (ROOT / name).iterdir()}


def test_every_package_says_that_it_is_typed(installed: Path) -> None:
    assert [name for name in PACKAGES if not (installed / name / "py.typed").is_file()] == []


def test_every_page_has_its_template_in_the_wheel(installed: Path) -> None:
    pages = [path.relative_to(ROOT) for name in PACKAGES for path in (ROOT / name).rglob("templates/*.html")]
    assert pages
    assert [page for page in pages if not (installed / page).is_file()] == []


def test_a_file_of_the_users_own_comes_before_one_shipped(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert shipped("models/tx90.xml").is_file()
    assert shipped("models/none.xml") == Path("models/none.xml")
    (tmp_path / "models").mkdir()
    (tmp_path / "models" / "tx90.xml").write_text("mine")
    assert shipped("models/tx90.xml") == Path("models/tx90.xml")
