"""Random draw of a case by seed: kind, robot, effects, background, drive, motions, sensors."""

from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.errors import InputError
from identification.excitation.design import DesignOptions
from testbench.effects import effect, effects
from testbench.robot import Robot, load_robot

from .outside import OUTSIDE
from .scenario import KINDS, BlindScenario
from .values import drawn_place

Array = NDArray[np.float64]

# Shares of the cases whose controller knows no model, and that log velocity, temperature, no command, no
# reference.
PLAIN_PD, WITH_VELOCITY, WITH_TEMPERATURE, NO_COMMAND, NO_REFERENCE = 0.3, 0.4, 0.3, 0.25, 0.1
BANDWIDTH, DAMPING = (4.0, 9.0), (0.7, 1.2)
ENCODER_BITS = (16, 21)
TORQUE_NOISE, CORRELATION_TIME = (0.001, 0.008), (0.001, 0.01)
SLIDE_RESOLUTION = (1e-6, 4e-6)
# Torque of an effect outside the catalogue, as a share of what the joint needs.
OUTSIDE_SIZE = (0.05, 0.3)
# Kind of motion: fewest and most harmonics (segments of a quintic).
MOTIONS = {"fourier": (4, 9), "modified_fourier": (4, 8), "harmonic_sines": (4, 8), "quintic": (6, 10)}
LIMIT_SHARE = (0.5, 0.9)
# One run is rich in what elasticity and play show in: Hz of its lowest harmonic, their number, its share.
RICH_BASE, RICH_HARMONICS, RICH_SHARE = (0.25, 0.3), 20, (0.4, 0.6)
# Share of the samples that a log holds where it does.
HELD = 0.003
TRANSMISSION = ("backlash", "joint_elasticity")
DRAWS = 50


@dataclass(frozen=True)
class DrawnEffect:
    """An effect before its numbers: of the catalogue, or outside. severity: 0 mild, 1 severe.

    joint, into: indices, None as in the catalogue. law: None outside the catalogue.
    """

    effect: str
    joint: int | None
    into: int | None
    law: str | None
    severity: float


@dataclass(frozen=True)
class Motion:
    """How a run is moved. options: of the random motion. periods: repetitions of it."""

    options: DesignOptions
    periods: int


@dataclass(frozen=True)
class Draw:
    """A case before anything is simulated. motions: the last one is hidden.

    robot: index in the scenario. background, nominal: scales, 0 for none. encoder_bits, torque_noise (share
    of the limit), torque_correlation_time (s): of a robot without background. channels: what is logged
    beside position and torque. links_alone: whether the model has no friction and no rotors. held: share of
    the samples that logs hold.
    """

    name: str
    kind: str
    robot: int
    effects: tuple[DrawnEffect, ...]
    background: float
    nominal: float
    controller: str
    bandwidth: float
    damping_ratio: float
    rate: float
    encoder_bits: int
    torque_noise: float
    torque_correlation_time: float
    slide_resolution: float
    channels: tuple[str, ...]
    motions: tuple[Motion, ...]
    links_alone: bool
    held: float

    def answer(self) -> dict[str, Any]:
        """All of it as JSON types."""
        return asdict(self)


@cache
def robot_of(path: Path) -> Robot:
    """The robot of a model file, read once a process."""
    return load_robot(path)


def kinds_of(scenario: BlindScenario) -> tuple[str, ...]:
    """The kind of every case, in an order that says nothing."""
    kinds = [kind for kind, count in scenario.cases.model_dump().items() for _ in range(count)]
    order = np.random.default_rng((scenario.seed, len(kinds))).permutation(len(kinds))
    return tuple(kinds[index] for index in order)


def case_names(count: int) -> tuple[str, ...]:
    """Names by number."""
    return tuple(f"case_{index + 1:04d}" for index in range(count))


