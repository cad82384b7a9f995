"""Comparisons: the grid, resuming, Dask, what is written and what is said."""

import csv
import json
from pathlib import Path

import pytest

from identification.errors import InputError
from identification.excitation.design import DesignOptions
from identification.excitation.limits import limit_margins
from identification.excitation.two_stage import design_two_stage
from testbench.compare import case as cases
from testbench.compare import runner
from testbench.compare.compare import compare, summary
from testbench.compare.verdict import verdict
from testbench.log import write_log
from testbench.robot import load_robot

from .diagnosed import simulated_runs
from .small_arm import ARM, SCENARIO

ROOT = Path(__file__).parents[1]
# Small and coarse, so that a case takes a tenth of a second.
COMPARED = (
    SCENARIO.replace("starts: 1", "starts: 1, criterion: hadamard").replace(
        "periods: 1", "periods: 1, physics_timestep: 0.001 s"
    )
    + """
model_error: {scale: 1.0}
comparison: {repetitions: 2, choices: [%s], difference_starts: 1}
variants:
  loud: {noise: {position: 2.0e-4 rad}}
"""
)


@pytest.fixture
def scenario(tmp_path):
    """A function that writes a scenario of the choices given."""
    (tmp_path / "arm.xml").write_text(ARM)

    def write(*choices):
        path = tmp_path / "scenario.yaml"
        path.write_text(COMPARED % ", ".join(choices))
        return path

    return write


@pytest.fixture
def in_this_process(monkeypatch):
    """Cases run here and now, and are counted: starting processes takes seconds."""
    ran = []

    class Here:
        def __init__(self, *arguments, **options):
            pass

        def __enter__(self):
            return self

        def __exit__(self, *error):
            return None

        def submit(self, work, case):
            from concurrent.futures import Future

            ran.append(case)
            future = Future()
            future.set_result(work(case))
            return future

    monkeypatch.setattr(runner, "process_pool", Here)
    return ran


def _rows(path):
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def test_every_choice_level_and_seed_is_a_row_and_the_page_shows_it(scenario, tmp_path, in_this_process):
    found = compare("estimators", scenario("ols", "wls", "extended_kalman"), tmp_path / "out")
    rows = _rows(tmp_path / "out" / "results.csv")
    assert {(r["choice"], r["level"], r["seed"]) for r in rows} == {
        (choice, level, seed)
        for choice in ("ols", "wls", "extended_kalman")
        for level in ("default", "loud")
        for seed in "01"
    }
    assert all(float(r["prediction_error"]) < 0.1 and float(r["seconds"]) > 0 for r in rows)
    assert len(_rows(tmp_path / "out" / "summary.csv")) == 6
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert found[0].startswith("At default torque is predicted best by")
    assert found[0].split(";")[0] in page
    assert "level-prediction_error" in page
    assert "src=" not in page.split("<script>")[0]


def test_an_interrupted_comparison_goes_on_where_it_stopped(scenario, tmp_path, in_this_process):
    path, out = scenario("ols", "wls"), tmp_path / "out"
    compare("estimators", path, out)
    first = _rows(out / "results.csv")
    kept = sorted((out / "cases").glob("*.json"))
    assert len(kept) == len(in_this_process) == 8
    kept[0].unlink()
    in_this_process.clear()
    compare("estimators", path, out)
    assert len(in_this_process) == 1
    again = _rows(out / "results.csv")
    for one, two in zip(first, again, strict=True):
        assert one["parameter_error"] == two["parameter_error"]


def test_another_seed_or_model_is_another_case(scenario, tmp_path, in_this_process):
    path, out = scenario("wls"), tmp_path / "out"
    compare("estimators", path, out)
    compare("estimators", path, out, seed=9)
    (tmp_path / "arm.xml").write_text(ARM.replace('mass="2"', 'mass="2.1"'))
    compare("estimators", path, out)
    assert len({case.key for case in in_this_process}) == 12


