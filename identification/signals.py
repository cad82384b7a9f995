"""One recorded motion as arrays, before and after filtering."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Motion:
    """Raw samples of one run on a uniform grid.

    position: (N, n) rad (m). torque: (N, n) N·m (N). sample_rate: Hz.
    """

    position: Array
    torque: Array
    sample_rate: float


@dataclass(frozen=True)
class Signals:
    """A filtered motion on its uniform grid, edges still in place.

    q, dq, ddq: (N, n) rad, rad/s, rad/s². tau: (N, n) N·m, as measured (it is filtered together
    with the regressor). sample_rate: Hz. trim: samples at each end that filtering has spoiled.
    """

    q: Array
    dq: Array
    ddq: Array
    tau: Array
    sample_rate: float
    trim: int
