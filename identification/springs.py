"""Springs of joints: the torque that a drive needs against them, as MuJoCo has it.

A row of ``springs`` is (a, b, c, rest): where x = q - rest, the spring pulls back with a x + b x² + c x³,
N·m/rad to N·m/rad³ (N/m to N/m³ for slides). It is known, and no parameter of the robot is in it.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .kinematics import kernel

Array = NDArray[np.float64]


def spring_torque(springs: Array, q: Array) -> Array:
    """What holds the joints (N, n) against their springs (n, 4), N·m (N for slides)."""
    a, b, c, rest = springs.T
    return pull(a, b, c, q - rest)


def spring_stiffness(springs: Array, q: Array) -> Array:
    """The derivative of ``spring_torque`` by each joint's own position, (N, n) N·m/rad."""
    a, b, c, rest = springs.T
    x = q - rest
    return a + x * (2 * b + 3 * c * x)


@kernel
def pull(a: Any, b: Any, c: Any, x: Any) -> Any:
    """The spring's polynomial at x."""
    return x * (a + x * (b + x * c))