def test_cases_run_in_processes_of_their_own(scenario, tmp_path):
    path = scenario("observer")
    path.write_text(path.read_text().replace("repetitions: 2", "repetitions: 1"))
    compare("differentiation", path, tmp_path / "there", jobs=1)
    assert len(_rows(tmp_path / "there" / "results.csv")) == 2
    case = json.loads(next((tmp_path / "there" / "cases").glob("*.json")).read_text())
    assert case["row"]["acceleration_error"] > 0


def test_dask_workers_run_the_cases(scenario, tmp_path):
    from distributed import LocalCluster

    path = scenario("ols", "wls")
    with LocalCluster(
        n_workers=2,
        threads_per_worker=1,
        processes=False,
        protocol="tcp://",
        host="127.0.0.1",
        dashboard_address=None,
    ) as cluster:
        assert cluster.scheduler_address.startswith("tcp://127.0.0.1")
        compare("estimators", path, tmp_path / "out", scheduler=cluster.scheduler_address)
    assert len(_rows(tmp_path / "out" / "results.csv")) == 8


def test_a_scheduler_that_does_not_answer_is_reported_so(scenario, tmp_path, monkeypatch):
    monkeypatch.setattr(runner, "PATIENCE", "1s")
    with pytest.raises(InputError, match="--scheduler"):
        compare("estimators", scenario("wls"), tmp_path / "out", scheduler="tcp://127.0.0.1:9")


def test_what_a_choice_cannot_do_is_a_note(scenario, tmp_path, in_this_process):
    path = scenario("maximum_likelihood")
    path.write_text(path.read_text() + "identification: {model: energy}\n")
    compare("estimators", path, tmp_path / "out")
    rows = _rows(tmp_path / "out" / "results.csv")
    assert all("inverse_dynamic" in r["note"] for r in rows)
    assert (tmp_path / "out" / "report.html").is_file()


def test_criteria_are_designed_and_timed(scenario, tmp_path, in_this_process):
    names = ("logdet", "hadamard_then_logdet", "logdet_differences")
    found = compare("criteria", scenario(*names), tmp_path / "out")
    rows = [
        r for r in _rows(tmp_path / "out" / "results.csv") if r["level"] == "default" and r["seed"] == "0"
    ]
    by_choice = {r["choice"]: r for r in rows}
    alone = by_choice["criterion_alone"]
    assert float(alone["hadamard_ms"]) < float(alone["condition_by_svd_ms"])
    # Differences lead to the same optimum as the exact gradient, at more evaluations.
    exact, rival = by_choice["logdet"], by_choice["logdet_differences"]
    assert float(rival["minus_logdet"]) == pytest.approx(float(exact["minus_logdet"]), abs=0.5)
    assert float(rival["evaluations"]) > 5 * float(exact["evaluations"])
    assert any("Cramér-Rao" in line for line in found)


def test_trajectories_are_designed_and_compared(scenario, tmp_path, in_this_process):
    found = compare("trajectories", scenario("fourier", "harmonic_sines"), tmp_path / "out")
    rows = _rows(tmp_path / "out" / "results.csv")
    assert len(rows) == 8
    assert all(r["limits_kept"] == "1" for r in rows)
    assert any(line.startswith("The most information is in") for line in found)


@pytest.mark.parametrize(
    ("question", "choices", "match"),
    [("weather", (), "criteria, estimators"), ("estimators", ("guess",), "comparison.choices")],
)
def test_unknown_names_list_the_valid_ones(scenario, tmp_path, question, choices, match):
    with pytest.raises(InputError, match=match):
        compare(question, scenario(*choices), tmp_path / "out")


def test_a_missing_recording_is_left_out(scenario, tmp_path, in_this_process):
    path = scenario("wls")
    nowhere = "recorded: {model: no.xml, halves: [no_1.h5, no_2.h5]}"
    path.write_text(path.read_text().replace("difference_starts: 1", nowhere))
    compare("estimators", path, tmp_path / "out")
    assert {r["level"] for r in _rows(tmp_path / "out" / "results.csv")} == {"default", "loud"}


