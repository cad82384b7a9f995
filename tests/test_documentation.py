"""The documentation says what the code does: fields, keys, commands, links and examples."""

import re
from pathlib import Path
from typing import get_args

import numpy as np
import pytest
from pydantic import BaseModel, ValidationError
from pydantic_core import PydanticUndefined

from diagnosis.decision import probability
from diagnosis.plausibility.materiality import SMALLEST_GAIN
from testbench.cli import app
from testbench.estimate_file import estimate_document
from testbench.excitation_file import UNITS
from testbench.log import CHANNELS, check_joints, read_log
from testbench.robot import load_robot
from testbench.scenario import Scenario, load_scenario

from .small_arm import ARM
from .synthetic import synthetic_result, synthetic_robot

ROOT = Path(__file__).parents[1]
PAGES = sorted(
    [ROOT / "README.md", ROOT / "CHANGELOG.md", ROOT / "CONTRIBUTING.md", *(ROOT / "docs").glob("*.md")]
)
TOP_LEVEL = ("name", "model", "joints", "fix_base", "packages", "seed")
SECTIONS = [name for name in Scenario.model_fields if name not in TOP_LEVEL]


def tables(text: str) -> list[list[list[str]]]:
    """Every table, its heads and then its rows, cells stripped of their blanks."""
    found = re.findall(r"(?:^\|.+\|\n)+", text + "\n", re.MULTILINE)
    lines = [[line.strip("|").split("|") for line in each.splitlines()] for each in found]
    return [[[cell.strip() for cell in row] for row in (each[0], *each[2:])] for each in lines]


def table(page: str, heading: str) -> list[list[str]]:
    """Rows of the first table below a heading."""
    text = (ROOT / "docs" / page).read_text().split(f"\n## {heading}\n")[1]
    return tables(text)[0][1:]


