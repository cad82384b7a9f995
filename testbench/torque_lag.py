"""How a log has its torque late against its positions: by a time, or through the low-pass of a drive."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from identification.filtering import central_difference, zero_phase_lowpass

from .log import Recording, with_channels
from .sampling import interpolated

Array = NDArray[np.float64]

# Hz: what a low-pass has taken out is given back up to here; and as a share of the sample rate, at most.
GIVEN_BACK, OF_RATE = 60.0, 0.2


@dataclass(frozen=True)
class TorqueLag:
    """delay: s. order: of a Butterworth low-pass, 1 or 2, or 0 for none; time_constant: s, of its corner."""

    delay: float = 0.0
    order: int = 0
    time_constant: float = 0.0

    @property
    def seconds(self) -> float:
        """How late slow torque is, s."""
        return self.delay + self.weights[0]

    @property
    def corner(self) -> float:
        """Hz, of the low-pass; inf for none."""
        return 1 / (2 * np.pi * self.time_constant) if self.order else np.inf

    @property
    def weights(self) -> tuple[float, float]:
        """Of the first two derivatives of logged torque, s and s², which with it make the one that acted."""
        constant = self.time_constant
        return {0: (0.0, 0.0), 1: (constant, 0.0), 2: (np.sqrt(2) * constant, constant**2)}[self.order]

    def taken_back(self, recording: Recording) -> Recording:
        """The recording on a grid with its torque at the instants that it is of, as it acted.

        It ends so much earlier as its torque was delayed, as what acted then is not in it.
        """
        if self.order:
            smooth, first, second = with_derivatives(recording.torque, recording.sample_rate)
            acted = smooth + self.weights[0] * first + self.weights[1] * second
            recording = replace(recording, torque=acted)
        if self.delay == 0:
            return recording
        kept = recording.time <= recording.time[-1] - self.delay
        shorter = with_channels(recording, recording.time[kept], lambda _, own: own[kept])
        torque = interpolated(recording.time, recording.torque, shorter.time + self.delay, is_smooth=False)
        return replace(shorter, torque=torque)

    def put_on(self, torque: Array, sample_rate: float) -> Array:
        """Torque (N, n) as such a log would have it; held before its first sample."""
        if self.order:
            sections = signal.butter(self.order, self.corner, fs=sample_rate, output="sos")
            torque = signal.sosfilt(sections, torque - torque[0], axis=0) + torque[0]
        if self.delay == 0:
            return torque
        instants = np.arange(len(torque), dtype=np.float64)
        earlier = instants - self.delay * sample_rate
        return np.column_stack([np.interp(earlier, instants, column) for column in torque.T])


IN_TIME = TorqueLag()


def with_derivatives(torque: Array, sample_rate: float) -> tuple[Array, Array, Array]:
    """What of torque (N, n) is slow enough to be given back, and its first two time derivatives."""
    smooth = zero_phase_lowpass(torque, sample_rate, min(GIVEN_BACK, OF_RATE * sample_rate))
    first = central_difference(smooth, sample_rate)
    return smooth, first, central_difference(first, sample_rate)
