"""Attributes and datasets of an open HDF5 file, each checked for what it must be."""

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from identification.errors import InputError

from .containment.reader import no_more_files

# Bytes that one dataset may hold as float64, and all that are read of a file.
MOST_OF_ONE, MOST_OF_ALL = 1 << 30, 3 << 29
# Elements of an attribute, and characters of a text, that are read.
MOST_OF_ATTRIBUTE, LONGEST_TEXT = 10_000, 1 << 20
# Links that lead to links.
MOST_LINKS = 16


@contextmanager
def opened(path: Path) -> Iterator[h5py.File]:
    """The file, open to be read; in the block no other file is opened, whatever this one asks for.

    Whatever h5py raises of a damaged file is an InputError. For ``contained``, which bounds the rest.
    """
    try:
        with h5py.File(path, "r") as file, no_more_files():
            yield file
    except (InputError, MemoryError):
        raise
    # A damaged file may have h5py raise anything.
    except Exception as error:
        got = f"{type(error).__name__}: {error}"
        raise InputError(path, "log", "an HDF5 file that is not damaged", got) from None


def write_hdf5(path: Path, fill: Callable[[h5py.File], None]) -> None:
    """Write what ``fill`` puts into an HDF5 file to a path. Raises OSError where the disk does not take it.

    The file is made in memory: of a disk that is full, libhdf5 ends the process.
    """
    with h5py.File(path.name, "w", driver="core", backing_store=False) as file:
        fill(file)
        file.flush()
        image = file.id.get_file_image()
    with path.open("wb") as written:
        written.write(image)
        written.flush()
        os.fsync(written.fileno())


