"""Which effect at which joint of a limb: its runs fitted by each of the likeliest, one effect at a time."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.output_error.fit import Fit, Problem, fit
from identification.output_error.plant import Limb
from identification.output_error.servo_run import ServoRun

from .evidence import OF_GRID, Fitted, Verdicts, weigh
from .hypothesis import Place, grid, handed_over, places, with_effect
from .sizes import Sizes

Array = NDArray[np.float64]

# Candidates that are fitted in full, of those that promise as much log-likelihood.
SHORTLIST, PROMISE = 6, 1.0
# Probability from which an effect is taken in, and how many a limb may have.
ACCEPTED, MOST = 0.8, 3
# Weights of a candidate's residual are taken anew so often.
REWEIGHTINGS = 2
# Sizes about the best of the grid, for effects in whose size position is not smooth.
FINER = np.exp(np.linspace(-0.6, 0.6, 13))


@dataclass(frozen=True)
class Round:
    """A round of the contest: the limb as it was before, and what may be wrong with it beside."""

    base: Fitted
    verdicts: Verdicts


def contest(
    limb: Limb,
    base: Fit,
    runs: Sequence[ServoRun],
    sizes: Sizes,
    without: Sequence[str] = (),
    threads: int | None = None,
) -> list[Round]:
    """Rounds, each with the likeliest effect of the one before taken in, until none is likely."""
    rounds: list[Round] = []
    fitted = Fitted(None, base)
    while True:
        taken = {
            (each.verdicts.faults[0].fitted.place.effect.name, each.verdicts.faults[0].fitted.place.joint)
            for each in rounds
            if each.verdicts.faults[0].fitted.place is not None
        }
        verdicts = _weighed(limb, fitted, runs, sizes, without, taken, threads)
        rounds.append(Round(fitted, verdicts))
        best = verdicts.faults[0] if verdicts.faults else None
        if best is None or best.probability < ACCEPTED or len(rounds) > MOST:
            return rounds
        fitted = best.fitted


def _weighed(
    limb: Limb,
    base: Fitted,
    runs: Sequence[ServoRun],
    sizes: Sizes,
    without: Sequence[str],
    taken: set[tuple[str, int | None]],
    threads: int | None,
) -> Verdicts:
    """The verdicts on every effect at every joint that is not taken in already."""
    own = base.fit
    open_places = [
        each for each in places(runs[0].kd, without) if (each.effect.name, each.joint) not in taken
    ]
    problem = Problem(limb.chain, own.unknowns, runs, threads)
    weights = 1 / (np.maximum(own.residual_std, 1e-12) * np.sqrt(own.inflation))
    trials = [(place, size) for place in open_places for size in grid(place.effect)]
    handed = [handed_over(own.unknowns, own.values, place, sizes, size) for place, size in trials]
    tables = [
        with_effect(own.unknowns, place, sizes, size).table(values)
        for (place, size), values in zip(trials, handed, strict=True)
    ]
    costs, starts = problem.profile(
        own.values, weights, np.stack([own.values, *handed]), np.stack([own.table, *tables])
    )
    least, costs, starts = float(costs[0]) - PROMISE, costs[1:], starts[1:]
    # The best law and size of each effect at each joint.
    best: dict[tuple[str, int | None], int] = {}
    for index in np.argsort(costs, kind="stable"):
        place = trials[index][0]
        if costs[index] < least:
            best.setdefault((place.effect.name, place.joint), int(index))
    candidates = []
    for index in list(best.values())[:SHORTLIST]:
        place, size = trials[index]
        if place.effect.smooth:
            unknown = with_effect(own.unknowns, place, sizes)
            start = np.append(starts[index], size)
            found = fit(limb.chain, unknown, runs, start, threads, REWEIGHTINGS)
            candidates.append(Fitted(place, found, float(found.values[-1]), float(found.std[-1])))
        else:
            candidates.append(_of_steps(limb, own, runs, sizes, place, size, threads))
    count = len({(each.effect.name, each.joint) for each in open_places})
    return weigh(base, candidates, sizes, count)


def _of_steps(
    limb: Limb,
    own: Fit,
    runs: Sequence[ServoRun],
    sizes: Sizes,
    place: Place,
    size: float,
    threads: int | None,
) -> Fitted:
    """An effect in whose size position is not smooth, by a finer grid about a size."""
    effect, base = place.effect, own.unknowns
    for _ in range(2):
        unknown = with_effect(base, place, sizes, size)
        problem = Problem(limb.chain, unknown, runs, threads)
        weights = problem.weights(own.values)
        finer = np.clip(size * FINER, effect.smallest, effect.largest)
        tables = np.stack([with_effect(base, place, sizes, each).table(own.values) for each in finer])
        costs, starts = problem.profile(own.values, weights, np.tile(own.values, (len(finer), 1)), tables)
        index = int(np.argmin(costs))
        size = float(finer[index])
        unknown = with_effect(base, place, sizes, size)
        own = fit(limb.chain, unknown, runs, starts[index], threads, 1)
    return Fitted(place, own, size, OF_GRID * size)
