import io
import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import plotly.graph_objects as go
import pytest
from rich.console import Console

from identification.statistics import EssentialParameters, ResidualTests
from testbench.estimate_file import write_estimate
from testbench.findings import headline, noise_ratio, significant, torque_error
from testbench.report import write_report
from testbench.report.page import render
from testbench.report.style import envelope
from testbench.results import IdentificationResult
from testbench.summary import WIDTH, summary

from .html_page import Page
from .synthetic import NOISE, synthetic_result, synthetic_robot, without_truth

EXCITATION = {
    "criterion": "hadamard",
    "criteria": {"condition": 87.25, "logdet": 661.0},
    "margins": [0.1, 0.25],
}


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> IdentificationResult:
    return synthetic_result(synthetic_robot(tmp_path_factory.mktemp("robot")))


@pytest.fixture(scope="module")
def text(result: IdentificationResult) -> str:
    return render(result, EXCITATION, "today")


def test_page_needs_no_network_and_is_small(text: str) -> None:
    assert Page(text).sources == []
    assert text.count("plotly.js v") == 1
    assert len(text.encode()) < 6e6


def test_page_holds_a_valid_figure_for_every_plot(text: str) -> None:
    ids = Page(text).ids
    plots = {name for name in ids if f"{name}-data" in ids}
    assert {
        "torque-by-joint",
        "torque-0",
        "torque-1",
        "parameters-plot",
        "spectrum",
        "autocorrelation",
    } <= plots
    assert {"velocity", "motion-0", "motion-1"} <= plots
    found = re.findall(r'<script type="application/json" id="([\w-]+)-data">(.*?)</script>', text, re.DOTALL)
    assert {name for name, _ in found} == plots
    for _, figure in found:
        assert go.Figure(json.loads(figure)).data


def test_parameter_table_quotes_estimate_and_truth(text: str, result: IdentificationResult) -> None:
    rows = {row[0]: row for row in Page(text).rows if len(row) == 10}
    assert len(rows) == result.estimate.base.count
    assert result.comparison is not None
    for name, value, truth in zip(
        result.estimate.base.names, result.estimate.values, result.comparison.truth, strict=True
    ):
        assert float(rows[name][3]) == pytest.approx(value, rel=1e-3)
        assert float(rows[name][6]) == pytest.approx(truth, rel=1e-3)


@pytest.fixture
def tested(result: IdentificationResult) -> IdentificationResult:
    """The result with tests: one joint has too few samples, two parameters do not matter."""
    unknown = np.array([0.3, 1e-5, np.nan])
    kept = np.arange(2, result.estimate.base.count)
    values = np.where(np.arange(result.estimate.base.count) < 2, 0.0, result.estimate.values)
    return replace(
        result,
        residual_tests=ResidualTests(unknown, unknown[::-1], unknown / 2, np.array([120.0, 80.0, 4.0])),
        essential=EssentialParameters(kept, values, result.estimate.std, (1, 0), 0.43),
    )


def test_page_and_file_say_what_the_residual_tests_found(
    tested: IdentificationResult, tmp_path: Path
) -> None:
    page = render(tested, None, "today")
    parameters = {row[0]: row[6] for row in Page(page).rows if len(row) == 11}
    names = tested.estimate.base.names
    assert [parameters[name] for name in names] == ["no", "no", *["yes"] * (len(names) - 2)]
    assert "p = 0.43" in page
    table = Page(page[page.index('id="residual-tests"') :]).rows
    joints = {row[0]: row[1:] for row in table if len(row) == 5}
    assert joints["turn"] == ["0.3", "–", "0.15", "120"]
    assert joints["lift"] == ["1e-05", "1e-05", "5e-06", "80"]
    assert page.count('<td class="bad">1e-05') == 2

    write_estimate(tested, tmp_path / "estimate.json")
    document = json.loads((tmp_path / "estimate.json").read_text())
    assert document["residual_tests"]["whiteness"] == [0.3, 1e-5, None]
    assert document["residual_tests"]["independent_samples"] == [120.0, 80.0, 4.0]
    assert [row["essential"] for row in document["base_parameters"]] == [False, False] + [True] * (
        len(names) - 2
    )
    assert document["dropped_p_value"] == 0.43


def test_page_lists_the_excitation_and_where_everything_came_from(text: str) -> None:
    pairs = {row[0]: row[1] for row in Page(text).rows if len(row) == 2}
    assert pairs["criteria.condition"] == "87.25"
    assert pairs["margins"] == "0.1, 0.25"
    assert pairs["excitation.scenario"] == "synthetic.yaml"


def test_page_of_a_hardware_log_claims_no_truth(result: IdentificationResult) -> None:
    text = render(without_truth(result), None, "today")
    body = text[: text.index("plotly.js v")]
    assert "Cramér-Rao" not in body
    assert "noise floor" not in body
    assert 'id="excitation"' not in body


def test_page_without_validation_says_so(result: IdentificationResult) -> None:
    alone = replace(result, validations=(), validation_recordings=())
    assert "no run was left out to validate it" in render(alone, None, "today")


def test_joint_names_cannot_break_the_page(result: IdentificationResult) -> None:
    chain = replace(result.robot.chain, joint_names=("</script><b>", "lift & tilt", "reach"))
    odd = replace(result, robot=replace(result.robot, chain=chain))
    body = render(odd, None, "today")
    assert "</script><b>" not in body
    assert "lift &amp; tilt" in body


def test_two_pages_differ_in_the_time_stamp_only(
    result: IdentificationResult, tmp_path: Path, text: str
) -> None:
    write_report(result, tmp_path / "report.html", EXCITATION)
    written = re.sub(
        r"Written \d{4}-\d\d-\d\d \d\d:\d\d UTC", "Written today", (tmp_path / "report.html").read_text()
    )
    assert written == text
    assert [p.name for p in tmp_path.iterdir()] == ["report.html"]


