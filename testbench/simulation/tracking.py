"""How closely a simulated run followed its reference, and whether its loop ran away."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.errors import InputError

from ..log import Recording

Array = NDArray[np.float64]

# Shares of a joint's range of motion: an error to warn of, and one of a robot that did not follow at all.
NOTABLE, LOST = 0.1, 1.0
# rad (m): the range of a joint that is to stand still.
STILL = 0.1
# Times the reference's peak speed.
RACING = 5.0
# Shares: of all samples at the torque limit, and of those that are followed by one at the opposite limit.
SATURATED, SWITCHING = 0.05, 0.1


@dataclass(frozen=True)
class Tracking:
    """A run against its reference, each (n,).

    error: largest, rad (m). range: of the reference, rad (m). speed: largest over the reference's largest, or
    what that would be over the range of a joint that stands still; inf where it does. saturated: share of
    samples at the torque limit. switching: share of those after which the torque goes to the opposite limit.
    """

    joint_names: tuple[str, ...]
    units: tuple[str, ...]
    error: Array
    range: Array
    speed: Array
    saturated: Array
    switching: Array

    @property
    def share(self) -> Array:
        """Error over range, (n,); a joint that is to stand still is given a small range."""
        return self.error / np.maximum(self.range, STILL)

    def warnings(self) -> tuple[str, ...]:
        """A line for each joint whose error exceeds a tenth of its motion's range."""
        return tuple(
            f"warning: {self._strays(joint)}" for joint in np.flatnonzero(self.share > NOTABLE).tolist()
        )

    def require_followed(self, source: object) -> None:
        """Raise InputError, naming ``source``, for a loop that ran away or whose torque chatters."""
        strays = self.share > NOTABLE
        saturated = self.saturated > SATURATED
        for failed, got in (
            (~np.isfinite(self.error) | (self.share > LOST), self._strays),
            (strays & (self.speed > RACING), self._races),
            (saturated & (strays | (self.switching > SWITCHING)), self._saturates),
        ):
            if failed.any():
                joint = int(np.argmax(np.where(failed, np.nan_to_num(self.share, nan=np.inf), -1.0)))
                expected = (
                    "a loop that follows its reference; try another bandwidth or controller, "
                    "rotor inertia (armature) in the model, or a slower motion"
                )
                raise InputError(source, "tracking", expected, got(joint))

    def _strays(self, joint: int) -> str:
        unit = self.units[joint]
        return (
            f"{self.joint_names[joint]} strays {self.error[joint]:.3g} {unit} from its reference, "
            f"whose range is {self.range[joint]:.3g} {unit}"
        )

    def _races(self, joint: int) -> str:
        return f"{self._strays(joint)}, at {self.speed[joint]:.3g} times its peak speed"

    def _saturates(self, joint: int) -> str:
        return f"{self._strays(joint)}, with its torque at the limit {self.saturated[joint]:.0%} of the time"


def tracking(recording: Recording, torque_limit: Array) -> Tracking:
    """The tracking of a simulated run; torque_limit: (n,) N·m (N), that clips the command."""
    reference, speed = recording.reference_position, recording.reference_velocity
    command = recording.torque_command
    if reference is None or speed is None or command is None:
        raise InputError("log", "reference", "a simulated run with its reference and command", "none")
    reached, commanded = (np.abs(v).max(axis=0) for v in (recording.truth["velocity"], speed))
    side = np.sign(command) * (np.abs(command) >= torque_limit * (1 - 1e-9))
    opposite = (side[1:] * side[:-1] < 0).sum(axis=0)
    span = np.ptp(reference, axis=0)
    # A motion of next to no range is not raced by what hardly moves either.
    commanded *= np.divide(np.maximum(span, STILL), span, out=np.ones(len(span)), where=span > 0)
    return Tracking(
        joint_names=recording.joint_names,
        units=tuple("m" if slide else "rad" for slide in recording.is_slide),
        error=np.abs(recording.position - reference).max(axis=0),
        range=span,
        speed=np.divide(reached, commanded, out=np.full(len(commanded), np.inf), where=commanded > 0),
        saturated=(side != 0).mean(axis=0),
        switching=opposite / np.maximum((side != 0).sum(axis=0), 1),
    )
