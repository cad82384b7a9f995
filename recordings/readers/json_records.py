"""JSON: one object a line, a list of objects, BAM's ``entries``, or one object of equally long lists."""

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from identification.errors import InputError

from ..table import Channel, Stream, Table
from . import Format

FORMAT = Format("json", "JSON or JSON lines (.json, .jsonl)", (".json", ".jsonl", ".ndjson"), order=2)
# Lists of samples that a file of one object may keep them in.
ENTRIES = ("entries", "samples", "data", "records", "frames")
# Fewer values in a row are no recording.
FEWEST = 10
# Deeper than a sample's fields go.
DEEPEST = 6


def recognises(path: Path, head: bytes) -> bool:
    """Whether a file is named as JSON, or opens like it."""
    return path.suffix.lower() in FORMAT.suffixes and head.lstrip(b"\xef\xbb\xbf \t\r\n")[:1] in (b"{", b"[")


def read(path: Path) -> list[Table]:
    """The one run of a file. Raises InputError."""
    facts: dict[str, Any] = {}
    try:
        with path.open(encoding="utf-8-sig") as file:
            first = file.readline()
            records, facts = (
                _lines(path, first, file) if _is_object(first) else _document(first + file.read())
            )
    except (json.JSONDecodeError, UnicodeDecodeError, RecursionError) as error:
        raise InputError(path, "log", "JSON", str(error)) from None
    channels, left_out = _channels(path, records)
    return [Table(path, FORMAT.name, (Stream("", channels),), facts=facts, left_out=left_out)]


def _is_object(line: str) -> bool:
    """Whether a line is a JSON object by itself."""
    try:
        return isinstance(json.loads(line), dict)
    except (json.JSONDecodeError, RecursionError):
        return False


def _lines(path: Path, first: str, rest: Iterable[str]) -> tuple[dict[str, list[Any]], dict[str, Any]]:
    """The fields of one object a line, and no facts; a last line that is cut off does not count."""
    lone = json.loads(first)
    gathered = _Gathered()
    cut: int | None = None
    gathered.add(lone)
    for number, line in enumerate(rest, 2):
        if not line.strip():
            continue
        if cut is not None:
            raise InputError(path, f"line {cut}", "a JSON object", "something else")
        try:
            record = json.loads(line)
        except json.JSONDecodeError:
            cut = number
            continue
        if not isinstance(record, dict):
            raise InputError(path, f"line {number}", "a JSON object", type(record).__name__)
        gathered.add(record)
    if gathered.count == 1:
        return _of_object(lone)
    return gathered.fields, {}


def _document(text: str) -> tuple[dict[str, list[Any]], dict[str, Any]]:
    """The fields of one JSON document, and its single values."""
    content = json.loads(text)
    if isinstance(content, list):
        return _of_records(content), {}
    return _of_object(content if isinstance(content, dict) else {})


def _of_object(content: Mapping[str, Any]) -> tuple[dict[str, list[Any]], dict[str, Any]]:
    """The fields of an object that holds a list of samples or a list a field, and its single values."""
    facts = {key: value for key, value in content.items() if isinstance(value, int | float | str)}
    for key in ENTRIES:
        entries = content.get(key)
        if isinstance(entries, list) and entries and isinstance(entries[0], dict):
            return _of_records(entries), facts
        if isinstance(entries, dict):
            content = entries
    return {key: value for key, value in content.items() if isinstance(value, list)}, facts


def _of_records(records: list[Any]) -> dict[str, list[Any]]:
    gathered = _Gathered()
    for record in records:
        gathered.add(record if isinstance(record, dict) else {})
    return gathered.fields


class _Gathered:
    """Fields of objects, one list a field; None where an object lacks one."""

    def __init__(self) -> None:
        self.fields: dict[str, list[Any]] = {}
        self.count = 0

    def add(self, record: Mapping[str, Any]) -> None:
        for name, value in _flat("", record, 0):
            self.fields.setdefault(name, [None] * self.count).append(value)
        self.count += 1
        for values in self.fields.values():
            if len(values) < self.count:
                values.append(None)


def _flat(prefix: str, record: Mapping[str, Any], depth: int) -> Iterable[tuple[str, Any]]:
    for key, value in record.items():
        name = f"{prefix}{key}"
        if isinstance(value, dict) and depth < DEEPEST:
            yield from _flat(f"{name}.", value, depth + 1)
        else:
            yield name, value


def _channels(path: Path, fields: Mapping[str, list[Any]]) -> tuple[tuple[Channel, ...], tuple[str, ...]]:
    """Fields of numbers, or of lists of numbers, as channels; what is neither in words."""
    lengths = [len(values) for values in fields.values()]
    samples = max(lengths, key=lambda length: (lengths.count(length), length), default=0)
    channels, left_out = [], []
    for name, values in fields.items():
        if len(values) != samples:
            left_out.append(f"{name}: {len(values)} values where there are {samples} samples")
            continue
        columns = _columns(values)
        if columns is None:
            left_out.append(f"{name}: not numbers")
        else:
            channels.append(Channel(name, columns))
    if samples < FEWEST or not channels:
        raise InputError(
            path, "log", "a recording: an object of numbers a sample", "a document of no samples"
        )
    return tuple(channels), tuple(left_out)


def _columns(values: list[Any]) -> np.ndarray[Any, Any] | None:
    """Values as (N, k) numbers, NaN where there is none; None where they are none."""
    width = max((len(value) for value in values if isinstance(value, list)), default=0)
    if not width and all(isinstance(value, int) and not isinstance(value, bool) for value in values):
        try:
            return np.array(values, dtype=np.int64)[:, np.newaxis]
        except OverflowError:
            return None
    empty = [np.nan] * max(width, 1)
    rows = [empty if value is None else value if isinstance(value, list) else [value] for value in values]
    if any(len(row) != len(empty) for row in rows):
        return None
    try:
        return np.array([[np.nan if cell is None else float(cell) for cell in row] for row in rows])
    except (TypeError, ValueError, OverflowError):
        return None
