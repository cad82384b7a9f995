"""Files in any format as recordings: by the mapping that is given, that lies beside, or that is guessed."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from identification.errors import InputError
from testbench.log import Recording, read_log

from .convert import converted
from .guess import Guess, guess_mapping
from .joints import Joints
from .mapping import Mapping, read_mapping
from .mapping_file import map_beside
from .readers import reader_of, tables
from .readers.robot_log import FORMAT as ROBOT_LOG
from .table import Table


@dataclass(frozen=True)
class Opened:
    """One run. notes: what was done to it, in words. guess: of its mapping, or None where one was given.

    mapping: by which it was read, None for a robot-log as it is. map: the file that has it, or None.
    """

    path: Path
    recording: Recording
    notes: tuple[str, ...] = ()
    guess: Guess | None = None
    mapping: Mapping | None = None
    map: Path | None = None
    table: Table | None = None


class Door:
    """Opens the files of one job, all by one mapping where their columns are the same."""

    def __init__(self, joints: Joints | None, map_path: Path | None = None):
        self._joints, self._map_path = joints, map_path
        self._guesses: list[Guess] = []
        self._read: dict[Path, Mapping] = {}

    def log(self, path: Path, with_torque: bool = True) -> Opened:
        """The one run of a file; a robot-log as it is, whatever mapping there is for others. Raises
        InputError.

        with_torque: as of ``read_log``.
        """
        if reader_of(path).FORMAT is ROBOT_LOG:
            return Opened(path, read_log(path, with_torque=with_torque))
        runs = self.runs(path)
        if len(runs) > 1:
            expected = f"one run; testbench import {path} --out FOLDER makes a log of each"
            raise InputError(path, "log", expected, f"{len(runs)} runs")
        return runs[0]

    def runs(self, path: Path) -> list[Opened]:
        """Every run of a file, by a mapping. Raises InputError."""
        # What lies beside a robot-log is how it was made.
        is_robot_log = reader_of(path).FORMAT is ROBOT_LOG
        map_path = self._map_path or (None if is_robot_log else map_beside(path))
        found = tables(path)
        if map_path is None:
            return [self._guessed(table) for table in found]
        if map_path not in self._read:
            self._read[map_path] = read_mapping(map_path)
        mapping = self._read[map_path]
        if mapping.episode is not None:
            episodes = [str(table.episode) for table in found]
            found = [table for table in found if table.episode == mapping.episode]
            if not found:
                raise InputError(
                    path, "map: episode", "an episode of the file", mapping.episode, episodes[:12]
                )
        return [self._mapped(table, mapping, map_path) for table in found]

    def _mapped(self, table: Table, mapping: Mapping, map_path: Path) -> Opened:
        slides = self._slides(mapping, map_path)
        try:
            made = converted(table, mapping, slides)
        except InputError as error:
            # A unit that no joint of the model has is the map's fault.
            raise (error.located(map_path) if error.source == "map" else error) from None
        return Opened(table.path, made.recording, made.notes, None, mapping, map_path, table)

    def _slides(self, mapping: Mapping, map_path: Path) -> tuple[bool, ...]:
        """Which joints of a mapping slide. Raises InputError for a joint that the model lacks."""
        if self._joints is None:
            return (False,) * len(mapping.joints)
        slides = dict(zip(self._joints.names, self._joints.is_slide, strict=True))
        for name in mapping.joints:
            if name not in slides:
                raise InputError(map_path, "joints", "joints of the model", repr(name), self._joints.names)
        return tuple(slides[name] for name in mapping.joints)

    def _guessed(self, table: Table) -> Opened:
        for guess in self._guesses:
            if _has_columns(table, guess.mapping):
                break
        else:
            guess = guess_mapping(table, self._joints)
            self._guesses.append(guess)
        made = converted(table, guess.mapping, guess.is_slide)
        return Opened(table.path, made.recording, made.notes, guess, guess.mapping, None, table)


def _has_columns(table: Table, mapping: Mapping) -> bool:
    names = {column.name for column in table.columns()}
    times = {name for stream in table.streams for each in stream.channels for name in each.columns()}
    wanted = {name for channel in mapping.channels.values() for name in channel.columns}
    return wanted <= names and (mapping.time.column is None or mapping.time.column in times)


def is_guessed(path: Path, map_path: Path | None) -> bool:
    """Whether nothing says which column of a file is which. Raises InputError for a file of no format."""
    return reader_of(path).FORMAT is not ROBOT_LOG and (map_path or map_beside(path)) is None


def said(opened: Sequence[Opened], model: Path | None) -> list[str]:
    """Lines on what was guessed and done: two for each guess, one for each file with notes or a mapping."""
    lines: list[str] = []
    shown: list[int] = []
    for each in opened:
        if each.guess is not None and id(each.guess) not in shown:
            shown.append(id(each.guess))
            lines += _guess_lines(each, model)
        if each.map is not None:
            lines.append(f"{each.path}: read by {each.map}")
        lines += [f"{each.path}: {note}" for note in each.notes]
    return lines


def in_short(columns: Sequence[str]) -> str:
    """Columns by the name of their channel, or by the first and the last."""
    channels = {column.partition("[")[0] for column in columns}
    if len(channels) == 1 or len(columns) == 1:
        return min(channels)
    return f"{columns[0]} … {columns[-1]}"


def _guess_lines(each: Opened, model: Path | None) -> list[str]:
    assert each.guess is not None
    mapping = each.guess.mapping
    parts = [f"time {mapping.time.column} in {mapping.time.unit}"]
    for quantity, channel in mapping.channels.items():
        columns = in_short(channel.columns)
        units = (
            channel.unit if isinstance(channel.unit, str) else ", ".join(dict.fromkeys(channel.unit or ()))
        )
        parts.append(f"{quantity} {columns} in {units}")
    left_out = f"; {len(each.guess.left_out)} left out" if each.guess.left_out else ""
    given = f" --model {model}" if model is not None else ""
    return [
        f"{each.path}: guessed {', '.join(parts)}{left_out}",
        f"  wrong? testbench import {each.path}{given} --out {each.path.stem}.h5 says why and writes "
        f"{each.path.stem}.map.yaml; correct it, then --map {each.path.stem}.map.yaml",
    ]
