"""Attributes and datasets of an open HDF5 file, each checked for what it must be."""

from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from identification.errors import InputError


class CheckedFile:
    """An open HDF5 file at ``path``; everything asked of it raises InputError where it is not as asked.

    An array of one element counts as that element: some writers make no other attributes.
    """

    def __init__(self, file: h5py.File, path: Path):
        self.file, self.path = file, path

    def attribute(self, holder: h5py.Group, name: str) -> Any:
        """An attribute as h5py gives it."""
        if name not in holder.attrs:
            raise InputError(self.path, f"{holder.name.strip('/')} {name}", "an attribute", "none")
        return holder.attrs[name]

    def text(self, holder: h5py.Group, name: str) -> str:
        """An attribute that is one string."""
        value = single(self.attribute(holder, name))
        if not isinstance(value, (str, bytes)):
            raise InputError(self.path, name, "a string", repr(value))
        return decoded(value)

    def number(self, holder: h5py.Group, name: str, expected: str = "a number") -> float:
        """An attribute that is one real number."""
        value = single(self.attribute(holder, name))
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            raise InputError(self.path, name, expected, repr(value))
        return float(value)

    def dataset(self, name: str) -> h5py.Dataset:
        """A dataset, whatever it holds."""
        found = self.file.get(name)
        if not isinstance(found, h5py.Dataset):
            raise InputError(self.path, name, "a dataset", "none" if found is None else "a group")
        return found

    def numbers(self, name: str) -> NDArray[np.float64]:
        """A dataset of real numbers, as float64."""
        dataset = self.dataset(name)
        if h5py.check_string_dtype(dataset.dtype) is not None:
            raise InputError(self.path, name, "real numbers", "text")
        if dataset.dtype.kind not in "fiu":
            raise InputError(self.path, name, "real numbers", f"type {dataset.dtype}")
        if dataset.shape is None:
            raise InputError(self.path, name, "real numbers", "an empty dataset, of no shape")
        return np.array(dataset, dtype=np.float64)

    def units(self, name: str) -> tuple[str, ...]:
        """The attribute ``unit`` of a dataset: one string, or several."""
        dataset = self.dataset(name)
        if "unit" not in dataset.attrs:
            raise InputError(self.path, name, "an attribute 'unit'", "none")
        return tuple(decoded(unit) for unit in np.atleast_1d(dataset.attrs["unit"]).tolist())


def single(value: Any) -> Any:
    """A scalar, or the one element of an array, as a plain Python object; anything else as it is."""
    array = np.asarray(value)
    return array.item() if array.size == 1 else value


def decoded(text: Any) -> str:
    """A string of HDF5, whichever way it was stored."""
    return text.decode("utf-8", "replace") if isinstance(text, bytes) else str(text)
