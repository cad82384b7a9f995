"""Blind cases: drawn and made by seed, nothing gives the answer away, seals hold."""

import csv
import json
import re
import shutil
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest

from identification.errors import InputError
from identification.parameters import ARMATURE, COULOMB, INERTIAL, PER_JOINT, VISCOUS
from studies.blind.case import LITTLE, make_case, places
from studies.blind.draw import drawn_case, kinds_of
from studies.blind.jobs import make, same_scenario, score
from studies.blind.outside import OUTSIDE, outside_values
from studies.blind.scenario import load_blind_scenario
from studies.blind.seal import opened, seal
from studies.blind.study import Study, work
from testbench.effects import effects
from testbench.effects.base import Injection
from testbench.files import read_json, write_json
from testbench.log import read_log
from testbench.lost_samples import lost_samples
from testbench.robot import load_robot
from testbench.simulation import Reference, SimulationOptions, simulate

from ..small_arm import ARM
from .blind_documents import diagnosis

SCENARIO = """
name: blind_test
seed: 5
cases: {single: 2, pair: 1, triple: 0, none: 1, unknown: 1}
robots: [{model: arm.xml}]
runs: {fewest: 2, most: 2, shortest: 7 s, longest: 7 s, sample_rates: [500], physics_timestep: 0.001}
"""
NAMES = [f"case_{number:04d}" for number in range(1, 6)]


def written(folder: Path, text: str = SCENARIO) -> Path:
    (folder / "arm.xml").write_text(ARM)
    (folder / "scenario.yaml").write_text(text)
    return folder / "scenario.yaml"


@pytest.fixture(scope="module")
def scenario(tmp_path_factory):
    return load_blind_scenario(written(tmp_path_factory.mktemp("scenario")))


@pytest.fixture(scope="module")
def sealed(scenario, tmp_path_factory):
    out = tmp_path_factory.mktemp("sealed")
    for index in range(len(NAMES)):
        make_case(scenario, index, out)
    seal(out, NAMES)
    return out


def structure(path: Path) -> tuple[list[str], dict[str, object]]:
    """Names in a log, and its attributes but the sample rate and the joints."""
    names: list[str] = []
    with h5py.File(path) as file:
        file.visit(names.append)
        attributes = {key: str(value) for key, value in file.attrs.items()}
    return sorted(names), attributes


def test_one_seed_draws_one_study(scenario) -> None:
    streams = [np.random.SeedSequence(1) for _ in range(2)]
    assert drawn_case(scenario, 2, streams[0]) == drawn_case(scenario, 2, streams[1])
    other = scenario.model_copy(update={"seed": 6})
    assert sorted(kinds_of(scenario)) == sorted(kinds_of(other))
    assert drawn_case(scenario, 2, np.random.SeedSequence(2)) != drawn_case(scenario, 2, streams[0])


def test_the_kind_of_a_case_decides_nothing_but_its_effects(scenario) -> None:
    def only(kind: str):
        counts = {name: 3 if name == kind else 0 for name in type(scenario.cases).model_fields}
        changed = scenario.model_copy(update={"cases": scenario.cases.model_copy(update=counts)})
        draw = drawn_case(changed, 1, np.random.SeedSequence(4))
        return replace(draw, kind="", effects=())

    assert only("single") == only("none") == only("unknown") == only("pair")


def test_the_same_case_is_made_bit_for_bit(scenario, sealed, tmp_path) -> None:
    again = make_case(scenario, 0, tmp_path)
    assert again == opened(sealed)[0]
    for path in places(sealed, NAMES[0]).given.iterdir():
        assert (places(tmp_path, NAMES[0]).given / path.name).read_bytes() == path.read_bytes()


def test_no_case_tells_its_answer(sealed) -> None:
    answers = opened(sealed)
    assert sorted(each["kind"] for each in answers) == ["none", "pair", "single", "single", "unknown"]
    revealing = "|".join([*effects(), *OUTSIDE, "truth", "effect", "background", "seed"]).encode()
    shared = []
    for each in answers:
        place = places(sealed, each["case"])
        assert sorted(path.name for path in place.given.iterdir()) == ["nominal.xml", "run_1.h5", "run_2.h5"]
        assert not re.search(
            b"|".join([*(name.encode() for name in (*effects(), *OUTSIDE))]), place.nominal.read_bytes()
        )
        channels = each["settings"]["channels"]
        for log in place.logs:
            names, attributes = structure(log)
            assert not re.search(revealing, log.read_bytes())
            expected = {"controller", "joint", "joint/position", "joint/torque", "time"}
            expected |= {f"joint/{name}" for name in channels if name != "reference"}
            if "reference" in channels:
                motion = ("position", "velocity", "acceleration")
                expected |= {"reference", "controller/kp", "controller/kd"}
                expected |= {f"reference/{name}" for name in motion}
            assert set(names) == expected
            shared.append(attributes)
    assert all(attributes == shared[0] for attributes in shared)
    sizes = {(places(sealed, each["case"]).nominal.read_text().count("\n")) for each in answers}
    assert len(sizes) == 1