def test_pooled_error_is_that_of_the_joined_runs(result: IdentificationResult) -> None:
    runs = (*result.fits, *result.validations)
    error = torque_error(runs)
    assert error is not None
    residual = [r.measured - r.predicted for r in runs]
    for joint in range(result.robot.joints):
        used = np.concatenate([r[run.used[:, joint], joint] for r, run in zip(residual, runs, strict=True)])
        assert error.rms[joint] == pytest.approx(np.sqrt(np.mean(used**2)), rel=1e-12)
    # White noise of NOISE times the RMS over about 2400 samples: 1.4 % standard error, four of them.
    assert error.overall == pytest.approx(NOISE, rel=0.06)


def test_a_run_of_less_torque_is_not_predicted_worse_for_that(result: IdentificationResult) -> None:
    (fit,) = result.fits
    residual = fit.measured - fit.predicted
    quiet = replace(fit, measured=0.4 * fit.measured, predicted=0.4 * fit.measured - residual)
    worse = replace(fit, predicted=fit.measured - 3 * residual)
    assert "determine too little" not in headline(replace(result, validations=(quiet,)))
    assert "determine too little" in headline(replace(result, validations=(worse,)))


def test_headline_compares_with_noise_and_truth(result: IdentificationResult) -> None:
    ratio = noise_ratio(result)
    assert ratio is not None
    assert f"{ratio:.2f} times what sensor noise alone leaves" in headline(result)
    worse = replace(result.validations[0], predicted=0.5 * result.validations[0].predicted)
    assert "at the noise floor" in headline(result)
    assert "above the noise floor" in headline(replace(result, validations=(worse,)))
    assert "truth" not in headline(without_truth(result))


def test_without_noise_nothing_is_reported_as_a_multiple_of_it(result: IdentificationResult) -> None:
    assert result.comparison is not None
    silent = replace(result.comparison, noise_floor=np.zeros(3))
    clean = replace(result, comparison=silent)
    with np.errstate(all="raise"):
        assert noise_ratio(clean) is None
        assert "noise" not in headline(clean)


def test_estimate_file_follows_the_contract(result: IdentificationResult, tmp_path: Path) -> None:
    write_estimate(result, tmp_path / "estimate.json")
    document = json.loads((tmp_path / "estimate.json").read_text())
    assert document["joint_names"] == ["turn", "lift", "reach"]
    assert [p["value"] for p in document["base_parameters"]] == result.estimate.values.tolist()
    assert [p["std"] for p in document["base_parameters"]] == result.estimate.std.tolist()
    assert result.comparison is not None
    assert [p["truth"] for p in document["base_parameters"]] == result.comparison.truth.tolist()
    assert document["torque_rms"]["validation"] == pytest.approx(
        result.validations[0].rms.tolist(), rel=1e-12
    )
    assert document["relative_residual"]["fit"] == pytest.approx(result.fits[0].relative.tolist(), rel=1e-12)
    assert document["torque_rms"]["unit"] == "N·m (N for a slide joint)"
    assert document["condition_number"] == result.estimate.condition_number
    assert document["effective_samples"] == result.estimate.effective_samples


def test_estimate_file_writes_null_for_what_is_unknown(result: IdentificationResult, tmp_path: Path) -> None:
    still = replace(result.fits[0], used=result.fits[0].used & np.array([True, True, False]))
    unknown = replace(without_truth(result), fits=(still,), validations=(), validation_recordings=())
    write_estimate(unknown, tmp_path / "estimate.json")
    document = json.loads((tmp_path / "estimate.json").read_text())
    assert {p["truth"] for p in document["base_parameters"]} == {None}
    assert document["torque_rms"]["fit"][2] is None
    assert document["torque_rms"]["validation"] == []


def test_a_joint_at_rest_spoils_neither_page_nor_summary(result: IdentificationResult) -> None:
    still = replace(result.validations[0], used=result.validations[0].used & np.array([True, False, True]))
    rested = replace(result, validations=(still,))
    assert "–" in next(row[3] for row in Page(render(rested, None, "today")).rows if row and row[0] == "lift")
    assert result.comparison is not None
    moving = [0, 2]
    expected = np.linalg.norm(still.rms[moving]) / np.linalg.norm(result.comparison.noise_floor[moving])
    assert noise_ratio(rested) == pytest.approx(expected, rel=1e-12)


def test_summary_fits_its_columns(result: IdentificationResult) -> None:
    console = Console(width=WIDTH, record=True, file=io.StringIO())
    console.print(summary(result))
    lines = console.export_text().splitlines()
    assert max(map(len, lines)) <= WIDTH
    assert not any("…" in line for line in lines)
    assert any(line.startswith("fc_3") for line in lines)
    assert any(line.startswith("reach") for line in lines)


def test_envelope_keeps_the_extremes_of_every_channel() -> None:
    rng = np.random.default_rng(0)
    one, two = rng.standard_normal((2, 5000))
    kept = envelope(400, one, two)
    assert len(kept) <= 402
    assert np.all(np.diff(kept) > 0)
    for channel in (one, two):
        assert {int(np.argmin(channel)), int(np.argmax(channel)), 0, 4999} <= set(kept.tolist())
    np.testing.assert_array_equal(envelope(400, one[:300]), np.arange(300))


@pytest.mark.parametrize(
    ("value", "text"),
    [(None, "–"), (float("nan"), "–"), (123.4, "123"), (0.012345, "0.012"), (1e-7, "1e-07")],
)
def test_significant_digits(value: float | None, text: str) -> None:
    assert significant(value, 2) == text
