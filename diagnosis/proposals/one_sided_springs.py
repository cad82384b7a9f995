"""Springs that pull one way: a hose with slack or a bumper is near a cable, and not in the catalogue."""

from collections.abc import Iterator, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from testbench.effects.columns import on_one_joint
from testbench.effects.signature import Logged

from ..data.preparation import Prepared
from ..fit.likelihood import gained
from ..fit.score import Stage
from ..model.candidates import Candidate, without_law
from ..model.effect_sizes import SPRINGS
from ..model.gram import Bank
from ..plausibility.accepted import Accepted
from ..residual.unexplained import Unclaimed, share_left

Array = NDArray[np.float64]

# Per cent of a joint's positions beyond which such a spring may begin to pull.
BEGINNINGS = np.arange(5.0, 96.0, 10.0)
# Log-likelihood that it must gain beyond the catalogue's law: more than it gains by chance on cables and
# gravity springs, and far less than on slack hoses.
LIKELIER = 20.0
ONE_SIDED = "a spring that pulls one way"


def one_sided(first: Stage, last: Stage, accepted: Sequence[Accepted]) -> tuple[Unclaimed, ...]:
    """Joints where a spring that begins to pull at some position is far likelier than the reported one.

    first: re-identification, without effects. last: with all accepted effects.
    """
    found = []
    named = [a.candidate for a in accepted if a.named and a.candidate.family.effect in SPRINGS]
    for joint in sorted({each.family.joint for each in named if each.family.joint is not None}):
        apart = Stage.of(last.ground, [a.candidate for a in accepted if not _is_spring_of(a, joint)])
        own = [each for each in named if each.family.joint == joint]
        best, best_one_sided = (
            _most_gained(apart, each) for each in (own, [*_springs(last.prepared, joint)])
        )
        if best_one_sided > best + LIKELIER:
            found.append(Unclaimed(joint, ONE_SIDED, 1 - float(share_left(first, last)[joint])))
    return tuple(found)


def _most_gained(stage: Stage, springs: Sequence[Candidate]) -> float:
    """The log-likelihood that the best of these gains."""
    gains = stage.gains(Bank(stage.ground, springs))
    return max(-np.inf if gain is None else gained(stage, gain) for gain in gains)


def _is_spring_of(item: Accepted, joint: int) -> bool:
    """Whether it is a spring at this joint: two of them may make up for one that pulls one way."""
    return item.candidate.family.effect in SPRINGS and item.candidate.family.joint == joint


def _springs(prepared: Prepared, joint: int) -> Iterator[Candidate]:
    """Springs that pull beyond, or before, each of some positions."""
    logged = [run.logged for run in prepared.runs]
    positions = np.concatenate([run.q[:, joint] for run in logged])
    for begins in np.percentile(positions, BEGINNINGS).tolist():
        for side in (1.0, -1.0):
            columns = on_one_joint(logged, partial(_pull, joint, begins, side))
            yield without_law(prepared, "one-sided spring", joint, columns, np.zeros(1), {"begins": begins})


def _pull(joint: int, begins: float, side: float, run: Logged) -> Array:
    """How far a joint is beyond a position, or by side -1 before it, rad (m), (N, 1)."""
    return side * np.maximum(side * (run.q[:, [joint]] - begins), 0.0)
