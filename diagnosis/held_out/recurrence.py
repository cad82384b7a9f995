"""A push that every run has."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..model.candidate import Candidate


@dataclass(frozen=True)
class Recurrence:
    """A push of every run. pushed: with when it is. coefficients: (k,), of all runs."""

    pushed: Candidate
    coefficients: NDArray[np.float64]
