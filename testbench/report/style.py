"""What all plots share: colours and axes, and points thinned so that nothing that matters is lost."""

from itertools import pairwise
from typing import Any

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray

Array = NDArray[np.float64]

MEASURED, PREDICTED, RESIDUAL = "#1f77b4", "#ff7f0e", "#c0392b"
INSIDE, OUTSIDE, MUTED = "#1f77b4", "#c0392b", "#9aa3ad"
TEMPLATE = go.layout.Template(
    layout={
        "font": {"family": "system-ui, sans-serif", "size": 12, "color": "#2b3440"},
        "paper_bgcolor": "white",
        "plot_bgcolor": "white",
        "margin": {"l": 58, "r": 16, "t": 34, "b": 42},
        "hoverlabel": {"namelength": -1},
        "legend": {"orientation": "h", "x": 0, "y": 1.0, "yanchor": "bottom"},
        "xaxis": {
            "gridcolor": "#edf0f3",
            "zerolinecolor": "#d5dae0",
            "linecolor": "#c6ccd3",
            "showline": True,
        },
        "yaxis": {
            "gridcolor": "#edf0f3",
            "zerolinecolor": "#d5dae0",
            "linecolor": "#c6ccd3",
            "showline": True,
        },
    }
)


# Samples of a line, or dots of a cloud, that are drawn.
POINTS = 1200
# Of a mean over a quantity, and samples that one of them needs.
BINS, FEWEST = 25, 3


def envelope(points: int, *channels: Array) -> NDArray[np.int64]:
    """Indices of about ``points`` samples that keep every channel's extremes, ascending.

    Each of points / (2 channels) equal spans gives the smallest and the largest sample of each channel.
    """
    samples = len(channels[0])
    if samples <= points:
        return np.arange(samples)
    edges = np.linspace(0, samples, max(1, points // (2 * len(channels))) + 1).astype(int)
    kept = {0, samples - 1}
    for start, stop in pairwise(edges):
        for channel in channels:
            kept.add(start + int(np.argmin(channel[start:stop])))
            kept.add(start + int(np.argmax(channel[start:stop])))
    return np.array(sorted(kept), dtype=np.int64)


def single(values: NDArray[np.floating]) -> NDArray[np.float32]:
    """Single precision is plenty for a plot, and halves the page."""
    return np.asarray(values, dtype=np.float32)


def add_line(
    figure: go.Figure, x: Array, y: Array, name: str, colour: str, width: float = 1.4, **of_trace: Any
) -> None:
    """Add a line through all points x and y (K,) to a figure. of_trace: plotly's options of the trace."""
    line = {"color": colour, "width": width}
    figure.add_scatter(x=single(x), y=single(y), name=name, mode="lines", line=line, **of_trace)


def binned_mean(x: Array, y: Array) -> tuple[Array, Array]:
    """Centres and means of the bins of x that hold enough samples."""
    if len(x) == 0:
        return np.empty(0), np.empty(0)
    edges = np.linspace(x.min(), x.max(), BINS + 1)
    index = np.clip(np.digitize(x, edges) - 1, 0, BINS - 1)
    counts = np.bincount(index, minlength=BINS)
    sums = np.bincount(index, weights=y, minlength=BINS)
    full = counts >= FEWEST
    return ((edges[:-1] + edges[1:]) / 2)[full], sums[full] / counts[full]
