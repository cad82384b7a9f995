"""Findings of a diagnosis of position servos."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from testbench.drives.identified import IdentifiedDrives
from testbench.effects.signature import Quantity

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ServoFault:
    """An effect that is stated. joint: None for all joints of the limb, joints. parameters: by name.

    held_out_share: of the squared position error that re-identification leaves there on halves that were not
    fitted, what the effects take away. confusable_with: effects that these runs do not distinguish from it.
    """

    effect: str
    joint: str | None
    joints: tuple[str, ...]
    probability: float
    law: str
    parameters: dict[str, Quantity]
    confusable_with: tuple[str, ...]
    held_out_share: float


@dataclass(frozen=True)
class ServoCandidate:
    """An effect that was weighed. score: log of its Bayes factor against a robot in order."""

    effect: str
    joint: str | None
    probability: float
    score: float
    reason: str


@dataclass(frozen=True)
class ServoShare:
    """A joint's share of the position error that re-identification leaves, and when it is largest."""

    joint: str
    share: float
    regime: str
    gap_rms: float
    noise_rms: float


@dataclass(frozen=True)
class Experiment:
    """A motion to record next, in words."""

    why: str
    separates: tuple[str, ...]


@dataclass(frozen=True)
class ServoDiagnosis:
    """The diagnosis of a robot without measured torque.

    found: the corrected robot. runs: names. verdict: none, parameters, effect or unknown. effects and
    candidates: likeliest first. given, parameters, corrected, noise: (n,) rad (m) RMS on halves that were not
    fitted: by the model as given, re-identified, with the effects, and what the encoders' quanta leave.
    unknown: probability that something acts which is not in the catalogue, of the limb where it is highest.
    """

    found: IdentifiedDrives
    runs: tuple[str, ...]
    verdict: str
    effects: tuple[ServoFault, ...]
    candidates: tuple[ServoCandidate, ...]
    where: tuple[ServoShare, ...]
    given: Array
    parameters: Array
    corrected: Array
    noise: Array
    unknown: float
    experiment: Experiment | None
    notes: tuple[str, ...]

    @property
    def closed(self) -> float | None:
        """Share that effects take of what re-identification leaves above the noise; None for no effect."""
        room = float(np.sum(self.parameters) - np.sum(self.noise))
        if not self.effects or room <= 0:
            return None
        return float(np.sum(self.parameters) - np.sum(self.corrected)) / room