def test_models_of_links_alone_and_held_samples_are_drawn_where_asked_for(scenario, tmp_path) -> None:
    plain = make_case(scenario, 0, tmp_path / "plain")
    asked = scenario.model_copy(
        update={
            "nominal": scenario.nominal.model_copy(update={"links_alone": 1.0}),
            "runs": scenario.runs.model_copy(update={"held": 1.0}),
        }
    )
    bare = make_case(asked, 0, tmp_path / "bare")
    assert bare["effects"] == plain["effects"]
    name = NAMES[0]
    of_plain, of_bare = (places(tmp_path / folder, name) for folder in ("plain", "bare"))
    friction = [load_robot(each.nominal).parameters.reshape(-1, PER_JOINT) for each in (of_plain, of_bare)]
    columns = [ARMATURE, VISCOUS, COULOMB]
    assert np.all(friction[0][:, columns] > 0)
    assert np.all(friction[1][:, columns] == 0)
    assert np.allclose(friction[0][:, :INERTIAL], friction[1][:, :INERTIAL], rtol=1e-9, atol=1e-12)
    first, second = (read_log(each.given / "run_1.h5") for each in (of_plain, of_bare))
    late = lost_samples(second)
    assert 0.001 < late.mean() < 0.006
    assert np.array_equal(first.position[~late], second.position[~late])
    assert second.controller is not None
    assert second.controller.kind == "unknown"
    assert not lost_samples(read_log(of_bare.hidden)).any()


def test_what_acts_moves_torque_and_health_moves_none(scenario, sealed) -> None:
    for each in opened(sealed):
        assert all(effect["moved"] >= scenario.least_moved for effect in each["effects"])
        assert (np.max(each["effect_rms"]) > 0) == bool(each["effects"])
        assert np.all(np.array(each["floor"]) < 0.2 * np.array(each["torque_rms"]))


@pytest.mark.parametrize("name", OUTSIDE)
def test_every_effect_outside_the_catalogue_acts_and_stays_outside(name, scenario) -> None:
    robot = load_robot(scenario.robots[0].model)
    time = np.arange(1500)[:, None] / 500
    rates = 2 * np.pi * np.array([0.5, 0.7])
    reference = Reference(
        0.8 * np.sin(rates * time), 0.8 * rates * np.cos(rates * time), -0.8 * rates**2 * np.sin(rates * time)
    )
    values = outside_values(name, 3.0, 1, [reference], np.random.default_rng(0))
    if "start" in values:
        values["start"] = 1.0
    options = SimulationOptions(physics_timestep=1e-3)
    options = replace(options, controller=replace(options.controller, rate=500.0))
    ill = replace(options, effects=(Injection(name, 1, values),))
    a, b = simulate(robot, [reference, reference], [options, ill], beside=OUTSIDE)
    change = np.sqrt(np.mean((a.torque - b.torque) ** 2, axis=0))
    assert change[1] > 0.2
    assert name not in effects()


def test_a_seal_that_is_broken_is_refused(sealed, tmp_path) -> None:
    manifest = read_json(sealed / "manifest.json")
    assert manifest["cases"] == NAMES
    path = sealed / "sealed" / "answers.json"
    kept = path.read_text()
    try:
        path.write_text(kept.replace('"kind": "none"', '"kind": "unknown"'))
        with pytest.raises(InputError, match="answers.json: sha256: expected"):
            score(sealed, tmp_path, tmp_path / "out")
    finally:
        path.write_text(kept)
    with pytest.raises(InputError, match="case_0001.diagnosis.json: file: expected"):
        score(sealed, tmp_path, tmp_path / "out")