def drawn_case(scenario: BlindScenario, index: int, stream: np.random.SeedSequence) -> Draw:
    """Everything of case ``index`` that is chosen at random, but for the effects' numbers."""
    rng = np.random.default_rng(stream)
    kind = kinds_of(scenario)[index]
    weights = np.array([robot.weight for robot in scenario.robots])
    robot = int(rng.choice(len(weights), p=weights / weights.sum()))
    channels = [
        name
        for name, present in (
            ("velocity", rng.random() < WITH_VELOCITY),
            ("temperature", rng.random() < WITH_TEMPERATURE),
            ("torque_command", rng.random() >= NO_COMMAND),
            ("reference", rng.random() >= NO_REFERENCE),
        )
        if present
    ]
    background, nominal, runs = scenario.background, scenario.nominal, scenario.runs
    # Drawn for every case, so that what a case has decides nothing else of it.
    scale = float(rng.uniform(background.smallest, background.largest))
    has_background = bool(rng.random() < background.share)
    return Draw(
        name=case_names(index + 1)[-1],
        kind=kind,
        robot=robot,
        background=scale if has_background else 0.0,
        nominal=float(rng.uniform(nominal.smallest, nominal.largest)),
        controller="pd" if rng.random() < PLAIN_PD else "pd_with_model_feedforward",
        bandwidth=float(rng.uniform(*BANDWIDTH)),
        damping_ratio=float(rng.uniform(*DAMPING)),
        rate=float(rng.choice(runs.sample_rates)),
        encoder_bits=int(rng.integers(*ENCODER_BITS)),
        torque_noise=float(rng.uniform(*TORQUE_NOISE)),
        torque_correlation_time=float(rng.uniform(*CORRELATION_TIME)),
        slide_resolution=float(rng.uniform(*SLIDE_RESOLUTION)),
        channels=tuple(channels),
        motions=_motions(scenario, rng),
        effects=_effects(kind, robot_of(scenario.robots[robot].model), rng),
        links_alone=bool(rng.random() < nominal.links_alone),
        held=HELD if rng.random() < runs.held else 0.0,
    )


def _motions(scenario: BlindScenario, rng: np.random.Generator) -> tuple[Motion, ...]:
    """Runs that the diagnosis is given, in any order, and the hidden one."""
    section = scenario.runs
    count = int(rng.integers(section.fewest, section.most + 1))
    given = [_motion(scenario, rng) for _ in range(count - 1)]
    given.insert(int(rng.integers(count)), _rich_motion(scenario, rng))
    return (*given, _motion(scenario, rng))


def _motion(scenario: BlindScenario, rng: np.random.Generator) -> Motion:
    kind = str(rng.choice(list(MOTIONS)))
    fewest, most = MOTIONS[kind]
    options = DesignOptions(
        trajectory=kind,
        harmonics=int(rng.integers(fewest, most + 1)),
        base_frequency=1 / float(rng.uniform(scenario.runs.shortest, scenario.runs.longest)),
        limit_share=float(rng.uniform(*LIMIT_SHARE)),
        seed=int(rng.integers(1 << 31)),
    )
    return Motion(options, 1)


def _rich_motion(scenario: BlindScenario, rng: np.random.Generator) -> Motion:
    """A run with content from its base frequency to about 6 Hz."""
    base = float(rng.uniform(*RICH_BASE))
    options = DesignOptions(
        harmonics=RICH_HARMONICS,
        base_frequency=base,
        limit_share=float(rng.uniform(*RICH_SHARE)),
        seed=int(rng.integers(1 << 31)),
    )
    wanted = float(rng.uniform(scenario.runs.shortest, scenario.runs.longest))
    return Motion(options, max(round(wanted * base), 1))


def _effects(kind: str, robot: Robot, rng: np.random.Generator) -> tuple[DrawnEffect, ...]:
    """Effects that differ in name, and of which only one is in a joint's transmission."""
    if kind == "unknown":
        name = str(rng.choice(list(OUTSIDE)))
        return (DrawnEffect(name, int(rng.integers(robot.joints)), None, None, float(rng.random())),)
    found: list[DrawnEffect] = []
    for _ in range(DRAWS):
        if len(found) == KINDS[kind]:
            return tuple(found)
        name = str(rng.choice([name for name in effects() if name not in {each.effect for each in found}]))
        law, severity = str(rng.choice(effect(name).DESCRIPTION.laws)), float(rng.random())
        place = drawn_place(name, robot, rng)
        taken = {each.joint for each in found if each.effect in TRANSMISSION}
        if place is not None and not (name in TRANSMISSION and place[0] in taken):
            found.append(DrawnEffect(name, *place, law, severity))
    raise InputError("blind", "robots", f"a robot that {KINDS[kind]} effects can be put into", robot.name)
