"""report.html: one page that needs nothing but a browser."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import plotly.graph_objects as go
from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined
from markupsafe import Markup
from plotly.offline import get_plotlyjs

from identification.statistics import PERIODS_A_LAG, SIGNIFICANCE
from testbench.files import write_text
from testbench.findings import (
    AT_NOISE_FLOOR,
    TorqueError,
    headline,
    left_open,
    noise_ratio,
    parameter_rows,
    significant,
    torque_error,
    within,
)
from testbench.results import IdentificationResult

from . import figures


@dataclass(frozen=True)
class Tile:
    """One figure at the top of the page. good: True, False, or None where there is nothing to judge by."""

    value: str
    label: str
    good: bool | None = None


@dataclass(frozen=True)
class Plot:
    """A plot of the page: its element's id, what it shows, and the figure as JSON."""

    id: str
    caption: str
    height: int
    json: Markup


def write_report(
    result: IdentificationResult, path: str | Path, excitation: Mapping[str, Any] | None = None
) -> None:
    """Write report.html, whole or not at all. Two pages of one result differ in the time stamp only.

    excitation: figures of the designed trajectory to list by name, such as its criteria and margins.
    """
    write_text(render(result, excitation, time_stamp()), path)


def render(result: IdentificationResult, excitation: Mapping[str, Any] | None, created: str) -> str:
    """The page as text."""
    robot, comparison = result.robot, result.comparison
    names, units = robot.joint_names, robot.units()
    fit, validation = torque_error(result.fits), torque_error(result.validations)
    floor = None if comparison is None else comparison.noise_floor
    judged_error = validation or fit
    rows = parameter_rows(result)
    judged = figures.judged_run(result)
    runs = [("validation", run) for run in result.validations] + [("fit", run) for run in result.fits]
    slides = robot.chain.is_slide
    return rendered(
        "report.html",
        ("testbench.report",),
        created,
        robot=robot.name,
        model=robot.described,
        headline=headline(result),
        left_open=left_open(result),
        log_findings=result.log_findings,
        tiles=_tiles(result, fit, validation),
        joints=[
            {
                "name": name,
                "unit": unit,
                "fit": None if fit is None else fit.rms[joint],
                "validation": None if validation is None else validation.rms[joint],
                "floor": None if floor is None else floor[joint],
                "band": None if result.bands is None else result.bands.cutoff[joint],
                "unfiltered": None
                if result.bands is None or judged_error is None
                else judged_error.unfiltered[joint],
                "fit_relative": None if fit is None else 100 * fit.relative[joint],
                "validation_relative": None if validation is None else 100 * validation.relative[joint],
            }
            for joint, (name, unit) in enumerate(zip(names, units, strict=True))
        ],
        parameters=[
            {"row": row, "joint": robot.chain.link_names[row.joint], "needed": needed}
            for row, needed in zip(rows, result.needed, strict=True)
        ],
        known=comparison is not None,
        banded=result.bands is not None,
        essential=result.essential,
        tests=_tests(result),
        lag_periods=PERIODS_A_LAG,
        significance=SIGNIFICANCE,
        judged=judged.name,
        torque_by_joint=plot("torque-by-joint", "", figures.torque_by_joint(names, fit, validation, floor)),
        torques=[
            plot(f"torque-{index}", f"{role.capitalize()} run: {run.name}", figures.torque(run, names, units))
            for index, (role, run) in enumerate(runs)
        ],
        parameter_plot=plot("parameters-plot", "", figures.parameters(rows)),
        residuals=[
            plot("spectrum", "Spectrum: flat is white", figures.residual_spectrum(judged, names)),
            plot(
                "autocorrelation",
                "Autocorrelation: inside the band is white",
                figures.residual_autocorrelation(judged, names),
            ),
        ],
        velocity=plot(
            "velocity",
            "Against velocity: a mean that leaves zero is friction the model does not have",
            figures.residual_against_velocity(result.validations or result.fits, names, units, slides),
        ),
        motions=[
            plot(
                f"motion-{index}",
                f"{role.capitalize()} run: {run.name}",
                figures.motion(run, names, robot.limits.lower, robot.limits.upper, slides),
            )
            for index, (role, run) in enumerate(runs)
        ],
        excitation=None if not excitation else flatten(excitation),
        provenance=_provenance(result),
    )


