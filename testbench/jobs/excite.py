"""The job behind ``excite``: a model in, a designed motion out."""

import math
from dataclasses import dataclass
from pathlib import Path

from rich.table import Table
from rich.text import Text

from identification.errors import InputError
from identification.excitation.design import DesignOptions, DesignProgress, design_excitation
from identification.excitation.excitation import Excitation
from identification.excitation.limits import JointLimits, require_usable, share_of
from identification.excitation.random_motion import CONFIGURATIONS, resting_centres

from ..clearance import RobotClearance, clearance_of
from ..design_limits import design_limits
from ..excitation_file import write_excitation
from ..files import require_writable
from ..model_reading.limits import Limits
from ..model_reading.reading import Choice
from ..progress import Step, steps
from ..robot import Robot, load_robot, print_notes
from ..terminal import console

# Collision geoms are snug: what lies between them and the exterior, and the tracking error.
CLEARANCE = 0.03
# m, the least by default.
SMALLEST_CLEARANCE = 2e-3
# Share of random configurations: where fewer are clear, the robot is wedged in and has no room to move.
ROOM = 0.01
PEAK_HEADINGS = ("joint", "speed", "limit", "acceleration", "limit", "torque", "limit", "unit")


@dataclass(frozen=True)
class DesignRoom:
    """The limits and the clearance that a design keeps, and sentences on what the model did not settle."""

    limits: Limits
    clearance: RobotClearance | None
    notes: tuple[str, ...]


def design_room(
    robot: Robot, limit_share: float, velocity_limit: float | None = None, clearance: float | None = None
) -> DesignRoom:
    """Limits and clearance of a robot's designs.

    limit_share: of the limits that a design uses. velocity_limit: of joints without a rated speed, rad/s
    (m/s). clearance: m; when None CLEARANCE, or a half, a quarter, ... of it, down to SMALLEST_CLEARANCE,
    where hardly any configuration of rest is so clear. Raises InputError.
    """
    found = design_limits(robot, velocity_limit)
    try:
        require_usable(robot.chain, found.limits)
    except InputError as error:
        raise error.located(robot.path) from None
    if clearance is not None:
        pairs, notes = clearance_of(robot, clearance)
        return DesignRoom(found.limits, pairs, found.assumed + notes)
    usable = share_of(found.limits, limit_share)
    distance = CLEARANCE
    while True:
        pairs, notes = clearance_of(robot, distance)
        if distance / 2 < SMALLEST_CLEARANCE or _has_room(robot, usable, pairs):
            break
        distance /= 2
    if distance < CLEARANCE:
        lowered = f"hardly ever clear by {CLEARANCE:g} m: parts are kept {distance:.2g} m apart (--clearance)"
        notes = (lowered, *notes)
    return DesignRoom(found.limits, pairs, found.assumed + notes)


def _has_room(robot: Robot, limits: JointLimits, clearance: RobotClearance | None) -> bool:
    """Whether clearance leaves configurations of rest; where torque forbids them, the design says so."""
    try:
        centres = resting_centres(robot.chain, robot.parameters, limits, clearance, 0)
    except InputError as error:
        return not error.field.startswith("clearance")
    return clearance is None or len(centres) >= ROOM * CONFIGURATIONS


def excite_model(
    model: Path,
    out: Path,
    criterion: str,
    options: DesignOptions,
    jobs: int | None,
    velocity_limit: float | None = None,
    clearance: float | None = None,
    choice: Choice | None = None,
) -> Excitation:
    """Design an excitation for a model, write it to ``out`` as JSON and print its criteria and peaks.

    velocity_limit, clearance: as for ``design_room``. choice: of the model. Raises InputError.
    """
    require_writable(out, model)
    robot = load_robot(model, choice)
    print_notes(robot)
    excitation, room = designed(robot, criterion, options, jobs, velocity_limit, clearance)
    write_excitation(excitation, out)
    _print(excitation)
    print_peaks(robot, excitation, room)
    return excitation


def designed(
    robot: Robot,
    criterion: str,
    options: DesignOptions,
    jobs: int | None = None,
    velocity_limit: float | None = None,
    clearance: float | None = None,
) -> tuple[Excitation, DesignRoom]:
    """The best motion found, and the limits and the clearance that it keeps, as of ``design_room``.

    jobs: threads. Raises InputError.
    """
    room = design_room(robot, options.limit_share, velocity_limit, clearance)
    with steps() as progress, progress.step("design") as step:
        return design(robot, room, criterion, options, jobs, step), room


def design(
    robot: Robot, room: DesignRoom, criterion: str, options: DesignOptions, jobs: int | None, step: Step
) -> Excitation:
    """The best motion found, clear of the robot itself and the floor. Raises InputError."""
    done: dict[int, int] = {}

    def report(now: DesignProgress) -> None:
        done[now.start] = now.iteration
        step.update(sum(done.values()), now.starts * now.iterations, f"{criterion} {now.value:.2f}")

    try:
        return design_excitation(
            robot.chain, robot.parameters, room.limits, criterion, options, room.clearance, report, jobs
        )
    except InputError as error:
        # The limits are the model's; all other errors name the options.
        raise error.located(robot.path) if error.source == "limits" else error from None


def print_peaks(robot: Robot, excitation: Excitation, room: DesignRoom) -> None:
    """Print what the model did not settle, and each joint's peaks beside their limits."""
    terminal = console()
    for note in room.notes:
        terminal.print(Text(note), soft_wrap=True)
    table = Table(box=None, pad_edge=False)
    for name in PEAK_HEADINGS:
        table.add_column(name, justify="left" if name in ("joint", "unit") else "right")
    for row in peak_rows(robot, excitation, room):
        table.add_row(*map(Text, row))
    terminal.print(table)


def peak_rows(robot: Robot, excitation: Excitation, room: DesignRoom) -> list[tuple[str, ...]]:
    """Each joint's peaks beside their limits, under PEAK_HEADINGS."""
    peaks, limits = excitation.margins.peaks, room.limits
    pairs = (
        (peaks.velocity, limits.velocity),
        (peaks.acceleration, limits.acceleration),
        (peaks.torque, limits.torque),
    )
    rows = []
    for joint, name in enumerate(robot.joint_names):
        length, force = ("m", "N") if robot.chain.is_slide[joint] else ("rad", "N·m")
        cells = [_figure(float(values[joint])) for pair in pairs for values in pair]
        rows.append((name, *cells, f"{length}/s, {length}/s², {force}"))
    return rows


def _figure(value: float) -> str:
    """A peak or a limit to three digits, a dash where there is none."""
    return f"{value:.3g}" if math.isfinite(value) else "–"


def _print(excitation: Excitation) -> None:
    values = excitation.values
    table = Table(box=None, pad_edge=False, show_header=False)
    for name, value in (
        ("Hadamard", f"{values.hadamard:.3f}"),
        ("-log det", f"{values.logdet:.3f}"),
        ("slack between them", f"{values.slack:.3f}"),
        ("condition number", f"{values.condition_number:.2f}"),
        ("limits kept", "yes" if excitation.margins.kept else "no"),
    ):
        table.add_row(name, value)
    console().print(table)
