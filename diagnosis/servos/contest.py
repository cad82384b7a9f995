"""Which effect at which joint of a limb: its runs fitted by each of the likeliest, one effect at a time."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from identification.output_error.fit import Fit
from identification.output_error.frozen import frozen_fit
from identification.output_error.plant import Limb
from identification.output_error.problem import SMALLEST, Problem
from identification.output_error.servo_run import ServoRun
from identification.output_error.unknowns import Unknowns

from .evidence import Fitted, Verdicts, weigh
from .hypothesis import Place, finer_grid, grid, handed_over, places, with_effect
from .sizes import Sizes

Array = NDArray[np.float64]

# Candidates that are fitted, of those that promise as much log-likelihood.
SHORTLIST, PROMISE = 6, 1.0
# Probability from which an effect is taken in, and how many a limb may have.
ACCEPTED, MOST = 0.8, 3


@dataclass(frozen=True)
class Round:
    """A round of the contest: the limb as it was before, and what may be wrong with it beside."""

    base: Fitted
    verdicts: Verdicts


@dataclass(frozen=True)
class Contest:
    """A limb's runs, searched for effects. without: effects that are left out."""

    limb: Limb
    runs: Sequence[ServoRun]
    sizes: Sizes
    without: Sequence[str] = ()
    threads: int | None = None

    def rounds(self, base: Fit) -> list[Round]:
        """Rounds, each with the likeliest effect of the one before taken in, until none is likely."""
        out: list[Round] = []
        taken: set[tuple[str, int | None]] = set()
        fitted = Fitted(None, base)
        while True:
            problem = self._problem(fitted.fit.unknowns)
            derivatives, _ = problem.derivatives(fitted.fit.values, range(fitted.fit.unknowns.count))
            if out:
                # The derivatives are its own now.
                fitted = replace(fitted, fit=self._fit(fitted.fit.unknowns, fitted.fit.values, derivatives))
            verdicts = self._verdicts(fitted, derivatives, taken)
            out.append(Round(fitted, verdicts))
            best = verdicts.faults[0] if verdicts.faults else None
            if best is None or best.probability < ACCEPTED or len(out) > MOST:
                return out
            fitted = best.fitted
            taken.add(best.place.key)

    def _problem(self, unknown: Unknowns) -> Problem:
        return Problem(self.limb.chain, unknown, self.runs, self.threads)

    def _fit(self, unknown: Unknowns, start: Array, derivatives: Sequence[Array]) -> Fit:
        return frozen_fit(self.limb.chain, unknown, self.runs, start, derivatives, self.threads)

    def _verdicts(
        self, base: Fitted, derivatives: Sequence[Array], taken: set[tuple[str, int | None]]
    ) -> Verdicts:
        """The verdicts on every effect at every joint that is not taken in already."""
        own, sizes = base.fit, self.sizes
        open_places = [each for each in places(self.runs[0].kd, self.without) if each.key not in taken]
        weights = 1 / (np.maximum(own.residual_std, SMALLEST) * np.sqrt(own.inflation))
        trials = [(place, size) for place in open_places for size in grid(place.effect)]
        handed = [handed_over(own.unknowns, own.values, place, sizes, size) for place, size in trials]
        tables = [
            with_effect(own.unknowns, place, sizes, size).table(values)
            for (place, size), values in zip(trials, handed, strict=True)
        ]
        costs, starts = self._problem(own.unknowns).profile(
            weights, derivatives, np.stack([own.values, *handed]), np.stack([own.table, *tables])
        )
        least, costs, starts = float(costs[0]) - PROMISE, costs[1:], starts[1:]
        # The best law and size of each effect at each joint.
        best: dict[tuple[str, int | None], int] = {}
        for index in np.argsort(costs, kind="stable"):
            if costs[index] < least:
                best.setdefault(trials[index][0].key, int(index))
        candidates = [
            self._candidate(own, derivatives, *trials[index], handed[index], starts[index])
            for index in list(best.values())[:SHORTLIST]
        ]
        return weigh(base, candidates, sizes, len({each.key for each in open_places}))

    def _candidate(
        self,
        own: Fit,
        derivatives: Sequence[Array],
        place: Place,
        size: float,
        handed: Array,
        start: Array,
    ) -> Fitted:
        """A limb fitted with an effect, from a size of it and values of the other unknowns.

        handed: those values before the derivatives have moved them.
        """
        if place.effect.smooth:
            unknown = with_effect(own.unknowns, place, self.sizes)
            there = np.append(handed, size)
            if np.allclose(unknown.table(there), own.table, rtol=1e-9, atol=1e-12):
                # Along with other unknowns, it must be so to the last digit for its deviation to be right.
                added, _ = self._problem(unknown).derivatives(there, [unknown.count - 1])
                derivatives = [np.concatenate(each, axis=-1) for each in zip(derivatives, added, strict=True)]
            found = self._fit(unknown, np.append(start, size), derivatives)
            return Fitted(place, found, float(found.values[-1]), float(found.std[-1]))
        finer, deviation = finer_grid(place.effect, size)
        tables = np.stack([with_effect(own.unknowns, place, self.sizes, each).table(start) for each in finer])
        weights = self._problem(with_effect(own.unknowns, place, self.sizes, size)).weights(start)
        costs, starts = self._problem(own.unknowns).profile(
            weights, derivatives, np.tile(start, (len(finer), 1)), tables
        )
        index = int(np.argmin(costs))
        unknown = with_effect(own.unknowns, place, self.sizes, float(finer[index]))
        found = self._fit(unknown, starts[index], derivatives)
        return Fitted(place, found, float(finer[index]), deviation * float(finer[index]))
