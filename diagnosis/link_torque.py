"""Torque and motion of all runs against the links of the model as given, whatever its friction and rotors."""

import numpy as np
from numpy.typing import NDArray

from identification.inverse_dynamics import inverse_dynamics
from identification.parameters import without_friction

from .preparation import Prepared

Array = NDArray[np.float64]

# Samples that are looked at, evenly spread over all runs.
MOST = 800


class LinkTorque:
    """Torque and motion of all runs, thinned. Friction, rotor and offset of each joint are projected out."""

    def __init__(self, prepared: Prepared):
        every = prepared.evenly(MOST)
        self.torque, self.q, self.dq, self.ddq, used = prepared.thinned(
            every, "torque", "q", "dq", "ddq", "used"
        )
        self.chain = prepared.robot.chain.without_springs()
        self.links = without_friction(prepared.nominal)
        self.bases: list[tuple[Array, NDArray[np.bool_], float]] = []
        for joint, own in enumerate(used.T):
            speed = self.dq[own, joint]
            columns = np.column_stack([speed, np.sign(speed), self.ddq[own, joint], np.ones(own.sum())])
            size = float(np.sqrt(np.sum(self.torque[own, joint] ** 2)))
            if own.sum() > 2 * columns.shape[1] and size > 0:
                self.bases.append((np.linalg.qr(columns)[0], own, size))
            else:
                # Too few samples tell nothing.
                self.bases.append((np.zeros((0, 0)), np.zeros_like(own), 1.0))

    def model(self, q: Array) -> Array:
        """The model's torque (M, n) along the motion from other positions (M, n)."""
        return inverse_dynamics(self.chain, self.links, q, self.dq, self.ddq)

    def projected(self, torque: Array) -> list[Array]:
        """A torque (M, n), a joint each, as a share of its own, without what is projected out."""
        parts = []
        for (basis, own, size), column in zip(self.bases, torque.T, strict=True):
            part = column[own]
            parts.append((part - basis @ (basis.T @ part)) / size)
        return parts

    def left(self, torque: Array) -> Array:
        """Its mean square, (n,)."""
        return np.array([float(part @ part) for part in self.projected(torque)])
