"""How one run differs from the others: it carries a tool, or has other offsets or other friction."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from testbench.effects.signature import Quantity

Array = NDArray[np.float64]

PAYLOAD, OFFSETS, FRICTION = "payload", "offsets", "friction"


@dataclass(frozen=True)
class Difference:
    """A payload, torque offsets, or friction, that one run has and others have not.

    run: its name. kind: PAYLOAD, OFFSETS or FRICTION. mass: kg, of a payload. offsets: (n,)
    N·m, zero but of OFFSETS. friction: (2, n) N·m·s/rad and N·m, viscous and Coulomb beyond that of the
    others; of FRICTION. gains, deviations: (n,) of the drives by a payload of known mass, relative,
    true = (1 + gain) reported.
    """

    run: str
    kind: str
    mass: Quantity | None
    offsets: Array
    gains: Array | None = None
    friction: Array | None = None
    deviations: Array | None = None
