"""Columns without names: blocks of one column a joint, in the order in which people write them."""

import numpy as np
from numpy.typing import NDArray

from identification.errors import InputError

from ..joints import Joints
from ..table import Column, Table
from .groups import Group, Member
from .plausible import MOVES

Array = NDArray[np.float64]

# A block goes with the derivative of the positions, or with them, so well.
DERIVATIVE, SAME = 0.8, 0.99
# Further off than this share of the joints' range of motion, a block is not their commanded position.
NEAR = 0.5


def unnamed_groups(table: Table, joints: Joints, time: str | None) -> list[Group]:
    """The blocks of a table whose columns have no names. time: the column of time stamps, if there is one.

    The first block is the positions; one that goes with their derivative, velocities; one that follows them,
    references; the first of the others, torques. Raises InputError where the columns are no whole blocks.
    """
    columns = [column for column in table.columns() if column.name != time]
    count = len(joints.names)
    if not columns or len(columns) % count:
        expected = f"columns with names, or {count} a quantity (the model's joints) in the order of the model"
        raise InputError(
            table.path, "columns", f"{expected}; or a map", f"{len(columns)} columns without names"
        )
    blocks = [columns[at : at + count] for at in range(0, len(columns), count)]
    values = [np.column_stack([column.values for column in block]).astype(np.float64) for block in blocks]
    found = [_group(blocks[0], "position", "the first columns without a name, in the joints' order")]
    taken = {"position"}
    for block, own in zip(blocks[1:], values[1:], strict=True):
        quantity, why = _quantity(own, values[0], taken)
        taken.add(quantity)
        found.append(_group(block, quantity, why))
    return found


def _group(block: list[Column], quantity: str, why: str) -> Group:
    members = tuple(Member(column, None, index) for index, column in enumerate(block, 1))
    return Group("", (), "", quantity, why, members)


def _quantity(own: Array, position: Array, taken: set[str]) -> tuple[str, str]:
    moving = np.flatnonzero(np.ptp(position, axis=0) > MOVES)
    steps = np.gradient(position, axis=0)
    if len(moving):
        apart = np.abs(own - position)[:, moving].mean() / np.ptp(position, axis=0)[moving].mean()
        if "reference_position" not in taken and _goes_with(own, position, moving) > SAME and apart < NEAR:
            return "reference_position", "follows the positions"
        if "velocity" not in taken and _goes_with(own, steps, moving) > DERIVATIVE:
            return "velocity", "goes with the derivative of the positions"
    if "torque" not in taken:
        return "torque", "neither positions nor their derivative"
    return "", "a block that is not recognised"


def _goes_with(one: Array, other: Array, moving: NDArray[np.int64]) -> float:
    with np.errstate(invalid="ignore", divide="ignore"):
        each = [np.corrcoef(one[:, joint], other[:, joint])[0, 1] for joint in moving]
    return float(np.nan_to_num(np.median(each)))
