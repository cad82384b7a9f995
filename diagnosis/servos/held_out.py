"""How far the simulated position is off on halves of runs that were not fitted."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from identification.output_error.fit import Fit
from identification.output_error.frozen import fit_again
from identification.output_error.plant import Limb
from identification.output_error.servo_run import ServoRun
from testbench.drives.identified import position_rms, split

Array = NDArray[np.float64]

# Of each run, in the first fold.
HALF = 0.5


def held_out_errors(
    limb: Limb, given: Array, fits: Sequence[Fit], runs: Sequence[ServoRun], threads: int | None = None
) -> list[Array]:
    """RMS (n,) rad by the table given (n, WIDTH), then by each of the fits made anew on the other halves.

    A hypothesis keeps its effects, and sizes that were found on a grid; all other unknowns are fitted again.
    """
    halves = [split(run, HALF) for run in runs]
    folds = [[first for first, _ in halves], [second for _, second in halves]]
    whole = [limb_of_own(limb)]
    squares = [np.zeros(limb.chain.joints) for _ in range(len(fits) + 1)]
    for train, test in (folds, folds[::-1]):
        tables = [given]
        for each in fits:
            tables.append(fit_again(limb.chain, each.unknowns, train, each.values, threads, 1).table)
        for total, table in zip(squares, tables, strict=True):
            total += 0.5 * position_rms(whole, table, test) ** 2
    return [np.sqrt(each) for each in squares]


def limb_of_own(limb: Limb) -> Limb:
    """The limb as a robot of its own."""
    return Limb(np.arange(limb.chain.joints), limb.chain)
