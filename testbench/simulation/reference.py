"""The sampled motion that a controller is commanded to follow."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.errors import InputError
from identification.excitation.trajectory import Trajectory

Array = NDArray[np.float64]

# Of one run: an hour at 1 kHz is a third of it.
MOST_SAMPLES = 10_000_000


@dataclass(frozen=True)
class Reference:
    """Position, velocity and acceleration at the controller's ticks; each (N, n), rad, rad/s, rad/s² (m).

    Raises InputError unless the three have one shape, at least two samples and finite values.
    """

    position: Array
    velocity: Array
    acceleration: Array

    def __post_init__(self) -> None:
        shape = np.shape(self.position)
        if len(shape) != 2 or shape[0] < 2:
            raise InputError("reference", "position", "shape (N, n) with N >= 2", shape)
        for field in ("position", "velocity", "acceleration"):
            values = np.array(getattr(self, field), dtype=np.float64)
            if values.shape != shape:
                raise InputError("reference", field, f"shape {shape}, as position", values.shape)
            if not np.isfinite(values).all():
                sample, joint = np.argwhere(~np.isfinite(values))[0]
                got = f"{values[sample, joint]} at sample {sample}, joint {joint + 1}"
                raise InputError("reference", field, "finite values", got)
            object.__setattr__(self, field, values)

    @property
    def samples(self) -> int:
        """Number of samples, N."""
        return len(self.position)

    @property
    def joints(self) -> int:
        """Number of joints, n."""
        return self.position.shape[1]


def sample_reference(trajectory: Trajectory, rate: float, periods: int = 1) -> Reference:
    """``periods`` repetitions of a trajectory at ``rate`` Hz, first and last instant included.

    Raises InputError for a rate or a number of periods that is not positive, and for too many samples.
    """
    if not (np.isfinite(rate) and rate > 0):
        raise InputError("reference", "rate", "a positive rate in Hz", rate)
    if periods < 1:
        raise InputError("reference", "periods", "at least 1", periods)
    samples = trajectory.duration * periods * rate
    if not samples <= MOST_SAMPLES:
        got = f"{trajectory.duration:.4g} s x {periods} at {rate:g} Hz"
        raise InputError("reference", "samples", f"at most {MOST_SAMPLES}", got)
    time = np.arange(round(samples) + 1) / rate
    return Reference(*trajectory.evaluate(time))
