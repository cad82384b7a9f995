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
    """What of the model is the robot."""

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
