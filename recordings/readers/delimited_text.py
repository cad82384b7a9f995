"""CSV and its kin: any separator, header or none, comment lines, decimal commas, lists in cells."""

import csv
import math
import re
from array import array
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from identification.errors import InputError

from ..table import UNNAMED, Channel, Stream, Table, distinct
from . import Format

FORMAT = Format("csv", "CSV or TSV (.csv, .tsv, .txt)", (".csv", ".tsv", ".txt", ".dat", ".log"), order=3)

SEPARATORS = (";", "\t", ",", "|")
COMMENTS = ("#", "%", "//")
# Lines that the layout is found from.
SAMPLE = 50
# A separator splits this share of them alike.
MOST = 0.8
DECIMAL_COMMA = re.compile(r"[+-]?\d+,\d+([eE][+-]?\d+)?")
# Whole numbers that are kept as such.
LARGEST, DIGITS = np.iinfo(np.int64).max, 19
EMPTY = ("", "null", "none", "na", "n/a", "-")
TRUTHS = {"true": 1.0, "false": 0.0}
# Names of joints that some recorders write beside the samples.
JOINT_LIST = "joint_list.txt"


@dataclass(frozen=True)
class Layout:
    """How a file is written. separator: empty for any blanks. names: of its columns; skipped: lines before
    data.
    """

    encoding: str
    separator: str
    decimal_comma: bool
    names: tuple[str, ...]
    skipped: int


def recognises(path: Path, head: bytes) -> bool:
    """Whether a file is named as one, and is text."""
    text = b"\0" not in head or head[:2] in (b"\xff\xfe", b"\xfe\xff")
    return path.suffix.lower() in FORMAT.suffixes and text


def read(path: Path) -> list[Table]:
    """The one run of a file. Raises InputError."""
    layout = _layout(path)
    columns = [_Cells(name) for name in layout.names]
    last: tuple[int, int] | None = None
    with path.open(encoding=layout.encoding, newline="") as file:
        for number, cells in _rows(file, layout):
            if last is not None:
                got = f"{last[1]} cells"
                raise InputError(path, f"line {last[0]}", f"{len(columns)} cells, as the other lines", got)
            if len(cells) != len(columns):
                # The last line of a logger that was stopped may be cut off.
                last = (number, len(cells))
                continue
            for column, cell in zip(columns, cells, strict=True):
                column.add(cell, number, layout.decimal_comma, path)
    left_out = [f"line {last[0]}: cut off"] if last is not None else []
    left_out += [f"{column.name}: text" for column in columns if column.is_text]
    joints = _joint_list(path)
    channels = []
    for column in columns:
        if not column.is_text and column.count:
            values = column.values()
            labels = joints if joints is not None and values.shape[1] == len(joints) > 1 else ()
            channels.append(Channel(column.name, values, labels))
    if not channels or len(channels[0].values) < 2:
        raise InputError(path, "log", "lines of numbers", "none")
    return [Table(path, FORMAT.name, (Stream("", tuple(channels)),), left_out=tuple(left_out))]


class _Cells:
    """The cells of one column: numbers, lists of numbers of one length, or text."""

    def __init__(self, name: str):
        self.name, self.width, self.count, self.is_text = name, 0, 0, False
        self._numbers, self._whole = array("d"), True
        self._integers: list[int] | None = []

    def add(self, cell: str, line: int, decimal_comma: bool, path: Path) -> None:
        """Take one cell. Raises InputError for text among numbers."""
        if self.is_text:
            return
        numbers = _numbers(cell, decimal_comma)
        if numbers is None:
            if self.count and not all(math.isnan(number) for number in self._numbers):
                expected = f"a number, as the lines before have under {self.name}"
                raise InputError(path, f"line {line}", expected, repr(cell[:40]))
            self.is_text = True
            return
        width = len(numbers)
        if self.count and width != self.width:
            if width == 1 and math.isnan(numbers[0]):
                numbers, width = numbers * self.width, self.width
            else:
                got = f"{width} numbers"
                raise InputError(path, f"line {line}", f"{self.width} numbers under {self.name}", got)
        self.width, self.count = width, self.count + 1
        self._numbers.extend(numbers)
        if self._integers is not None:
            # Time in nanoseconds has more digits than a float keeps.
            whole = cell.strip()
            if whole.isdecimal() and len(whole) <= DIGITS and int(whole) <= LARGEST:
                self._integers.append(int(whole))
            else:
                self._integers = None

    def values(self) -> np.ndarray:
        """The numbers, (N, width)."""
        if self._integers:
            return np.array(self._integers, dtype=np.int64)[:, np.newaxis]
        return np.frombuffer(self._numbers, dtype=np.float64).reshape(self.count, self.width)


