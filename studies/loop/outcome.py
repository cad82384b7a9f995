"""Diagnoses of the rounds of a loop, compared with the true effects."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from testbench.effects.base import Injection
from testbench.robot import Robot

from .scenario import LoopScenario

FORMAT, VERSION = "closed-loop", 1


@dataclass(frozen=True)
class Place:
    """An effect at a joint, by names; joint None for the whole robot."""

    effect: str
    joint: str | None


@dataclass(frozen=True)
class Round:
    """One diagnosis of all runs so far. number: from 1. runs: how many logs it read.

    named: what it names. confused: what it cannot distinguish from the first. hidden: what its runs would
    not have shown. probabilities: of named and confused ones. document: diagnosis.json.
    """

    number: int
    runs: int
    named: tuple[Place, ...]
    confused: tuple[Place, ...]
    hidden: tuple[Place, ...]
    probabilities: Mapping[Place, float]
    document: Mapping[str, Any]

    @property
    def proposes(self) -> bool:
        """Whether it proposes a motion."""
        experiment = self.document["next_experiment"]
        return experiment is not None and experiment["file"] is not None

    @property
    def is_settled(self) -> bool:
        """Whether something is named and nothing could be taken for it."""
        return bool(self.named) and not self.confused


def read_round(number: int, document: Mapping[str, Any]) -> Round:
    """A round from its diagnosis.json."""
    named = tuple(Place(each["effect"], each["joint"]) for each in document["effects"])
    confused: list[Place] = []
    likely = {Place(each["effect"], each["joint"]): each["probability"] for each in document["effects"]}
    for each in document["effects"]:
        for name in each["confusable_with"]:
            # As it was weighed: at that joint, or as an effect of the whole robot.
            weighed = [c for c in document["candidates"] if c["effect"] == name]
            weighed.sort(key=lambda c: (c["joint"] != each["joint"], -(c["probability"] or 0.0)))
            place = Place(name, weighed[0]["joint"] if weighed else each["joint"])
            confused.append(place)
            likely.setdefault(place, (weighed[0]["probability"] if weighed else None) or 0.0)
    return Round(
        number=number,
        runs=len(document["runs"]),
        named=named,
        confused=tuple(dict.fromkeys(confused)),
        hidden=tuple(Place(each["effect"], each["joint"]) for each in document["not_observable"]),
        probabilities=likely,
        document=document,
    )


@dataclass(frozen=True)
class Outcome:
    """A finished loop. name: of its scenario. acts: what was withheld. values: their parameters, SI.

    follow: what later rounds ran.
    """

    name: str
    follow: str
    robot: str
    acts: tuple[Place, ...]
    values: tuple[Mapping[str, float], ...]
    rounds: tuple[Round, ...]

    @property
    def is_resolved(self) -> bool:
        """Whether the last round leaves nothing open."""
        return self.rounds[-1].is_settled

    @property
    def is_right(self) -> bool:
        """Whether it names exactly what acts, each at its joint."""
        return set(self.rounds[-1].named) == set(self.acts)


def outcome(
    scenario: LoopScenario, robot: Robot, injections: Sequence[Injection], rounds: Sequence[Round]
) -> Outcome:
    """The outcome of the rounds on a robot in which these effects act."""
    names = robot.joint_names
    return Outcome(
        name=scenario.name,
        follow=scenario.follow,
        robot=robot.name,
        acts=tuple(
            Place(each.effect, None if each.joint is None else names[each.joint]) for each in injections
        ),
        values=tuple(each.values for each in injections),
        rounds=tuple(rounds),
    )


def loop_document(found: Outcome) -> dict[str, Any]:
    """loop.json: what acts, and what every round said, as plain JSON types."""
    return {
        "format": FORMAT,
        "format_version": VERSION,
        "name": found.name,
        "robot": found.robot,
        "follow": found.follow,
        "acts": [
            vars(place) | {"parameters": dict(values)}
            for place, values in zip(found.acts, found.values, strict=True)
        ],
        "resolved": found.is_resolved,
        "right": found.is_right,
        "rounds": [
            {
                "round": each.number,
                "runs": each.runs,
                "verdict": each.document["verdict"],
                "effects": each.document["effects"],
                "confused": [vars(place) for place in each.confused],
                "probabilities": [
                    vars(place) | {"probability": value} for place, value in each.probabilities.items()
                ],
                "not_observable": each.document["not_observable"],
                "gap": each.document["gap"],
                "next_experiment": each.document["next_experiment"],
            }
            for each in found.rounds
        ],
    }