class CheckedFile:
    """An open HDF5 file at ``path``; everything asked of it raises InputError where it is not as asked.

    An array of one element counts as that element: some writers make no other attributes.
    """

    def __init__(self, file: h5py.File, path: Path):
        self.file, self.path = file, path
        self._read = 0

    def has(self, name: str) -> bool:
        """Whether the file has something of that name. Raises InputError for what it does not hold itself."""
        return self._own(name) is not None

    def is_dataset(self, name: str) -> bool:
        """Whether that is a dataset."""
        return isinstance(self._own(name), h5py.Dataset)

    def group(self, name: str) -> h5py.Group:
        """A group."""
        found = self._own(name)
        if not isinstance(found, h5py.Group):
            raise InputError(self.path, name, "a group", "none" if found is None else "a dataset")
        return found

    def attribute(self, holder: h5py.Group, name: str) -> Any:
        """An attribute as h5py gives it."""
        if name not in holder.attrs:
            raise InputError(self.path, f"{holder.name.strip('/')} {name}", "an attribute", "none")
        attribute = holder.attrs.get_id(name)
        if int(np.prod(attribute.shape or (1,), dtype=np.float64)) > MOST_OF_ATTRIBUTE:
            got = f"shape {attribute.shape}"
            raise InputError(self.path, name, f"at most {MOST_OF_ATTRIBUTE} elements", got)
        return holder.attrs[name]

    def text(self, holder: h5py.Group, name: str) -> str:
        """An attribute that is one string."""
        value = single(self.attribute(holder, name))
        if not isinstance(value, (str, bytes)):
            raise InputError(self.path, name, "a string", repr(value))
        return self.decoded(value, name)

    def decoded(self, text: str | bytes, name: str) -> str:
        """A string, whichever way it was stored. Raises InputError for what is not UTF-8."""
        try:
            # h5py hands on bytes that are no UTF-8 as surrogates.
            plain = (text.encode("utf-8", "surrogateescape") if isinstance(text, str) else text).decode()
        except UnicodeError:
            raise InputError(self.path, name, "text in UTF-8", repr(text)[:80]) from None
        if len(plain) > LONGEST_TEXT:
            raise InputError(self.path, name, f"at most {LONGEST_TEXT} characters", len(plain))
        return plain

    def number(self, holder: h5py.Group, name: str, expected: str = "a number") -> float:
        """An attribute that is one real number."""
        value = single(self.attribute(holder, name))
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            raise InputError(self.path, name, expected, repr(value)[:80])
        return float(value)

    def dataset(self, name: str) -> h5py.Dataset:
        """A dataset that is stored in the file, whatever it holds."""
        found = self._own(name)
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
        self._count(dataset, name)
        return np.array(dataset, dtype=np.float64)

    def _count(self, dataset: h5py.Dataset, name: str) -> None:
        """Raise InputError where a dataset is larger than is read, and where its chunks are."""
        wide = max(dataset.dtype.itemsize, np.dtype(np.float64).itemsize)
        size = float(np.prod(dataset.shape, dtype=np.float64)) * wide
        chunk = float(np.prod(dataset.chunks or (0,), dtype=np.float64)) * wide
        self._read += int(min(size, 2.0 * MOST_OF_ALL))
        if max(size, chunk) > MOST_OF_ONE or self._read > MOST_OF_ALL:
            expected = f"at most {MOST_OF_ONE >> 20} MiB a dataset and {MOST_OF_ALL >> 20} MiB a log"
            raise InputError(self.path, name, expected, f"shape {dataset.shape}, chunks {dataset.chunks}")

    def units(self, name: str) -> tuple[str, ...]:
        """The attribute ``unit`` of a dataset: one string, or several."""
        dataset = self.dataset(name)
        if "unit" not in dataset.attrs:
            raise InputError(self.path, name, "an attribute 'unit'", "none")
        units = np.atleast_1d(self.attribute(dataset, "unit")).ravel().tolist()
        if not units or not all(isinstance(unit, (str, bytes)) for unit in units):
            raise InputError(self.path, name, "an attribute 'unit' of strings", repr(units)[:80])
        return tuple(self.decoded(unit, f"{name} unit") for unit in units)

    def _own(self, name: str) -> Any:
        """The group or dataset of that name, or None; InputError for what lies in another file.

        Asked of links before any is followed, and of a dataset before it is opened to be read.
        """
        place = self._resolved(name, MOST_LINKS)
        if place is None:
            return None
        found = self.file[place] if place else self.file
        if isinstance(found, h5py.Dataset):
            if found.external:
                self._refuse(name, f"in {', '.join(str(part[0]) for part in found.external)}")
            if found.is_virtual:
                self._refuse(name, "a virtual dataset, made of others")
        return found

    def _resolved(self, name: str, links: int) -> str | None:
        """The path of hard links alone that ``name`` leads to; None where there is nothing."""
        place = ""
        parts = [part for part in name.split("/") if part not in ("", ".")]
        for index, part in enumerate(parts):
            group = self.file[place] if place else self.file
            if not isinstance(group, h5py.Group):
                return None
            kind, target = _link(group, part)
            if kind is None:
                return None
            if kind == h5py.h5l.TYPE_EXTERNAL:
                self._refuse(name, f"a link to {target}")
            if kind == h5py.h5l.TYPE_SOFT:
                if links == 0:
                    raise InputError(self.path, name, "links that lead somewhere", "links in a circle")
                whole = target if target.startswith("/") else f"{place}/{target}"
                return self._resolved("/".join([whole, *parts[index + 1 :]]), links - 1)
            place = f"{place}/{part}"
        return place

    def _refuse(self, name: str, got: str) -> None:
        raise InputError(self.path, name, "data stored in this file itself", got)


def _link(group: h5py.Group, name: str) -> tuple[int | None, str]:
    """The kind of a link in a group, and where a soft or external one leads; it is not followed."""
    links, key = group.id.links, name.encode()
    if not links.exists(key):
        return None, ""
    kind = links.get_info(key).type
    if kind == h5py.h5l.TYPE_HARD:
        return kind, ""
    value = links.get_val(key)
    target = value if kind == h5py.h5l.TYPE_SOFT else b":".join(value)
    return kind, target.decode("utf-8", "replace")


def single(value: Any) -> Any:
    """A scalar, or the one element of an array, as a plain Python object; anything else as it is."""
    array = np.asarray(value)
    return array.item() if array.size == 1 else value
