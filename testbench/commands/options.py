"""Options that several commands take."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from identification.errors import InputError


def at_least(lowest: int, option: str) -> Callable[[Any, Any], None]:
    """A cyclopts validator of an option's whole number. It raises InputError below the lowest."""

    def check(_: Any, value: Any) -> None:
        if value is not None and value < lowest:
            raise InputError("testbench", option, f"a whole number of at least {lowest}", value)

    return check


def at_least_one(option: str) -> Callable[[Any, Any], None]:
    """A cyclopts validator of an option's list. It raises InputError where the option has no value."""

    def check(_: Any, values: Any) -> None:
        if values is not None and not values:
            raise InputError("testbench", option, "at least one value", "none")

    return check


Jobs = Annotated[
    int | None,
    Parameter(help="worker threads; all cores when not given", validator=at_least(1, "--jobs")),
]
Processes = Annotated[
    int | None, Parameter(help="processes; all cores when not given", validator=at_least(1, "--jobs"))
]
Seed = Annotated[
    int, Parameter(help="seed of everything random; one seed, one result", validator=at_least(0, "--seed"))
]
ScenarioSeed = Annotated[
    int | None, Parameter(help="instead of the scenario's", validator=at_least(0, "--seed"))
]
Map = Annotated[
    Path | None,
    Parameter(help="mapping YAML of recordings that are no robot-logs; guessed when not given", name="--map"),
]
Model = Annotated[Path, Parameter(help="MJCF or URDF")]


@Parameter(name="*")
@dataclass(frozen=True)
class Chosen:
    """Which part of the model is the robot."""

    joints: Annotated[
        str | None,
        Parameter(help="that move, with commas; others are held still. The logs' by default"),
    ] = None
    fix_base: Annotated[bool, Parameter(help="hold a floating base", negative=())] = False
    package: Annotated[
        list[str] | None, Parameter(help="NAME=PATH of a ROS package; repeatable", negative=())
    ] = None

    def choice(self) -> Any:
        """The ``model_reading.reading.Choice`` of these options. Raises InputError."""
        from ..model_reading.packages import parse_packages
        from ..model_reading.reading import Choice

        names = None if self.joints is None else tuple(name.strip() for name in self.joints.split(","))
        return Choice(names, self.fix_base, parse_packages(tuple(self.package or ())))


# A default that cyclopts fills in where options are given.
AS_LOGGED = Chosen()


@Parameter(name="*")
@dataclass(frozen=True)
class Drives:
    """The drives of a robot whose torque was not measured."""

    drive: Annotated[
        str | None,
        Parameter(
            help="position_servo, or a YAML file that states it: no torque was measured, fit the position"
        ),
    ] = None
    kp: Annotated[
        list[float] | None,
        Parameter(
            help="of its servos, N·m/rad; one value, or one a joint", consume_multiple=True, negative=()
        ),
    ] = None
    kd: Annotated[
        list[float] | None,
        Parameter(help="of its servos, N·m·s/rad; likewise", consume_multiple=True, negative=()),
    ] = None
    gain_factor: Annotated[
        float | None, Parameter(help="N·m/rad for one unit of kp and kd, where they are the firmware's")
    ] = None
    gain_spread: Annotated[
        float | None, Parameter(help="relative standard deviation of the gains; 0.1 when not given")
    ] = None
    delay_range: Annotated[
        tuple[float, float] | None, Parameter(help="s, of the command; 0 0.1 when not given", negative=())
    ] = None
    torque_limit: Annotated[
        list[float] | None,
        Parameter(help="N·m of the drives; the model's when not given", consume_multiple=True, negative=()),
    ] = None

    def stated(self) -> Any:
        """The ``drives.stated.StatedDrive`` of these options, None where none is given. Raises InputError."""
        from ..drives.stated import read_stated, stated_by_options
        from ..log import POSITION_SERVO

        options = {
            "kp": _one_or_all(self.kp),
            "kd": _one_or_all(self.kd),
            "factor": self.gain_factor,
            "spread": self.gain_spread,
            "delay": self.delay_range,
            "limit": _one_or_all(self.torque_limit),
        }
        given = any(value is not None for value in options.values())
        if self.drive is None:
            if given:
                raise InputError(
                    "testbench", "--drive", f"{POSITION_SERVO} with the options of a drive", "none"
                )
            return None
        if self.drive == POSITION_SERVO:
            return stated_by_options(**options)
        if given:
            expected = "a drive's figures in its file or as options"
            raise InputError("testbench", "--drive", expected, f"both {self.drive} and options")
        return read_stated(Path(self.drive))


def _one_or_all(values: list[float] | None) -> float | tuple[float, ...] | None:
    return values[0] if values is not None and len(values) == 1 else None if values is None else tuple(values)


# A default that cyclopts fills in where options are given.
AS_STATED = Drives()