def blocks(page: Path, language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", page.read_text(), re.MULTILINE | re.DOTALL)


def documented(value: object) -> str:
    """A default as the tables write it."""
    if value is PydanticUndefined:
        return "required"
    if value is None or value in ({}, ()):
        return "none"
    if isinstance(value, tuple):
        return ", ".join(value)
    return f"{value:.10g}" if isinstance(value, float) else str(value)


def section_model(name: str) -> type[BaseModel]:
    annotation = Scenario.model_fields[name].annotation
    # A list of sections is a tuple[section, ...].
    model = get_args(annotation)[0] if get_args(annotation) else annotation
    assert isinstance(model, type)
    assert issubclass(model, BaseModel)
    return model


@pytest.mark.parametrize("section", SECTIONS)
def test_every_field_of_the_scenario_is_documented_with_its_default(section: str) -> None:
    fields = section_model(section).model_fields
    rows = {row[0].strip("`"): row for row in table("scenario.md", section)}
    assert list(rows) == list(fields)
    assert {name: row[2] for name, row in rows.items()} == {
        name: documented(field.default) for name, field in fields.items()
    }


@pytest.mark.parametrize("section", SECTIONS)
def test_documented_units_are_those_that_the_scenario_takes(section: str) -> None:
    model = section_model(section)
    for row in table("scenario.md", section):
        name, unit, default = row[0].strip("`"), row[1], row[2]
        if unit == "-":
            continue
        value = f"{default} {unit}"
        assert getattr(model.model_validate({name: value}), name) == float(default)
        with pytest.raises(ValidationError, match="a number in"):
            model.model_validate({name: f"{default} furlong"})


def test_the_top_level_of_the_scenario_is_documented() -> None:
    names = [row[0].strip("`") for row in table("scenario.md", "Top level")]
    assert sorted([*names, *SECTIONS]) == sorted([*Scenario.model_fields, "variants"])


def test_the_example_scenario_is_one(tmp_path: Path) -> None:
    (tmp_path / "example.yaml").write_text(blocks(ROOT / "docs" / "scenario.md", "yaml")[0])
    _, variants = load_scenario(tmp_path / "example.yaml")
    assert list(variants) == ["loud"]


# Studies and loops have a form of their own, and tests of their own.
OTHERS = ("blind_", "loop_", "study_")
SCENARIOS = sorted(p for p in (ROOT / "scenarios").glob("*.yaml") if not p.name.startswith(OTHERS))


@pytest.mark.parametrize("path", SCENARIOS, ids=lambda path: path.stem)
def test_every_scenario_loads_and_bears_its_files_name(path: Path) -> None:
    scenario, _ = load_scenario(path)
    assert scenario.name == path.stem
    assert scenario.model.is_file()


def test_every_channel_of_the_log_is_documented_with_its_unit() -> None:
    rows = {row[0].strip("`"): row[2] for row in table("formats.md", "robot-log (HDF5): one recorded run")}
    assert {name: rows[name] for name, _, _, _ in CHANNELS} == {name: hinge for name, _, hinge, _ in CHANNELS}


def test_every_key_of_the_estimate_is_documented(tmp_path: Path) -> None:
    document = estimate_document(synthetic_result(synthetic_robot(tmp_path)))
    names = re.findall(
        r"`(\w+)`", " ".join(row[0] for row in table("formats.md", "estimate.json: an identification"))
    )
    assert sorted(names) == sorted(document)
    text = (ROOT / "docs" / "formats.md").read_text()
    assert [key for key in document["base_parameters"][0] if f"`{key}`" not in text] == []


def test_every_key_of_the_excitation_is_documented() -> None:
    source = (ROOT / "testbench" / "excitation_file.py").read_text()
    body = source.split("return {", 1)[1].split("\n    }", 1)[0]
    keys = re.findall(r'^ {8}"(\w+)":', body, re.MULTILINE)
    rows = table("formats.md", "excitation.json: a designed motion")
    assert sorted(re.findall(r"`(\w+)`", " ".join(row[0] for row in rows))) == sorted(keys)
    assert len(keys) >= len(UNITS)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_and_pictures_lead_somewhere(page: Path) -> None:
    targets = re.findall(r"\]\(([^)#]+)(?:#[^)]*)?\)", page.read_text())
    local = [target for target in targets if not target.startswith("http")]
    assert [target for target in local if not (page.parent / target).exists()] == []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_commands_that_are_shown_exist_with_these_options(page: Path) -> None:
    shown = "\n".join(blocks(page, "(?:sh)?")).replace("\\\n", " ")
    for command in re.findall(r"^(?:\.venv/bin/)?testbench (.+)$", shown, re.MULTILINE):
        app.parse_args(command.split(), exit_on_error=False, print_error=False)


def test_the_csv_example_makes_a_log_of_the_format(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (code,) = [text for text in blocks(ROOT / "docs" / "own-robot.md", "python") if "run_1.csv" in text]
    time = np.arange(50) / 100
    columns = np.column_stack([time, *(np.sin((k + 1) * time) for k in range(12))])
    monkeypatch.chdir(tmp_path)
    np.savetxt("run_1.csv", columns, delimiter=",", header="t," + ",".join("abcdefghijkl"), comments="")
    exec(compile(code, "own-robot.md", "exec"), {})
    log = read_log("run_1.h5")
    check_joints(log, [f"joint_{k}" for k in range(1, 7)])
    np.testing.assert_array_equal(log.torque, columns[:, 7:])


def test_the_limits_example_is_read_as_limits(tmp_path: Path) -> None:
    (xml,) = blocks(ROOT / "docs" / "own-robot.md", "xml")
    names = re.findall(r'numeric name="(\w+)"', xml)
    (tmp_path / "arm.xml").write_text(ARM)
    limits = load_robot(tmp_path / "arm.xml").limits
    assert names == ["velocity_limit", "acceleration_limit"]
    assert "actuatorfrcrange" in xml
    assert np.isfinite([limits.velocity, limits.acceleration, limits.torque]).all()


def test_the_architecture_page_names_every_module() -> None:
    text = (ROOT / "docs" / "architecture.md").read_text()
    rooms = [ROOT / room for room in ("identification", "testbench", "diagnosis", "studies")]
    for room in (*rooms, *(path for path in (ROOT / "diagnosis").iterdir() if path.is_dir())):
        for path in room.iterdir():
            is_room = path.is_dir() and (path / "__init__.py").is_file()
            if is_room or (path.suffix == ".py" and path.stem != "__init__"):
                assert f"`{path.name}{'/' if is_room else ''}`" in text, path


def test_the_page_of_decisions_names_files_that_exist() -> None:
    named = re.findall(r"`([\w/]+\.py)`", (ROOT / "docs" / "decisions.md").read_text())
    files = [(ROOT / "diagnosis" / name, ROOT / name) for name in named]
    assert files
    assert [inside for inside, whole in files if not (inside.is_file() or whole.is_file())] == []


def test_a_room_of_the_diagnosis_imports_only_rooms_above_it() -> None:
    text = (ROOT / "docs" / "architecture.md").read_text()
    text = text[text.index("\n### diagnosis\n") : text.index("\n### studies\n")]
    rooms = re.findall(r"^\| `(\w+)/` \|", text, re.MULTILINE)
    assert sorted(rooms) == sorted(path.parent.name for path in (ROOT / "diagnosis").glob("*/__init__.py"))
    for rank, room in enumerate(rooms):
        for path in (ROOT / "diagnosis" / room).glob("*.py"):
            imported = re.findall(r"^\s*from (?:\.\.|diagnosis\.)(\w+)", path.read_text(), re.MULTILINE)
            assert set(imported) <= set(rooms[: rank + 1]), path


def test_the_page_of_decisions_states_the_numbers_of_the_code() -> None:
    text = (ROOT / "docs" / "decisions.md").read_text()
    (rows,) = [rows for head, *rows in tables(text) if head == ["number", "value", "what it is"]]
    assert len(rows) == 8
    assert {name: float(value) for name, value, _ in rows} == {
        name: getattr(probability, name) for name, *_ in rows
    }
    assert f"p = {probability.STATED:.0%} on".replace("%", " %") in text
    assert f"(log-likelihood {SMALLEST_GAIN:.10g}, and one more for each coefficient" in text
