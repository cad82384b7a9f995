"""Arrays out of the JSON form of a trajectory, checked."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError

Array = NDArray[np.float64]


def numbers(data: dict[str, Any], key: str, dimensions: int) -> Array:
    """data[key] as a finite float array of that many dimensions. Raises InputError."""
    expected = ("a number", "a list of numbers", "a list of rows of numbers")[dimensions]
    if key not in data:
        raise InputError("trajectory", key, expected, "nothing")
    try:
        values = np.array(data[key], dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError("trajectory", key, expected, repr(data[key])[:60]) from None
    if values.ndim != dimensions or not np.all(np.isfinite(values)):
        raise InputError("trajectory", key, f"{expected}, all finite", repr(data[key])[:60])
    return values


def positive(data: dict[str, Any], key: str, unit: str) -> float:
    """data[key] as a positive number. Raises InputError."""
    value = float(numbers(data, key, 0))
    if not value > 0:
        raise InputError("trajectory", key, f"a positive number of {unit}", value)
    return value


def rows(data: dict[str, Any], key: str, shape: tuple[int, int]) -> Array:
    """data[key] as an array of that shape. Raises InputError."""
    values = numbers(data, key, 2)
    if values.shape != shape or values.size == 0:
        raise InputError("trajectory", key, f"shape {shape}, neither of them 0", values.shape)
    return values
