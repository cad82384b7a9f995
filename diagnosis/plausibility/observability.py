"""Effects that would not show in these runs, even where they were severe."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from testbench.effects import effect
from testbench.effects.size import typical_range
from testbench.robot import Robot

from ..fit.likelihood import Weighed
from ..model.candidate import Candidate
from ..model.effect_sizes import size
from .materiality import SMALLEST_WALD

Array = NDArray[np.float64]

# How straight a size must be in the coefficients, up to a severe one, for it to be known from a small one.
STRAIGHT = 0.2


def not_observable(robot: Robot, weighed: Sequence[Weighed]) -> tuple[tuple[str, int | None], ...]:
    """(effect, joint) of what is below the noise of these runs at the severe end of its typical range.

    weighed: the best member of every family that was not accepted, at the last stage. Only effects whose size
    goes with their coefficients are judged: of the others a small one says nothing about a severe one.
    """
    found = []
    for each in weighed:
        coefficients = _severe(robot, each.candidate)
        if coefficients is not None and coefficients @ each.gain.information @ coefficients < SMALLEST_WALD:
            found.append((each.candidate.family.effect, each.candidate.family.joint))
    return tuple(found)


def _severe(robot: Robot, candidate: Candidate) -> Array | None:
    """Coefficients (k,) of the effect at the severe end; None where a size does not go with them."""
    family, member = candidate.family, candidate.member
    description = effect(family.effect).DESCRIPTION
    known = {p.name: p for p in description.parameters}
    name = description.size_names[0]
    mild, severe = typical_range(known[name], robot, family.joint)
    if not 0 < mild < severe:
        return None
    unit = np.clip(np.ones(candidate.count), member.lower, member.upper)

    # By its range alone, however much torque these runs need.
    torque_scale = np.zeros(robot.joints)

    def sized(factor: float) -> float:
        return size(robot, torque_scale, candidate, factor * unit) * mild / severe

    factor, least_off = 1.0, np.inf
    while True:
        reached = sized(factor)
        if not (np.isfinite(reached) and reached > 0):
            return None
        off = abs(np.log(reached))
        # To rounding, or never nearer: no size that goes with the coefficients.
        if off >= least_off:
            break
        factor, least_off = factor / reached, off
    straight = abs(reached - 1) < STRAIGHT and abs(sized(factor / 2) - 0.5) < STRAIGHT / 2
    return factor * unit if straight else None
