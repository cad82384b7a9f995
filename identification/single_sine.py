"""Motion that is one sine: its acceleration is its position over again.

Along q = q0 + a sin(w t) the acceleration is -w² (q - q0): inertia, gravity, springs and every other law of
the position make one column. A second frequency, or another pose of the arm, tells them apart.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

Array = NDArray[np.float64]

# Share of a joint's squared motion that one sine may leave.
REST = 0.01
# Periods that a run must hold of it: part of one is any smooth move.
PERIODS = 1.5
# The spectrum that a frequency is first read from is this much finer than the run's own.
FINER = 8


def sine_frequency(time: Array, position: Array) -> float | None:
    """Hz of the one sine that a position (N,) follows along time (N,) in s; None where it follows none."""
    time, q = time - time[0], position - position.mean()
    step = float(np.median(np.diff(time)))
    spectrum = np.abs(np.fft.rfft(q, FINER * len(q)))
    frequency = np.fft.rfftfreq(FINER * len(q), step)
    peak = float(frequency[int(np.argmax(spectrum))])
    apart = 1 / (len(q) * step)

    def left(hertz: float) -> float:
        angle = 2 * np.pi * hertz * time
        columns = np.column_stack([np.ones_like(time), np.sin(angle), np.cos(angle)])
        rest = q - columns @ np.linalg.lstsq(columns, q, rcond=None)[0]
        return float(rest @ rest) / float(q @ q)

    bounds = (max(peak - apart, 0.1 * apart), peak + apart)
    best = minimize_scalar(left, bounds=bounds, method="bounded")
    return float(best.x) if best.x >= PERIODS * apart and best.fun < REST else None
