"""The job behind ``excite``: a model in, a designed motion out."""

from pathlib import Path

from rich.table import Table

from identification.errors import InputError
from identification.excitation.design import DesignOptions, DesignProgress, design_excitation
from identification.excitation.excitation import Excitation

from .clearance import robot_clearance
from .excitation_file import write_excitation
from .files import require_writable
from .progress import Step, steps
from .robot import Robot, load_robot
from .terminal import console

# Collision geoms are snug: what lies between them and the exterior, and the tracking error.
CLEARANCE = 0.03


def excite_model(
    model: Path, out: Path, criterion: str, options: DesignOptions, jobs: int | None
) -> Excitation:
    """Design an excitation for a model, write it to ``out`` as JSON and print its criteria.

    Raises InputError.
    """
    require_writable(out, model)
    robot = load_robot(model)
    with steps() as progress, progress.step("design") as step:
        excitation = design(robot, criterion, options, jobs, step)
    write_excitation(excitation, out)
    _print(excitation)
    return excitation


def design(robot: Robot, criterion: str, options: DesignOptions, jobs: int | None, step: Step) -> Excitation:
    """The best motion found, clear of the robot itself and the floor. Raises InputError."""
    done: dict[int, int] = {}

    def report(now: DesignProgress) -> None:
        done[now.start] = now.iteration
        step.update(sum(done.values()), now.starts * now.iterations, f"{criterion} {now.value:.2f}")

    try:
        return design_excitation(
            robot.chain,
            robot.parameters,
            robot.limits,
            criterion,
            options,
            robot_clearance(robot, CLEARANCE),
            report,
            jobs,
        )
    except InputError as error:
        # The limits are the model's; all else is told of the options.
        raise error.located(robot.path) if error.source == "limits" else error from None


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
