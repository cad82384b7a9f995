"""How a log may count otherwise than the model: order, signs, zeros, scale, gravity that is not in it."""

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from identification.chain import Chain

from .samples import Samples

Array = NDArray[np.float64]
Order = tuple[int, ...]


@dataclass(frozen=True)
class Convention:
    """Mapping of a log's columns to the model's n joints: order, signs, zeros, scale, gravity.

    position_order, torque_order: the log's column of each joint. position_sign, torque_sign: n of 1 or -1.
    zero: n rad (m), by how much a joint's position is larger in the log than in the model. scale: n factors
    of logged torque to the model's. gravity: (3,) m/s² as the torque has it; None for the model's.
    """

    position_order: Order
    torque_order: Order
    position_sign: tuple[float, ...]
    torque_sign: tuple[float, ...]
    zero: tuple[float, ...]
    scale: tuple[float, ...]
    gravity: tuple[float, float, float] | None = None

    def with_value(self, field: str, joint: int, value: float) -> "Convention":
        """The same with another value of one joint in one field."""
        values = list(getattr(self, field))
        values[joint] = value
        return replace(self, **{field: tuple(values)})

    def turned(self, field: str, joint: int) -> "Convention":
        """The same with one sign turned."""
        return self.with_value(field, joint, -getattr(self, field)[joint])


def as_modelled(joints: int) -> Convention:
    """The convention of the model itself."""
    order, ones = tuple(range(joints)), (1.0,) * joints
    return Convention(order, order, ones, ones, (0.0,) * joints, ones)


def read_by(samples: Samples, convention: Convention) -> Samples:
    """The samples as the model counts, if the log counts by this convention."""
    positions, torques = list(convention.position_order), list(convention.torque_order)
    sign = np.array(convention.position_sign)
    factor = np.array(convention.torque_sign) / np.array(convention.scale)
    return replace(
        samples,
        q=sign * samples.q[:, positions] - np.array(convention.zero),
        dq=sign * samples.dq[:, positions],
        ddq=sign * samples.ddq[:, positions],
        moves=samples.moves[:, positions],
        torque=factor * samples.torque[:, torques],
    )


def chain_of(chain: Chain, convention: Convention) -> Chain:
    """The model's chain as the torque feels gravity by this convention."""
    return chain if convention.gravity is None else replace(chain, gravity=np.array(convention.gravity))


def mistakes(convention: Convention) -> int:
    """In how many ways the log counts otherwise: swaps, signs, zeros, different scales, gravity."""
    n = len(convention.zero)
    positions, torques = convention.position_order, convention.torque_order
    # Both alike are columns under each other's names: one mistake.
    swaps = _swaps(positions) if positions == torques else _swaps(positions) + _swaps(torques)
    signs = set(zip(convention.position_sign, convention.torque_sign, strict=True))
    turned = sum(
        position < 0 or torque < 0
        for position, torque in zip(convention.position_sign, convention.torque_sign, strict=True)
    )
    if len(signs) == 1 and turned and n > 1:
        turned = 1
    scales = {factor for factor in convention.scale if factor != 1.0}
    zeros = sum(value != 0 for value in convention.zero)
    return swaps + turned + zeros + len(scales) + (convention.gravity is not None)


@cache
def cycles(order: Order) -> tuple[tuple[int, ...], ...]:
    """The joints whose columns are exchanged, a cycle each; empty for columns in order."""
    found, seen = [], set[int]()
    for start in range(len(order)):
        cycle, joint = [], start
        while joint not in seen:
            seen.add(joint)
            cycle.append(joint)
            joint = order[joint]
        if len(cycle) > 1:
            found.append(tuple(cycle))
    return tuple(found)


def _swaps(order: Order) -> int:
    return sum(len(cycle) - 1 for cycle in cycles(order))