def test_scores_of_given_diagnoses_are_written(sealed, tmp_path) -> None:
    for each in opened(sealed):
        named = [(e["effect"], e["joint"], 0.9, (), 1.0) for e in each["effects"] if each["kind"] == "single"]
        document = diagnosis(*named, verdict="unknown" if each["kind"] == "unknown" else None)
        document["where"] = [{"joint": each["effects"][0]["joint"]}] if each["effects"] else []
        write_json(document, tmp_path / each["case"] / "diagnosis.json")
    lines = score(sealed, tmp_path, tmp_path / "out")
    found = json.loads((tmp_path / "out" / "score.json").read_text())
    figures = found["figures"]
    assert figures["singles, first effect and joint right"]["all"]["value"] == 1.0
    assert figures["pairs, both effects found"]["all"]["value"] == 0.0
    assert figures["unknown, reported as unknown"]["all"]["value"] == 1.0
    assert figures["healthy, false alarm"]["all"]["value"] == 0.0
    assert len(lines) == len(found["verdict"])
    with (tmp_path / "out" / "cases.csv").open() as file:
        assert [row["case"] for row in csv.DictReader(file)] == NAMES
    assert "Withheld effects" in (tmp_path / "out" / "report.html").read_text()


def test_a_case_tells_what_was_drawn_for_it_and_rejected(scenario, tmp_path) -> None:
    index = kinds_of(scenario).index("single")
    first = make_case(scenario, index, tmp_path)
    stricter = scenario.model_copy(update={"least_moved": 1.01 * first["effects"][0]["moved"]})
    second = make_case(stricter, index, tmp_path / "again")
    assert second["attempt"] == 1 + max(each["attempt"] for each in second["rejected"])
    assert second["rejected"][0]["effect"] == first["effects"][0]["effect"]
    assert second["rejected"][0]["why"] == LITTLE


def test_a_case_is_studied_from_its_logs_and_only_its_result_stays(scenario, tmp_path) -> None:
    index = kinds_of(scenario).index("single")
    plan = Study(scenario, tmp_path, keep_logs=False, without="same")
    work(plan, index)
    result = read_json(plan.result(NAMES[index]))
    own = result["answer"]["effects"][0]["effect"]
    assert all(each["effect"] != own for each in result["diagnosis"]["effects"])
    assert len(result["hidden"]["effects"]) == 2
    assert [path for path in tmp_path.rglob("*") if path.is_file()] == [plan.result(NAMES[index])]


@pytest.mark.parametrize(
    ("old", "new", "match"),
    [
        ("single: 2", "single: -1", "cases.single: expected greater than or equal to 0, got '?-1"),
        ("single: 2", "double: 2", "cases.double: expected a known field, got 'double' .valid: single, pair"),
        ("arm.xml", "leg.xml", "robots.model: expected an existing MJCF or URDF file, got leg.xml"),
        ("longest: 7 s", "longest: 6 s", "runs.longest: expected at least shortest, 7, got 6"),
        ("longest: 7 s", "longest: 7 m", "runs.longest: expected a number in s, got '7 m'"),
        ("seed: 5", "sed: 5", "sed: expected a known field"),
    ],
)
def test_a_faulty_scenario_is_reported_in_one_line(old: str, new: str, match: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=match) as caught:
        load_blind_scenario(written(tmp_path, SCENARIO.replace(old, new)))
    assert "\n" not in str(caught.value)


def test_a_folder_holds_one_scenario(scenario, tmp_path) -> None:
    same_scenario(scenario, tmp_path / "scenario.json")
    same_scenario(scenario, tmp_path / "scenario.json")
    with pytest.raises(InputError, match="begun with"):
        same_scenario(scenario.model_copy(update={"seed": 9}), tmp_path / "scenario.json")


def test_a_finished_set_is_left_as_it_is(scenario, sealed, tmp_path, capsys) -> None:
    out = tmp_path / "out"
    shutil.copytree(sealed, out)
    before = read_json(out / "manifest.json")
    with pytest.raises(InputError, match="a folder of this scenario's cases"):
        make(written(tmp_path), out)
    same_scenario(scenario, out / "sealed" / "scenario.json")
    make(written(tmp_path), out)
    assert capsys.readouterr().out == f"{out}: all 5 cases are sealed already\n"
    with pytest.raises(InputError, match="begun with"):
        make(written(tmp_path), out, seed=9)
    assert read_json(out / "manifest.json") == before


@pytest.mark.parametrize("name", ["blind_small", "blind_study"])
def test_the_committed_scenarios_load(name: str) -> None:
    found = load_blind_scenario(Path(__file__).parents[2] / "scenarios" / f"{name}.yaml")
    assert found.name == name
