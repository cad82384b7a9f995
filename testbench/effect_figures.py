"""Pictures of effects as plain SVG: residual against time, velocity and position; who explains whom."""

from collections.abc import Mapping, Sequence
from html import escape

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

WIDTH, HEIGHT = 900, 230
PANELS, LEFT, TOP, BOTTOM, BETWEEN = 3, 52, 30, 40, 26
POINTS = 260
INK, GRID, BEFORE, AFTER = "#333", "#ddd", "#9db7d5", "#c4421a"
FONT = "font-family='Helvetica,Arial,sans-serif' font-size='11'"


def residual_svg(panels: Sequence[tuple[str, Array]], before: Array, after: Array, unit: str) -> str:
    """Three panels of a residual, before and after re-identification.

    panels: axis label and abscissa (K,) of each; the first is drawn as lines, the others as dots.
    before, after: (K,) in ``unit``.
    """
    keep = np.unique(np.linspace(0, len(before) - 1, 2 * POINTS).astype(int))
    low, high = _range(np.concatenate([before, after]))
    width = (WIDTH - LEFT - BETWEEN * (PANELS - 1) - 12) / PANELS
    parts = []
    for index, (label, values) in enumerate(panels):
        x0 = LEFT + index * (width + BETWEEN)
        first, last = _range(values)
        parts.append(_axes(x0, width, (first, last), (low, high), label, index == 0))
        for residual, colour in ((before, BEFORE), (after, AFTER)):
            x = x0 + (values[keep] - first) / (last - first) * width
            y = TOP + (high - residual[keep]) / (high - low) * (HEIGHT - TOP - BOTTOM)
            if index == 0:
                parts.append(f"<path d='{_line(x, y)}' fill='none' stroke='{colour}' stroke-width='1.2'/>")
            else:
                dots = "".join(f"M{a:.0f} {b:.0f}h0" for a, b in zip(x[::2], y[::2], strict=True))
                parts.append(
                    f"<path d='{dots}' stroke='{colour}' stroke-width='2.6' stroke-linecap='round'/>"
                )
    parts.append(
        f"<text x='{LEFT}' y='16' fill='{INK}'>residual torque, {escape(unit)}:</text>"
        f"<text x='{LEFT + 122}' y='16' fill='#5f86b3'>by the model as given</text>"
        f"<text x='{LEFT + 252}' y='16' fill='{AFTER}'>after re-identification</text>"
    )
    return _document(WIDTH, HEIGHT, parts)


def confusion_svg(explained: Mapping[str, Mapping[str, float]], candidates: Sequence[str]) -> str:
    """A square a pair: how much of the row's effect a candidate's signature explains, 0 to 1."""
    cell, left, top = 24, 190, 170
    parts = []
    for column, candidate in enumerate(candidates):
        x = left + column * cell + 16
        parts.append(
            f"<text transform='translate({x},{top - 6}) rotate(-60)' fill='{INK}'>{escape(candidate)}</text>"
        )
    for row, (effect, shares) in enumerate(explained.items()):
        y = top + row * cell
        parts.append(
            f"<text x='{left - 6}' y='{y + 16}' text-anchor='end' fill='{INK}'>{escape(effect)}</text>"
        )
        for column, candidate in enumerate(candidates):
            share = max(shares[candidate], 0.0)
            pale = round(255 - 175 * share)
            # Its own signature in blue, another's in red.
            colour = f"rgb({pale},{pale},255)" if candidate == effect else f"rgb(255,{pale},{pale})"
            x = left + column * cell
            frame = f"<rect x='{x}' y='{y}' width='{cell - 1}' height='{cell - 1}' fill='{colour}'"
            parts.append(f"{frame} stroke='{GRID}' stroke-width='0.5'/>")
            if share >= 0.1:
                parts.append(
                    f"<text x='{x + 11.5}' y='{y + 16}' text-anchor='middle' font-size='9' "
                    f"fill='{INK}'>{100 * share:.0f}</text>"
                )
    width, height = len(candidates) * cell, len(explained) * cell
    return _document(left + width + 70, top + height + 10, parts)


def _axes(
    x0: float, width: float, across: tuple[float, float], up: tuple[float, float], label: str, numbered: bool
) -> str:
    """Grid, ticks and label of one panel."""
    height = HEIGHT - TOP - BOTTOM
    parts = []
    for value in _ticks(*up):
        y = TOP + (up[1] - value) / (up[1] - up[0]) * height
        parts.append(f"<path d='M{x0:.0f} {y:.1f}h{width:.0f}' stroke='{GRID}'/>")
        if numbered:
            parts.append(
                f"<text x='{x0 - 5:.0f}' y='{y + 4:.1f}' text-anchor='end' fill='{INK}'>{value:g}</text>"
            )
    for value in _ticks(*across):
        x = x0 + (value - across[0]) / (across[1] - across[0]) * width
        parts.append(f"<path d='M{x:.1f} {TOP}v{height}' stroke='{GRID}'/>")
        parts.append(
            f"<text x='{x:.1f}' y='{TOP + height + 14}' text-anchor='middle' fill='{INK}'>{value:g}</text>"
        )
    middle = x0 + width / 2
    parts.append(
        f"<text x='{middle:.0f}' y='{HEIGHT - 8}' text-anchor='middle' fill='{INK}'>{escape(label)}</text>"
    )
    return "".join(parts)


def _range(values: Array) -> tuple[float, float]:
    """Smallest and largest, apart even where all are equal."""
    low, high = float(values.min()), float(values.max())
    margin = 0.04 * (high - low) or max(abs(high), 1.0) * 0.1
    return low - margin, high + margin


def _ticks(low: float, high: float) -> list[float]:
    """Round values inside a range, three to six."""
    rough = (high - low) / 6
    power = 10.0 ** np.floor(np.log10(rough))
    step = power * next(factor for factor in (1, 2, 5, 10) if factor * power >= rough)
    count = range(int(np.ceil(low / step)), int(np.floor(high / step)) + 1)
    return [float(f"{index * step:.6g}") for index in count]


def _line(x: Array, y: Array) -> str:
    return "M" + "L".join(f"{a:.1f} {b:.1f}" for a, b in zip(x, y, strict=True))


def _document(width: float, height: float, parts: Sequence[str]) -> str:
    head = f"<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 {width:.0f} {height:.0f}' {FONT}>"
    return f"{head}<rect width='100%' height='100%' fill='#fff'/>{''.join(parts)}</svg>\n"
