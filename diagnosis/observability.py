"""Which effects would not show in these runs, even where they were severe."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from testbench.effects import effect
from testbench.effects.size import typical_range
from testbench.robot import Robot

from .likelihood import Weighed
from .materiality import SIZES, size

Array = NDArray[np.float64]

# Squared signal over noise that it takes to tell an effect from none, and how straight a size must be in the
# coefficients for a severe one to be known from a small one.
DETECTABLE = 15.0
STRAIGHT = 1e-6


def not_observable(
    robot: Robot, torque_scale: Array, weighed: Sequence[Weighed]
) -> tuple[tuple[str, int | None], ...]:
    """(effect, joint) of what is below the noise of these runs at the severe end of its typical range.

    weighed: the best member of every family that was not taken in, at the last stage. torque_scale: (n,)
    N·m. Only effects whose size is proportional to their coefficients are judged: of the others a small one
    says nothing about a severe one.
    """
    found = []
    for each in weighed:
        family, gain = each.candidate.family, each.gain
        unit = np.clip(
            np.ones(each.candidate.count), each.candidate.member.lower, each.candidate.member.upper
        )
        once, twice = (size(robot, torque_scale, each.candidate, factor * unit) for factor in (1.0, 2.0))
        if not (np.isfinite(once) and once > 0 and abs(twice - 2 * once) < STRAIGHT * once):
            continue
        name = SIZES.get(family.effect, (effect(family.effect).DESCRIPTION.parameters[0].name,))[0]
        parameters = {p.name: p for p in effect(family.effect).DESCRIPTION.parameters}
        mild, severe = typical_range(parameters[name], robot, family.joint)
        if not 0 < mild < severe:
            continue
        coefficients = severe / mild / once * unit
        if float(coefficients @ gain.information @ coefficients) < DETECTABLE:
            found.append((family.effect, family.joint))
    return tuple(found)