def _numbers(cell: str, decimal_comma: bool) -> list[float] | None:
    """The numbers in a cell: one, or those of a list in brackets; NaN for none; None for text."""
    cell = cell.strip()
    if cell[:1] in ("[", "(") and cell[-1:] in ("]", ")"):
        try:
            return [float(part) for part in re.split(r"[\s,;]+", cell[1:-1].strip(" ,;"))]
        except ValueError:
            return None
    try:
        return [float(cell.replace(",", ".") if decimal_comma else cell)]
    except ValueError:
        lowered = cell.lower()
        return [math.nan] if lowered in EMPTY else [TRUTHS[lowered]] if lowered in TRUTHS else None


def _layout(path: Path) -> Layout:
    """The layout of a file, from its first lines. Raises InputError for a file without lines of data."""
    encoding = _encoding(path)
    comments: list[tuple[int, str]] = []
    data: list[tuple[int, str]] = []
    with path.open(encoding=encoding, newline="") as file:
        for number, line in enumerate(file):
            stripped = line.strip()
            if stripped.startswith(COMMENTS):
                comments.append((number, stripped))
            elif stripped:
                data.append((number, line.rstrip("\r\n")))
            if len(data) > SAMPLE:
                break
    if not data:
        raise InputError(path, "log", "lines of data", "none")
    separator = _separator([line for _, line in data])
    split = [_split(line, separator) for _, line in data]
    body = split[len(split) // 2]
    comma = separator != "," and sum(bool(DECIMAL_COMMA.fullmatch(cell.strip())) for cell in body) > 0
    first = next(
        (at for at, cells in enumerate(split) if len(cells) == len(body) and _is_data(cells, comma)), None
    )
    if first is None:
        raise InputError(path, "log", "lines of numbers", repr(data[0][1][:60]))
    heads = [cells for cells in split[:first] if len(cells) == len(body)]
    if not heads:
        # A header may stand in the last comment before the data.
        spoken = [text.lstrip("#%/ ") for number, text in comments if number < data[first][0]]
        heads = [cells for text in spoken[-1:] if len(cells := _split(text, separator)) == len(body)]
        heads = [cells for cells in heads if not _is_data(cells, comma)]
    names = _names(heads, len(body))
    return Layout(encoding, separator, comma, names, data[first][0])


def _encoding(path: Path) -> str:
    with path.open("rb") as file:
        head = file.read(1 << 16)
    if head[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return "utf-16"
    try:
        # A character that the end of what was read cuts in two is none that is wrong.
        head[: head.rfind(b"\n") + 1 or None].decode("utf-8-sig")
    except UnicodeDecodeError:
        return "latin-1"
    return "utf-8-sig"


def _separator(lines: list[str]) -> str:
    """The separator that splits the later lines into equally many cells, and the most; blanks otherwise."""
    later = lines[len(lines) // 2 :]
    best, most = "", 1
    for separator in SEPARATORS:
        counts = [len(_split(line, separator)) for line in later]
        usual = max(set(counts), key=counts.count)
        if counts.count(usual) > MOST * len(counts) and usual > most:
            # Commas within numbers do not separate where something else does.
            if separator == "," and best:
                continue
            best, most = separator, usual
    return best


def _split(line: str, separator: str) -> list[str]:
    if not separator:
        return line.split()
    return next(csv.reader([line], delimiter=separator, skipinitialspace=True), [])


def _is_data(cells: list[str], decimal_comma: bool) -> bool:
    """Whether most cells are numbers or lists: a header has none, text among data is rare."""
    numbers = [_numbers(cell, decimal_comma) for cell in cells]
    values = sum(
        found is not None and cell.strip().lower() not in EMPTY
        for found, cell in zip(numbers, cells, strict=True)
    )
    return values > 0 and 2 * values >= sum(cell.strip() != "" for cell in cells)


def _names(heads: list[list[str]], count: int) -> tuple[str, ...]:
    """Names of so many columns: of the header, with its units where a second line has them, or numbers."""
    if not heads:
        return tuple(f"{UNNAMED}{index + 1}" for index in range(count))
    names = [cell.strip() for cell in heads[0]]
    if len(heads) > 1:
        units = [cell.strip().strip("[]()") for cell in heads[1]]
        names = [f"{name} [{unit}]" if unit else name for name, unit in zip(names, units, strict=True)]
    # A data frame's index has no name.
    return tuple(distinct([name or "index" for name in names]))


def _rows(file: Iterator[str], layout: Layout) -> Iterator[tuple[int, list[str]]]:
    """Numbers, from 1, and cells of the lines of data."""
    lines = enumerate(file, 1)
    for number, line in lines:
        stripped = line.strip()
        if number <= layout.skipped or not stripped or stripped.startswith(COMMENTS):
            continue
        yield number, _split(line.rstrip("\r\n"), layout.separator)


def _joint_list(path: Path) -> tuple[str, ...] | None:
    """Names of the joints in the file beside that some recorders write, or None."""
    beside = path.parent / JOINT_LIST
    if not beside.is_file():
        return None
    return tuple(filter(None, (line.strip() for line in beside.read_text(encoding="utf-8").splitlines())))
