"""Results of a diagnosis: verdict, reported effects, ranked candidates, and the gap before and after."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from recordings.checks.finding import Finding, barring
from testbench.effects import effect
from testbench.effects.columns import WindowedColumns
from testbench.effects.signature import Quantity
from testbench.robot import Robot

from ..data.run import Prepared
from ..fit.normal_equations import Fit, standard_values
from ..held_out.difference import Difference
from ..held_out.recurrence import Recurrence
from ..held_out.shrinkage import Kept
from ..model.candidate import Candidate, Place
from ..model.hypothesis import Design
from ..residual.shares import Share

Array = NDArray[np.float64]

# RMS errors of a gap, by the model that leaves them.
STAGES = ("nominal", "parameters", "effects")
VERDICTS = ("none", "parameters", "effect", "unknown")
# Re-identified parameters that leave less than this multiple of the noise floor leave little but noise; so do
# those that leave a bit more, since the floor is known to a third, of which no effect closes this share.
LITTLE_BUT_NOISE, PERHAPS_NOISE, LITTLE_CLOSED = 1.03, 1.3, 0.2


@dataclass(frozen=True)
class NamedEffect:
    """One effect that the diagnosis reports.

    effect: of the catalogue. joint, into: indices, None for the whole robot. probability: 0 to 1.
    parameters: by the contract's names. candidate: its columns. confusable_with: effects that these
    runs cannot distinguish from it. held_out_share: share of the joint's held-out squared residual that it
    removes.
    """

    effect: str
    joint: int | None
    into: int | None
    probability: float
    parameters: dict[str, Quantity]
    candidate: Candidate
    confusable_with: tuple[str, ...] = ()
    held_out_share: float = 0.0

    @property
    def place(self) -> Place:
        """Effect, joint and second joint."""
        return self.effect, self.joint, self.into

    @property
    def runs(self) -> tuple[int, ...]:
        """The run of each interval of an event, as its parameters list them; none of what lasts."""
        columns = self.candidate.member.columns
        if not isinstance(columns, WindowedColumns):
            return ()
        return tuple(run for run, windows in enumerate(columns.windows) for _ in windows)

    @property
    def law(self) -> str:
        """The law of the catalogue that was fitted."""
        return self.candidate.member.law or effect(self.effect).DESCRIPTION.laws[0]


@dataclass(frozen=True)
class RankedCandidate:
    """A family that was weighed: effect, place, probability, score (log-likelihood units) and why not."""

    effect: str
    joint: int | None
    into: int | None
    probability: float
    score: float
    reason: str = ""

    @property
    def place(self) -> Place:
        """Effect, joint and second joint."""
        return self.effect, self.joint, self.into


@dataclass(frozen=True)
class Gap:
    """RMS torque error a joint, (n,) N·m, on runs left out: as given, re-identified, with the effects.

    Of what was fitted, as far as it is kept: each is at most the one before it.
    noise_floor: what noise alone would leave. intervals: (3, 2, n) 90 % of the first three. unseen: (n,)
    joints whose torque was low-passed in the log, so that the floor is a bound. above: (n,) N·m (N), RMS of
    the logged torque above each joint's band, which no prediction has.
    """

    nominal: Array
    parameters: Array
    effects: Array
    noise_floor: Array
    intervals: Array
    unseen: NDArray[np.bool_]
    above: Array

    def over_all(self, in_band: Array) -> Array:
        """An error (n,) over all frequencies: what the band leaves and what is above it do not correlate."""
        return np.hypot(in_band, self.above)

    @property
    def closed(self) -> float | None:
        """(parameters - effects) / (parameters - noise floor), joints summed; None if nothing to close."""
        return self._closed(slice(None))

    @property
    def reported_closed(self) -> float | None:
        """The share that is closed; None where re-identified parameters leave little but noise."""
        closed, times = self.closed, np.sum(self.parameters) / max(float(np.sum(self.noise_floor)), 1e-300)
        if closed is None or times < LITTLE_BUT_NOISE:
            return None
        return None if closed < LITTLE_CLOSED and times < PERHAPS_NOISE else closed

    def closed_at(self, joint: int) -> float | None:
        """The same of one joint."""
        return self._closed(slice(joint, joint + 1))

    def _closed(self, joints: slice) -> float | None:
        parameters, effects, floor = (
            float(np.sum(each[joints])) for each in (self.parameters, self.effects, self.noise_floor)
        )
        reducible = parameters - floor
        if reducible <= 1e-9 * max(parameters, 1e-12):
            return None
        return (parameters - effects) / reducible


@dataclass(frozen=True)
class Diagnosis:
    """The whole answer.

    verdict: one of VERDICTS. sentence: it in words. effects: strongest first. ranked: what was
    weighed. where: shares of the gap, largest first. gap: before and after. prepared: the runs.
    parameters_only, final: (hypothesis, fit) after re-identification and with the effects.
    kept: how much of either the predictions and the model files have.
    not_observable: effects nothing of which would show.
    recurrence: the push as one that every run has. everywhere: effects fitted but not reported, as other
    joints are about as imperfect. one_sine: joints that follow one sine in each run. differences: payload,
    offsets or friction of some runs only, taken off before the fit. log_findings: of the checks of the logs.
    """

    robot: Robot
    verdict: str
    sentence: str
    effects: tuple[NamedEffect, ...]
    ranked: tuple[RankedCandidate, ...]
    where: tuple[Share, ...]
    gap: Gap
    prepared: Prepared
    parameters_only: tuple[Design, Fit]
    final: tuple[Design, Fit]
    kept: Kept
    not_observable: tuple[tuple[str, int | None], ...] = ()
    notes: tuple[str, ...] = field(default_factory=tuple)
    recurrence: Recurrence | None = None
    everywhere: tuple[tuple[str, int | None], ...] = ()
    one_sine: frozenset[int] = frozenset()
    differences: tuple[Difference, ...] = ()
    log_findings: tuple[Finding, ...] = ()

    @property
    def parameters(self) -> Array:
        """(14 n,) re-identified standard parameters of the final hypothesis."""
        return standard_values(self.prepared, self.final[1].values)

    @property
    def likeliest(self) -> tuple[RankedCandidate, ...]:
        """The ranked candidates, likeliest first; of equals the one of the higher score."""
        return tuple(sorted(self.ranked, key=lambda each: (-each.probability, -each.score)))

    @property
    def not_reported(self) -> tuple[RankedCandidate, ...]:
        """The same without those that are reported."""
        reported = {each.place for each in self.effects}
        return tuple(each for each in self.likeliest if each.place not in reported)

    @property
    def runs_by_gap(self) -> list[int]:
        """Indices of the runs, first that of which re-identification leaves most, by the joints' weights."""
        weights, residual = self.final[1].weights, self.parameters_only[1].residual
        return np.argsort([-np.mean(own**2 @ weights) for own in residual], kind="stable").tolist()

    def coefficients(self, named: NamedEffect) -> Array:
        """Coefficients (k,) of a reported effect's columns, as fitted."""
        hypothesis, fitted = self.final
        fits = zip(hypothesis.accepted, hypothesis.parts, strict=True)
        return next(fitted.values[part] for each, part in fits if each.member is named.candidate.member)

    def torque_of(self, named: NamedEffect) -> list[Array]:
        """Fitted torque of a reported effect, (M, n) N·m (N) a run."""
        coefficients = self.coefficients(named)
        return [columns @ coefficients for columns in named.candidate.columns]

    @property
    def run_names(self) -> tuple[str, ...]:
        """Names of the runs."""
        return tuple(run.name for run in self.prepared.runs)

    @property
    def barred(self) -> Finding | None:
        """The finding of the logs to be mended before any effect is named; None where there is none."""
        return barring(self.log_findings)

    @property
    def mended(self) -> dict[str, int]:
        """How many samples of each run were lost and are interpolated; runs of none are not in it."""
        return {run.name: run.lost for run in self.prepared.runs if run.lost}

    @property
    def too_little_motion(self) -> tuple[int, ...]:
        """The joints that move, but too little for an effect to be reported there, and where none is."""
        named = {joint for each in self.effects for joint in (each.joint, each.into)}
        others = named | self.prepared.silent | self.prepared.still
        return tuple(j for j in np.flatnonzero(~self.final[0].has_enough_samples).tolist() if j not in others)
