"""The page's plots, as plotly figures."""

from collections.abc import Callable

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray
from plotly.subplots import make_subplots
from scipy.signal import periodogram, welch

from identification.estimate import TorqueFit
from testbench.findings import ParameterRow, TorqueError
from testbench.results import IdentificationResult

from .style import (
    INSIDE,
    MEASURED,
    MUTED,
    OUTSIDE,
    POINTS,
    PREDICTED,
    RESIDUAL,
    TEMPLATE,
    binned_mean,
    envelope,
    single,
)

Array = NDArray[np.float64]

JOINT_COLOURS = (
    "#1f77b4",
    "#ff7f0e",
    "#2ca02c",
    "#d62728",
    "#9467bd",
    "#8c564b",
    "#e377c2",
    "#17becf",
    "#bcbd22",
)
LONGEST_LAG = 0.5
SPECTRUM_SEGMENT = 128


def torque_by_joint(
    names: tuple[str, ...], fit: TorqueError | None, validation: TorqueError | None, floor: Array | None
) -> go.Figure:
    """Relative torque error a joint, fitted and not, beside the noise floor on the same scale."""
    figure = go.Figure(layout={"template": TEMPLATE, "barmode": "group", "height": 300})
    for label, error, colour in (("fit", fit, MUTED), ("validation", validation, MEASURED)):
        if error is not None:
            figure.add_bar(x=names, y=100 * error.relative, name=label, marker_color=colour)
    judged = validation or fit
    if floor is not None and judged is not None:
        with np.errstate(invalid="ignore", divide="ignore"):
            relative_floor = 100 * floor * judged.relative / judged.rms
        marker = {"symbol": "line-ew", "size": 34, "line": {"width": 2.5, "color": PREDICTED}}
        figure.add_scatter(x=names, y=relative_floor, name="noise floor", mode="markers", marker=marker)
    figure.update_yaxes(title="residual RMS / torque RMS, %", rangemode="tozero")
    return figure


