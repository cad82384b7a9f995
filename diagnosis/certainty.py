"""How often a name is right: against its rivals, and by how well its joint is explained with it."""

import numpy as np

from .attribution import Attribution
from .findings import Gap

# How often an effect is the right one when nothing in the catalogue rivals it, counted on blind cases and on
# robots that others simulated (docs/blind.md, docs/other_robots.md): of the first that is named, and of those
# after it.
NAMED = (0.98, 0.93)
# Deviations are those of a model that holds. Where so many times its noise is left at a joint, it does not
# quite, and a size within so many deviations of none may stand for what is left. Nor does one run alone tell
# what another would.
LEFT, DEVIATIONS = 2.0, 20.0
DOUBTFUL = (0.8, 0.55)


def certainty(found: Attribution, gap: Gap) -> dict[int, float]:
    """The probability, 0 to 1, of each effect that has a name, by its place among those taken in.

    gap: with all effects, by joint.
    """
    named = [index for index, item in enumerate(found.accepted) if item.named]
    named.sort(key=lambda index: -found.accepted[index].score)
    probabilities = {}
    for place, index in enumerate(named):
        levels = DOUBTFUL if _is_doubtful(found, gap, index) else NAMED
        probabilities[index] = found.accepted[index].probability * levels[min(place, len(levels) - 1)]
    return probabilities


def _is_doubtful(found: Attribution, gap: Gap, index: int) -> bool:
    """Whether much is left at its joint, and little is known of its size; or there is one run alone."""
    if len(found.prepared.runs) == 1:
        return True
    joint = found.accepted[index].candidate.family.joint
    floor = np.maximum(gap.noise_floor, np.finfo(float).tiny)
    if joint is None:
        joint = int(np.argmax(gap.parameters / floor))
    own, fitted = found.hypothesis.parts[index], found.fitted
    size = fitted.values[own]
    squared = float(size @ np.linalg.pinv(fitted.covariance[own, own], hermitian=True) @ size)
    return bool(gap.effects[joint] > LEFT * floor[joint] and squared < DEVIATIONS**2)
