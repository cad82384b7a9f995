"""The examples run, and show what they say."""

import runpy
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

EXAMPLES = Path(__file__).parents[1] / "examples"


def main_of(name: str) -> Callable[..., Any]:
    return runpy.run_path(str(EXAMPLES / f"{name}.py"))["main"]


def test_a_csv_becomes_a_report(tmp_path: Path) -> None:
    found = main_of("csv_to_report")(tmp_path)
    assert found.validations[0].relative.max() < 0.05
    assert (tmp_path / "report" / "report.html").is_file()
    assert (tmp_path / "identified.xml").is_file()


def test_an_arm_like_a_ur_is_excited_within_its_limits(tmp_path: Path) -> None:
    motion = main_of("excite_an_arm")(tmp_path, starts=1, iterations=5)
    assert motion.excitation.margins.kept
    points = np.loadtxt(tmp_path / "set_points.csv", delimiter=",")
    assert points.shape == (1250, 7)
    assert np.all(np.abs(np.diff(points[:, 1:], axis=0)) * 125 <= motion.robot.limits.velocity)


def test_every_effect_of_the_example_adds_torque(tmp_path: Path) -> None:
    added = main_of("effects_and_signatures")(tmp_path)
    assert min(added.values()) > 0.1
    assert sorted(path.stem for path in tmp_path.glob("*.html")) == sorted(added)


def test_the_diagnosis_of_the_example_finds_the_ripple(tmp_path: Path) -> None:
    why = main_of("read_a_diagnosis")(tmp_path)
    assert [(each.effect, each.joint) for each in why.effects] == [("transmission_ripple", 1)]
    assert (tmp_path / "corrected.xml").is_file()


def test_examples_use_the_public_functions_alone() -> None:
    for path in EXAMPLES.glob("*.py"):
        imported = [line for line in path.read_text().splitlines() if line.startswith(("import ", "from "))]
        ours = [line for line in imported if "testbench" in line or "identification" in line]
        assert ours == ["import testbench"], path
