"""The base parameters in the Rerun session: a chart with error bars and a table."""

import numpy as np
import rerun as rr

from .findings import ParameterRow, parameter_rows, significant
from .results import IdentificationResult

# Data units of the chart: rows are one apart, and this wide is one standard deviation (or 10 %).
UNIT = 2.0
# Farther out than this many units a point is drawn at the edge.
EDGE = 5.0
NAME_WIDTH = 11.0
PANEL_WIDTH = 2 * EDGE * UNIT + NAME_WIDTH
# More rows than this go into another panel beside the first, so that names stay readable.
PANEL_ROWS = 28
INSIDE, OUTSIDE, BAND, GRID, TEXT = (
    (86, 156, 230),
    (240, 92, 80),
    (96, 122, 150),
    (64, 64, 64),
    (215, 215, 215),
)
LONGEST_NAME = 34


def log_parameters(stream: rr.RecordingStream, root: str, result: IdentificationResult) -> None:
    """``root``/table, the figures in Markdown, and ``root``/chart: a row a parameter.

    With a truth the chart shows error over standard deviation with its ±2 σ bar, truth at zero; without,
    the ±2 σ bar relative to the value, 10 % a grid line.
    """
    rows = parameter_rows(result)
    stream.log(f"{root}/table", rr.TextDocument(_table(rows), media_type="text/markdown"), static=True)
    _chart(stream, f"{root}/chart", rows, known=result.comparison is not None)


def _chart(stream: rr.RecordingStream, root: str, rows: tuple[ParameterRow, ...], known: bool) -> None:
    centre = np.array([row.error_std or 0.0 if known else 0.0 for row in rows])
    half = np.full(len(rows), 2.0) if known else np.array([2 * row.percent_sigma / 10 for row in rows])
    colours = [INSIDE if fine else OUTSIDE for fine in (np.abs(centre) <= 2 if known else half <= 2)]
    panel, y = np.divmod(np.arange(len(rows)), PANEL_ROWS)
    origin = panel * PANEL_WIDTH
    left, point, right = (
        origin + UNIT * np.clip(x, -EDGE, EDGE) for x in (centre - half, centre, centre + half)
    )
    _grid(stream, root, int(panel[-1]) + 1, min(len(rows), PANEL_ROWS), known)
    names = np.column_stack([origin - EDGE * UNIT - NAME_WIDTH / 2, y - 0.4])
    _labels(stream, f"{root}/names", names.tolist(), [_short(row.name) for row in rows])
    bars = [[[a, row], [b, row]] for a, b, row in zip(left, right, y, strict=True)]
    stream.log(f"{root}/interval", rr.LineStrips2D(bars, colors=colours, radii=[0.07]), static=True)
    points = rr.Points2D(np.column_stack([point, y]), colors=colours, radii=[0.22], draw_order=40.0)
    stream.log(f"{root}/estimate", points, static=True)


def _grid(stream: rr.RecordingStream, root: str, panels: int, rows: int, known: bool) -> None:
    """Lines and tick labels of every panel; the limits of the ±2 σ (±20 %) band stand out."""
    top, bottom = -1.0, float(rows)
    colours = {0: TEXT, -2: BAND, 2: BAND}
    lines, line_colours, positions, texts = [], [], [], []
    for panel in range(panels):
        for tick in range(-int(EDGE) + 1, int(EDGE)):
            x = panel * PANEL_WIDTH + tick * UNIT
            lines.append([[x, top], [x, bottom]])
            line_colours.append(colours.get(tick, GRID))
            positions.append([x, top - 0.9])
            texts.append(_tick(tick if known else 10 * tick, "σ" if known else "%"))
    strips = rr.LineStrips2D(lines, colors=line_colours, radii=[0.03], draw_order=-2.0)
    stream.log(f"{root}/grid", strips, static=True)
    _labels(stream, f"{root}/ticks", positions, texts)


def _labels(stream: rr.RecordingStream, path: str, positions: list[list[float]], texts: list[str]) -> None:
    """Text on invisible points."""
    points = rr.Points2D(positions, labels=texts, show_labels=True, radii=[0.0], colors=[TEXT])
    stream.log(path, points, static=True)


def _tick(value: int, unit: str) -> str:
    return f"{value:+d} {unit}" if value else "0"


def _table(rows: tuple[ParameterRow, ...]) -> str:
    known = rows[0].truth is not None
    head = ["parameter", "unit", "value", "σ", "%σ"] + (["truth", "error/σ"] if known else [])
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    for row in rows:
        cells = [row.name, row.unit]
        cells += [significant(row.value), significant(row.std, 2), significant(row.percent_sigma, 2)]
        if row.truth is not None:
            cells += [significant(row.truth), significant(row.error_std, 2)]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def _short(name: str) -> str:
    return name if len(name) <= LONGEST_NAME else name[: LONGEST_NAME - 1] + "…"