def time_stamp() -> str:
    """The present time as pages have it."""
    return datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC")


def rendered(template: str, packages: Sequence[str], created: str, **content: Any) -> str:
    """A page as text, plotly in it. created: of ``time_stamp``.

    packages: whose folders ``templates`` are searched, in this order.
    """
    environment = Environment(
        loader=ChoiceLoader([PackageLoader(package) for package in packages]),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["significant"] = significant
    page = environment.get_template(template)
    return page.render(created=created, plotly=Markup(get_plotlyjs()), **content)


def plot(name: str, caption: str, figure: go.Figure) -> Plot:
    """A figure as the page takes it; its layout must say how high it is."""
    # "</" would end the script element that holds the figure.
    text = figure.to_json().replace("</", "<\\/")
    return Plot(name, caption, int(figure.layout.height), Markup(text))


def flatten(values: Mapping[str, Any], prefix: str = "") -> list[tuple[str, str]]:
    """Names and values of a nested mapping as text, nested names joined by a dot."""
    pairs = []
    for name, value in values.items():
        label = f"{prefix}{name}"
        if isinstance(value, Mapping):
            pairs += flatten(value, f"{label}.")
        else:
            pairs.append((label, _text(value)))
    return pairs


def _text(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, list | tuple):
        return ", ".join(_text(item) for item in value)
    return str(value)


def _tiles(
    result: IdentificationResult, fit: TorqueError | None, validation: TorqueError | None
) -> list[Tile]:
    tiles = []
    if validation is not None:
        tiles.append(Tile(f"{100 * validation.overall:.3g} %", "torque residual, validation"))
    if fit is not None:
        tiles.append(Tile(f"{100 * fit.overall:.3g} %", "torque residual, fit"))
    ratio, inside = noise_ratio(result), within(result, 2)
    if ratio is not None:
        tiles.append(Tile(f"{ratio:.2f} ×", "of the noise floor", ratio <= AT_NOISE_FLOOR))
    count = result.estimate.base.count
    if inside is not None:
        # Two deviations hold 95 % of normal errors.
        tiles.append(
            Tile(f"{inside} of {count}", "parameters within 2 σ of the truth", inside >= 0.9 * count)
        )
    else:
        tiles.append(Tile(f"{count}", "base parameters"))
    tiles.append(Tile(significant(result.estimate.condition_number, 3), "condition number"))
    tiles.append(Tile(significant(result.estimate.effective_samples, 3), "effective samples"))
    return tiles


def _tests(result: IdentificationResult) -> list[dict[str, Any]]:
    """Tests of each joint's residual; none where they were not made."""
    tests = result.residual_tests
    if tests is None:
        return []
    columns = (
        result.robot.joint_names,
        tests.whiteness,
        tests.normality,
        tests.first_autocorrelation,
        tests.independent_samples,
    )
    names = ("joint", "whiteness", "normality", "first", "samples")
    return [dict(zip(names, row, strict=True)) for row in zip(*columns, strict=True)]


def _provenance(result: IdentificationResult) -> list[tuple[str, str]]:
    pairs = [("estimator", result.estimate.estimator), ("model", result.robot.path.name)]
    for role, fits, recordings in (
        ("fit", result.fits, result.fit_recordings),
        ("validation", result.validations, result.validation_recordings),
    ):
        for fit, recording in zip(fits, recordings, strict=True):
            seconds = recording.time[-1] - recording.time[0]
            about = f"{recording.source}, {seconds:.4g} s at {recording.sample_rate:.6g} Hz"
            pairs.append((f"{role} run {fit.name}", about))
            pairs += flatten(recording.provenance, f"{fit.name}.")
    return pairs