def test_real_recordings_are_compared_by_halves(scenario, tmp_path, real_data, in_this_process):
    path, data = scenario("wls"), real_data / "tx40"
    recorded = f"recorded: {{model: {data}/nominal.xml, halves: [{data}/half_1.h5, {data}/half_2.h5]}}"
    path.write_text(path.read_text().replace("difference_starts: 1", recorded))
    found = compare("estimators", path, tmp_path / "out")
    rows = [r for r in _rows(tmp_path / "out" / "results.csv") if r["level"] == "recorded"]
    assert len(rows) == 2
    assert all(0.1 < float(r["validation_residual"]) < 0.25 for r in rows)
    assert any("recorded robot" in line for line in found)


def test_recordings_are_compared_by_halves(scenario, arm, tmp_path, in_this_process):
    for name, run in simulated_runs(arm, [], runs=2).items():
        write_log(run, tmp_path / f"{name}.h5")
    halves = f"{tmp_path}/run_1.h5, {tmp_path}/run_2.h5"
    path = scenario("wls")
    recorded = f"recorded: {{model: {arm.path}, halves: [{halves}]}}"
    path.write_text(path.read_text().replace("difference_starts: 1", recorded))
    compare("estimators", path, tmp_path / "out")
    rows = [r for r in _rows(tmp_path / "out" / "results.csv") if r["level"] == "recorded"]
    assert len(rows) == 2
    assert all(float(r["validation_residual"]) < 0.1 for r in rows)


def test_the_committed_scenarios_name_what_exists():
    from testbench.scenario import load_scenario

    for question in cases.QUESTIONS:
        scenario, variants = load_scenario(ROOT / "scenarios" / f"compare_{question}.yaml")
        assert scenario.model.is_file()
        assert all(variant.comparison == scenario.comparison for variant in variants.values())


def test_the_two_stage_design_keeps_the_limits_and_beats_its_start(models):
    robot = load_robot(models / "tx90.xml")
    options = DesignOptions(starts=1, iterations=15)
    motion, evaluations = design_two_stage(robot.chain, robot.parameters, robot.limits, options)
    assert limit_margins(robot.chain, robot.parameters, robot.limits, motion).kept
    assert 15 < evaluations < 150


def test_the_verdict_counts_starts_by_the_best_of_all():
    def row(choice, seed, bound, logdet, seconds):
        return {
            "choice": choice, "level": "default", "seed": seed, "note": None,
            "relative_bound": bound, "minus_logdet": logdet, "seconds": seconds,
        }  # fmt: skip

    rows = [row("logdet", seed, 0.02 + 0.01 * seed, seed, 2.0) for seed in range(4)]
    rows += [row("hadamard", seed, 0.1, 50, 1.0) for seed in range(4)]
    rows += [row("hadamard_then_logdet", seed, 0.0205, 0, 1.0) for seed in range(4)]
    rows += [row("logdet_differences", 0, 0.02, 0, 10.0)]
    text = " ".join(verdict("criteria", rows))
    assert "hadamard_then_logdet needs 1 (1 s)" in text
    assert "logdet needs 3 (6 s)" in text
    assert "hadamard never does" in text
    assert "2.5 % of the 40 s of 4 starts by logdet_differences" in text
    # Of what is over in less than a second nobody asks for a share.
    quick = " ".join(verdict("criteria", [row | {"seconds": 0.01} for row in rows]))
    assert "hadamard_then_logdet needs 1 (0.01 s)" in quick
    assert "starts by logdet_differences" not in quick


def test_the_summary_is_the_median_of_what_is_known():
    rows = [
        {"choice": "a", "level": "x", "seed": seed, "note": None, "error": error, "p": None}
        for seed, error in enumerate((1.0, 5.0, 2.0))
    ]
    assert summary(rows) == [{"choice": "a", "level": "x", "cases": 3, "note": None, "error": 2.0}]