def torque(fit: TorqueFit, names: tuple[str, ...], units: tuple[str, ...]) -> go.Figure:
    """Measured and predicted torque of one run, a panel a joint, the residual under each."""
    rows = -(-len(names) // 2)
    figure = make_subplots(
        rows=2 * rows,
        cols=2,
        specs=_specs(2 * len(names), 2 * rows, lambda row, column: 4 * (row // 2) + 2 * column + row % 2),
        row_heights=[0.68, 0.32] * rows,
        vertical_spacing=0.09 / rows,
        horizontal_spacing=0.08,
        shared_xaxes="columns",
    )
    for joint, (name, unit) in enumerate(zip(names, units, strict=True)):
        row, column = 2 * (joint // 2) + 1, joint % 2 + 1
        measured, predicted = fit.measured[:, joint], fit.predicted[:, joint]
        kept = envelope(POINTS, measured, _residual(fit, joint))
        residual = np.where(fit.used[:, joint], measured - predicted, np.nan)
        time = single(fit.time[kept])
        for label, values, colour, width, where in (
            ("measured", measured, MEASURED, 2.2, row),
            ("predicted", predicted, PREDICTED, 1.1, row),
            ("residual", residual, RESIDUAL, 0.8, row + 1),
        ):
            figure.add_scatter(
                x=time,
                y=single(values[kept]),
                name=label,
                legendgroup=label,
                showlegend=joint == 0,
                mode="lines",
                line={"color": colour, "width": width},
                row=where,
                col=column,
            )
        figure.update_yaxes(title=f"{name}, {unit}", row=row, col=column)
        figure.update_yaxes(title="residual", row=row + 1, col=column)
        if joint + 2 >= len(names):
            figure.update_xaxes(showticklabels=True, title="time, s", row=row + 1, col=column)
    figure.update_layout(template=TEMPLATE, height=290 * rows + 70, legend_y=1 + 0.04 / rows)
    return figure


def parameters(rows: tuple[ParameterRow, ...]) -> go.Figure:
    """Error over standard deviation with its ±2 σ band; without a truth the relative deviation."""
    labels = [row.name for row in rows]
    if rows[0].truth is not None:
        values = np.array([np.nan if row.error_std is None else row.error_std for row in rows])
        colours = [INSIDE if abs(value) <= 2 else OUTSIDE for value in values]
        figure = go.Figure(layout={"template": TEMPLATE})
        figure.add_vrect(x0=-2, x1=2, fillcolor="#1f77b4", opacity=0.08, line_width=0)
        figure.add_vline(x=0, line={"color": "#5b6670", "width": 1})
        figure.add_scatter(
            x=values,
            y=labels,
            mode="markers",
            marker={"color": colours, "size": 8},
            error_x={
                "type": "constant",
                "value": 2,
                "color": "rgba(31,119,180,.35)",
                "thickness": 1.2,
                "width": 2,
            },
            hovertemplate="%{y}<br>error %{x:.2f} σ<extra></extra>",
        )
        figure.update_xaxes(title="(estimate − truth) / σ, with ±2 σ bars")
    else:
        values = np.array([row.percent_sigma for row in rows])
        figure = go.Figure(layout={"template": TEMPLATE})
        figure.add_vline(x=10, line={"color": "#5b6670", "width": 1, "dash": "dot"})
        figure.add_scatter(
            x=values,
            y=labels,
            mode="markers",
            marker={"color": [INSIDE if value <= 10 else OUTSIDE for value in values], "size": 8},
            hovertemplate="%{y}<br>%{x:.3g} %<extra></extra>",
        )
        figure.update_xaxes(
            title="standard deviation, % of the value", type="log", dtick="D2", tickformat="~g"
        )
    ticks = [label if len(label) <= 42 else label[:41] + "…" for label in labels]
    figure.update_yaxes(range=[len(rows) - 0.2, -0.8], tickvals=labels, ticktext=ticks, tickfont_size=10.5)
    figure.update_layout(height=90 + 17 * len(rows), margin_l=290, showlegend=False)
    return figure


def residual_spectrum(fit: TorqueFit, names: tuple[str, ...]) -> go.Figure:
    """Amplitude spectral density of each joint's residual relative to its RMS, so that joints compare."""
    figure = go.Figure(layout={"template": TEMPLATE, "height": 330})
    rate = 1 / float(np.median(np.diff(fit.time)))
    for joint, name in enumerate(names):
        residual = _residual(fit, joint)
        if not np.any(residual):
            continue
        frequency, power = welch(
            residual / np.std(residual),
            rate,
            nperseg=min(SPECTRUM_SEGMENT, len(residual)),
            detrend="constant",
        )
        figure.add_scatter(
            x=single(frequency[1:]), y=single(np.sqrt(power[1:])), name=name, line=_joint_line(joint)
        )
    figure.update_xaxes(title="frequency, Hz", type="log", dtick="D2", tickformat="~g")
    figure.update_yaxes(title="residual / its RMS, 1/√Hz", type="log", tickformat="~g")
    return figure


def residual_autocorrelation(fit: TorqueFit, names: tuple[str, ...]) -> go.Figure:
    """Autocorrelation of each joint's residual, with the 95 % band of white noise."""
    figure = go.Figure(layout={"template": TEMPLATE, "height": 330})
    step = float(np.median(np.diff(fit.time)))
    lags = min(len(fit.time) - 1, max(2, round(LONGEST_LAG / step)))
    for joint, name in enumerate(names):
        residual = _residual(fit, joint)
        if not np.any(residual):
            continue
        # By the Wiener-Khinchin theorem, padded so that the ends do not meet.
        _, power = periodogram(residual, nfft=2 * len(residual), detrend="constant", return_onesided=False)
        correlation = np.fft.ifft(power).real[: lags + 1]
        figure.add_scatter(
            x=single(step * np.arange(lags + 1)),
            y=single(correlation / correlation[0]),
            name=name,
            line=_joint_line(joint),
        )
    band = 1.96 / np.sqrt(len(fit.time))
    figure.add_hrect(y0=-band, y1=band, fillcolor="#5b6670", opacity=0.15, line_width=0)
    figure.update_xaxes(title="lag, s")
    figure.update_yaxes(title="autocorrelation")
    return figure


def residual_against_velocity(
    fits: tuple[TorqueFit, ...], names: tuple[str, ...], units: tuple[str, ...], is_slide: NDArray[np.bool_]
) -> go.Figure:
    """Residual over joint velocity: samples, and the mean of each velocity bin, a panel a joint."""
    figure = _panels(len(names))
    for joint, unit in enumerate(units):
        used = np.concatenate([fit.used[:, joint] for fit in fits])
        velocity = np.concatenate([fit.dq[:, joint] for fit in fits])[used]
        residual = np.concatenate([fit.measured[:, joint] - fit.predicted[:, joint] for fit in fits])[used]
        where = {"row": joint // 3 + 1, "col": joint % 3 + 1}
        every = slice(None, None, max(1, len(velocity) // POINTS))
        figure.add_scattergl(
            x=single(velocity[every]),
            y=single(residual[every]),
            mode="markers",
            name="samples",
            legendgroup="samples",
            showlegend=joint == 0,
            marker={"size": 2.5, "color": MUTED, "opacity": 0.6},
            **where,
        )
        centre, mean = binned_mean(velocity, residual)
        figure.add_scatter(
            x=single(centre),
            y=single(mean),
            mode="lines+markers",
            name="mean of the bin",
            legendgroup="mean",
            showlegend=joint == 0,
            line={"color": RESIDUAL, "width": 1.5},
            marker_size=4,
            **where,
        )
        figure.update_xaxes(title=f"{names[joint]}, {'m/s' if is_slide[joint] else 'rad/s'}", **where)
        figure.update_yaxes(title=f"residual, {unit}", title_standoff=4, **where)
    return figure


def motion(
    fit: TorqueFit, names: tuple[str, ...], lower: Array, upper: Array, is_slide: NDArray[np.bool_]
) -> go.Figure:
    """The way of each joint through its range; limits dashed where the model sets any."""
    figure = _panels(len(names))
    for joint, name in enumerate(names):
        where = {"row": joint // 3 + 1, "col": joint % 3 + 1}
        kept = envelope(POINTS // 2, fit.q[:, joint])
        figure.add_scatter(
            x=single(fit.time[kept]),
            y=single(fit.q[kept, joint]),
            name="position",
            showlegend=joint == 0,
            line={"color": MEASURED, "width": 1.4},
            **where,
        )
        for limit in (lower[joint], upper[joint]):
            if np.isfinite(limit):
                figure.add_hline(
                    y=float(limit), line={"color": RESIDUAL, "width": 1, "dash": "dash"}, **where
                )
        figure.update_xaxes(title="time, s", **where)
        figure.update_yaxes(title=f"{name}, {'m' if is_slide[joint] else 'rad'}", title_standoff=4, **where)
    figure.update_layout(showlegend=False)
    return figure


def judged_run(result: IdentificationResult) -> TorqueFit:
    """The run that residuals are shown for: the first that was not fitted, else the first."""
    return (result.validations or result.fits)[0]


def _panels(joints: int) -> go.Figure:
    """Three panels a row, one a joint."""
    rows = -(-joints // 3)
    specs = _specs(joints, rows, lambda row, column: 3 * row + column, columns=3)
    figure = make_subplots(
        rows=rows, cols=3, specs=specs, vertical_spacing=0.26 / rows, horizontal_spacing=0.08
    )
    return figure.update_layout(template=TEMPLATE, height=250 * rows + 60, legend_y=1 + 0.03 / rows)


def _specs(
    panels: int, rows: int, order: Callable[[int, int], int], columns: int = 2
) -> list[list[dict[str, str] | None]]:
    """A grid with no empty axes where there are fewer panels than cells; order numbers the cells."""
    return [[{} if order(row, column) < panels else None for column in range(columns)] for row in range(rows)]


def _residual(fit: TorqueFit, joint: int) -> Array:
    """The residual with unused samples at zero, so that the grid stays uniform."""
    return np.where(fit.used[:, joint], fit.measured[:, joint] - fit.predicted[:, joint], 0.0)


def _joint_line(joint: int) -> dict[str, object]:
    return {"color": JOINT_COLOURS[joint % len(JOINT_COLOURS)], "width": 1.4}
