"""The gap in closed loop, by stage of the correction."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ForwardGap:
    """Simulated less logged, RMS a joint over the runs, by stage: nominal, parameters, effects.

    runs: names. seconds: simulated. motion: stage to (n,) rad (m). torque: stage to (n,) N·m (N), both
    below the diagnosis's cut-off. failed: stage to why it did not run.
    """

    runs: tuple[str, ...]
    seconds: float
    motion: dict[str, Array]
    torque: dict[str, Array]
    failed: dict[str, str] = field(default_factory=dict)
