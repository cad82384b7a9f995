"""The job behind ``import``: recordings in any format to robot-logs."""

from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.table import Table as Grid
from rich.text import Text

from identification.errors import InputError
from testbench.files import require_writable
from testbench.log import write_log
from testbench.model_reading.reading import Choice
from testbench.robot import load_robot

from .door import Door, Opened, in_short
from .joints import Joints, joints_of
from .mapping_file import OF_FOLDER, own_map, write_mapping

WIDTH = 110


def import_files(
    files: Sequence[Path],
    model: Path | None,
    map_path: Path | None,
    out: Path,
    choice: Choice | None = None,
) -> None:
    """Write a robot-log of each run in the files, and the mapping where it was guessed; say how each is read.

    out: a log for one run, a folder for several. choice: which of the model's joints were logged. Raises
    InputError; no log is written then, but where nothing says what the drives did the mapping is, so that it
    can be completed.
    """
    if not files:
        raise InputError("import", "FILE", "at least one recording", "none")
    joints = None
    if model is not None:
        robot = load_robot(model, choice)
        joints = joints_of(robot.chain, robot.limits)
    is_folder = len(files) > 1 or out.is_dir() or not out.suffix
    map_out = out / OF_FOLDER if is_folder else own_map(out)
    if map_path is None and map_out.is_file():
        # Corrected by hand, perhaps: it counts.
        map_path = map_out
    runs = _runs(files, joints, map_path)
    if len(runs) > 1 and not is_folder:
        raise InputError(out, "out", f"a folder for {len(runs)} runs", "a file")
    places = _places(runs, out) if is_folder else [out]
    for place in places:
        require_writable(place, *files)
    guessed = list({id(each.guess): each for each in runs if each.guess is not None}.values())
    for number, each in enumerate(guessed):
        assert each.guess is not None
        assert each.table is not None
        beside = map_out if number == 0 else own_map(places[runs.index(each)])
        require_writable(beside, *files)
        write_mapping(each.guess.mapping, each.guess.reasons, each.guess.left_out, each.table, beside)
        _show(each, beside)
    for each in runs:
        _require_drive(each, each.map or map_out)
    for place, each in zip(places, runs, strict=True):
        if each.map is not None:
            print(f"{each.path}: read by {each.map}")
        for note in each.notes:
            print(f"{each.path}: {note}")
        place.parent.mkdir(parents=True, exist_ok=True)
        write_log(each.recording, place)
        log = each.recording
        length = log.time[-1] - log.time[0]
        samples = f"{len(log.time)} samples of {len(log.joint_names)} joints"
        what = f"{samples}, {length:.4g} s at {log.sample_rate:.4g} Hz"
        print(f"{place}: {what}{'' if log.has_torque else '; without torque'}")


def _require_drive(each: Opened, map_path: Path) -> None:
    """Raise InputError, with what to do, for a recording in which nothing says what the drives did."""
    if not (each.recording.has_torque or each.recording.has_drive):
        asked = " but reference positions" if each.recording.reference_position is not None else ""
        gains = f"controller: {{kp: ..., kd: ...}} in {map_path}"
        expected = f"torque, current, duty or voltage, or a servo's gains ({gains})"
        raise InputError(each.path, "torque", expected, f"none{asked}")


def _runs(files: Sequence[Path], joints: Joints | None, map_path: Path | None) -> list[Opened]:
    door = Door(joints, map_path)
    return [run for path in files for run in door.runs(path)]


def _places(runs: Sequence[Opened], folder: Path) -> list[Path]:
    """A log's path for each run: of the recording's name, and its episode where a file has several."""
    names = []
    for each in runs:
        several = sum(other.path == each.path for other in runs) > 1
        episode = each.table.episode if each.table is not None else None
        names.append(f"{each.path.stem}_{episode:03d}" if several and episode is not None else each.path.stem)
    for name in names:
        if names.count(name) > 1:
            raise InputError(folder, "out", "files of different names, for a log each", f"{name} twice")
    return [folder / f"{name}.h5" for name in names]


def _show(each: Opened, map_path: Path) -> None:
    """Print a guessed mapping as a table with its reasons, and what it leaves out."""
    assert each.guess is not None
    mapping, reasons = each.guess.mapping, each.guess.reasons
    grid = Grid(title=f"{each.path.name}, as guessed; correct {map_path}", title_justify="left", box=None)
    for heading in ("signal", "columns", "unit", "reason"):
        grid.add_column(heading, overflow="fold")
    grid.add_row("time", Text(mapping.time.column or ""), mapping.time.unit, Text(reasons["time"]))
    for quantity, channel in mapping.channels.items():
        unit = channel.unit if isinstance(channel.unit, str) else ", ".join(channel.unit or ())
        grid.add_row(quantity, Text(in_short(channel.columns)), unit, Text(reasons.get(quantity, "")))
    console = Console(highlight=False)
    if not console.is_terminal:
        console.width = WIDTH
    console.print(grid)
    if each.guess.left_out:
        console.print(Text(f"left out: {'; '.join(each.guess.left_out)}"))
