"""The catalogue of unmodelled effects: one effect a file, found by import.

An effect's file has ``DESCRIPTION`` and its three faces: ``action`` (how it acts in the simulated
robot), ``signature`` (how it shows along logged signals) and ``write`` (how it is put into an MJCF). Where
a fitted effect's size goes by more than its parameters, it has the functions of fitted_effect.py, too.
"""

import importlib
import math
import pkgutil
from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any, Protocol, cast

from identification.errors import InputError

from ..robot import Robot
from .action import Action, SimulatedRobot
from .base import EffectDescription, Injection, Scope
from .signature import Family, Logged
from .size import typical_values


class Effect(Protocol):
    """What an effect's file offers."""

    DESCRIPTION: EffectDescription

    def action(self, injection: Injection, simulated: SimulatedRobot) -> Action:
        """How it acts in the simulated robot."""
        ...

    def signature(self, runs: Sequence[Logged], joint: int | None, into: int | None) -> Family:
        """How it shows along logged runs."""
        ...

    def write(self, spec: Any, robot: Robot, injection: Injection) -> tuple[str, ...]:
        """Put it into an MjSpec; returns what MJCF cannot carry, in sentences."""
        ...


@cache
def effects() -> Mapping[str, Effect]:
    """Every effect by name, in alphabetical order."""
    names = sorted(module.name for module in pkgutil.iter_modules(__path__))
    modules = (importlib.import_module(f".{name}", __name__) for name in names)
    return {
        module.DESCRIPTION.name: cast(Effect, module) for module in modules if hasattr(module, "DESCRIPTION")
    }


def effect(name: str) -> Effect:
    """The effect of that name. Raises InputError with the valid names."""
    if name not in effects():
        raise InputError("effects", "effect", "the name of an effect", repr(name), effects())
    return effects()[name]


def injection(
    robot: Robot,
    name: str,
    joint: str | int | None = None,
    values: Mapping[str, float] | None = None,
    law: str | None = None,
    into: str | int | None = None,
) -> Injection:
    """A checked injection. Values that are not given are the middle of the typical range.

    What the law has not is left out. joint, into: a joint's name, or its number from 1. Raises InputError for
    what the robot or the effect does not have, and for values outside their bounds.
    """
    description = effect(name).DESCRIPTION
    first, second = _joint(robot, name, joint), _joint(robot, name, into)
    if description.scope is Scope.ROBOT:
        allowed = joint is None or description.or_of_one_joint
        _require(name, "joint", "none, it acts on the whole robot", joint, allowed)
    else:
        _require(name, "joint", "a joint", joint, first is not None, robot.joint_names)
        if description.hinges_only and first is not None and robot.chain.is_slide[first]:
            hinges = [
                each for each, slide in zip(robot.joint_names, robot.chain.is_slide, strict=True) if not slide
            ]
            _require(name, "joint", "a hinge", f"the slide {robot.joint_names[first]}", False, hinges)
    if description.scope is Scope.PAIR:
        _require(name, "into", "another joint", into, second not in (None, first), robot.joint_names)
    else:
        _require(name, "into", "nothing, it acts on no pair of joints", into, into is None)
    chosen = description.laws[0] if law is None else law
    _require(name, "law", "one of its laws", repr(chosen), chosen in description.laws, description.laws)
    known = {parameter.name: parameter for parameter in description.parameters}
    given = dict(values or {})
    for key, value in given.items():
        _require(name, key, "one of its parameters", key, key in known, known)
        bounds = known[key]
        inside = isinstance(value, (int, float)) and bounds.lower <= value <= bounds.upper
        _require(name, key, f"{bounds.lower:g} to {bounds.upper:g} {bounds.unit}", value, inside)
    filled = typical_values(description, robot, first) | {key: float(value) for key, value in given.items()}
    own = {key: value for key, value in filled.items() if known[key].law in ("", chosen)}
    return Injection(effect=name, joint=first, values=own, law=chosen, into=second)


def parse_injection(robot: Robot, text: str) -> Injection:
    """The injection of ``NAME[:joint[:key=value,...]]``; keys may be ``law`` and ``into`` too.

    Raises InputError.
    """
    name, _, rest = text.partition(":")
    joint, _, settings = rest.partition(":")
    pairs: dict[str, str] = {}
    for item in filter(None, settings.split(",")):
        key, equals, value = (part.strip() for part in item.partition("="))
        _require(name, "settings", "key=value,...", repr(item), bool(equals))
        _require(name, key, "one value", f"another, {value!r}", key not in pairs)
        pairs[key] = value
    law, into = pairs.pop("law", None), pairs.pop("into", None)
    values = {}
    for key, value in pairs.items():
        try:
            values[key] = float(value)
        except ValueError:
            raise InputError("effects", f"{name} {key}", "a number", repr(value)) from None
        # An upper bound of inf is none, not a value to ask for.
        _require(name, key, "a finite number", value, math.isfinite(values[key]))
    return injection(robot, name, joint or None, values, law, into)


def _joint(robot: Robot, name: str, joint: str | int | None) -> int | None:
    """Index of a joint given by name or by number from 1."""
    if joint is None:
        return None
    if str(joint) in robot.joint_names:
        return robot.joint_names.index(str(joint))
    if str(joint).isdecimal() and 1 <= int(joint) <= robot.joints:
        return int(joint) - 1
    expected = f"a joint's name, or its number from 1 to {robot.joints}"
    raise InputError("effects", f"{name} joint", expected, repr(joint), robot.joint_names)


def _require(name: str, field: str, expected: str, got: object, holds: bool, choices: Any = None) -> None:
    if not holds:
        raise InputError("effects", f"{name} {field}", expected, got, choices)
