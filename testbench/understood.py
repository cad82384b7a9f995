"""Units, stamps and NaN that a log has otherwise than the format says, but that can mean only one thing."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# How others spell the format's units.
SPELLINGS = {
    "N·m": ("nm", "n m", "n*m", "n.m", "n-m", "newton meter", "newton meters", "newton metre", "newtonmeter"),
    "N": ("newton", "newtons"),
    "rad": ("radian", "radians"),
    "m": ("meter", "metre", "meters", "metres"),
    "us": ("µs", "μs"),
    "s": ("sec", "second", "seconds"),
    "rad/s": ("rad/sec", "rad s^-1", "rad*s^-1"),
    "rad/s^2": ("rad/s2", "rad/s²", "rad/sec^2"),
    "degC": ("°c", "celsius", "deg c"),
}
# Units of time that are no seconds, and what one of them is, s.
TIMES = {"ms": 1e-3, "us": 1e-6, "ns": 1e-9}
# Stamps are in another unit where their rate then is the log's to this share.
NEAR = 0.05
# So many NaN in a row are samples lost on the way; more are a gap that is not filled.
LONGEST = 5


def spelled(unit: str) -> str:
    """A unit as the format spells it, where it is another spelling of that."""
    lowered = " ".join(unit.lower().replace("⋅", "*").replace("·", "*").split())
    for own, others in SPELLINGS.items():
        if lowered in others or lowered == own.lower().replace("·", "*"):
            return own
    return unit


def in_seconds(time: Array, rate: float, unit: str = "s") -> tuple[Array, str]:
    """Time stamps (N,) in seconds and the unit they were in, where the log's rate, Hz, says so."""
    steps = np.diff(time)
    usual = float(np.median(steps)) if len(steps) else 0.0
    if not (np.isfinite(usual) and usual > 0 and np.isfinite(rate) and rate > 0):
        return time, "s"
    for name, second in TIMES.items():
        if unit in ("s", name) and abs(usual * second * rate - 1) < NEAR:
            return time * second, name
    return time, "s"


def without_gaps(time: Array, values: Array) -> tuple[Array, int]:
    """A channel (N, n) with NaN of a few samples in a row interpolated, and how many those samples are."""
    bad = np.isnan(values)
    if values.ndim != 2 or len(values) != len(time) or not bad.any():
        return values, 0
    filled = values.copy()
    for joint, flags in enumerate(bad.T):
        edges = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(int), [0]])))
        longest = int(np.max(edges[1::2] - edges[::2], initial=0))
        if not longest:
            continue
        if longest > LONGEST:
            return values, 0
        filled[flags, joint] = np.interp(time[flags], time[~flags], values[~flags, joint])
    return filled, int(bad.any(axis=1).sum())


def in_order(names: Sequence[str], wanted: Sequence[str]) -> list[int] | None:
    """Where each of the wanted names is among these; None unless they are the same in another order."""
    if tuple(names) == tuple(wanted) or sorted(names) != sorted(wanted):
        return None
    return [list(names).index(name) for name in wanted]
