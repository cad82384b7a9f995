"""How a robot is drawn: what is wrong with it, and how large that is. A plant brings the physics."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from testbench.log import Controller, Recording

from .case import Case, Fault, Kind
from .links import Links
from .motions import Motion

Array = NDArray[np.float64]

# How often a robot is healthy, has one fault, two, or one that is in no catalogue.
SHARES: Mapping[Kind, float] = {"healthy": 0.25, "single": 0.5, "pair": 0.125, "unknown": 0.125}
# Of the joint's torque, RMS, that a fault moves; log-uniform.
SMALLEST, LARGEST = 0.04, 0.35
# A fault that cannot be made to move such a share is drawn again: too small, or a loop that it makes
# unstable.
LEAST, MOST = 0.03, 0.8
ATTEMPTS = 12
STREAMS, NOISE = 6, 4
# Of a size, relative to the plant's own unit of the effect.
SIZES = (0.03, 12.0)
UNKNOWN = "unknown"


@dataclass(frozen=True)
class Place:
    """A fault without its size. effect: name, or "unknown". law: of an unknown one. joint, into: index."""

    effect: str
    joint: int | None = None
    into: int | None = None
    law: str = ""

    @property
    def where(self) -> frozenset[int | None]:
        """The joints it is at."""
        return frozenset({self.joint, self.into} - {None})


class Plant(Protocol):
    """A kind of robot with its drives, written in a file of its own.

    name: of the plant. effects: of the catalogue that it can have, each with the joints that may have it,
    None
    for the whole robot. laws: outside of the catalogue, with the joints that may have them. robot, faulty:
    any
    immutable state of the plant.
    """

    name: str

    def robot(self, rng: np.random.Generator) -> Any:
        """A healthy robot with small imperfections of every joint."""
        ...

    def ideal(self, robot: Any) -> Any:
        """The same with viscous friction alone, and sensors without noise."""
        ...

    def places(self, robot: Any) -> tuple[Place, ...]:
        """Every fault that the robot may have, the unknown ones among them."""
        ...

    def faulty(self, robot: Any, place: Place, size: float, rng: np.random.Generator) -> Any:
        """The robot with a fault. size: 1 for a usual one. rng: of its other figures."""
        ...

    def links(self, robot: Any) -> Links:
        """Its links, with the friction and limits that a data sheet gives."""
        ...

    def motion(self, robot: Any, rng: np.random.Generator) -> Motion:
        """A motion for one run."""
        ...

    def run(self, robot: Any, motion: Motion, rng: np.random.Generator | None) -> Recording:
        """The log of one run; without noise, if rng is None."""
        ...


def drawn(plant: Plant, seed: int, healthy: bool = False) -> Case:
    """The robot of this seed; one that cannot follow its motions is drawn again.

    healthy: the same without its faults, which the answer then lacks.
    """
    kind = kind_of(plant.name, seed)
    for attempt in range(ATTEMPTS):
        building, choosing, figures, moving, noise, modelling = _streams(plant.name, seed, attempt)
        robot = plant.robot(building)
        count = int(choosing.integers(2, 5))
        motions = [plant.motion(robot, moving) for _ in range(count)]
        noises = noise.spawn(count)
        sick, faults = _with_faults(plant, robot, kind, motions[0], choosing, figures)
        runs = [plant.run(sick, motion, each) for motion, each in zip(motions, noises, strict=True)]
        if not all(_followed(run) for run in runs):
            continue
        if healthy:
            again = _streams(plant.name, seed, attempt)[NOISE].spawn(count)
            runs = [plant.run(robot, motion, each) for motion, each in zip(motions, again, strict=True)]
        model = plant.links(robot).from_cad(modelling).mjcf(plant.name)
        stated: Kind = "healthy" if healthy else kind
        return Case(plant.name, seed, stated, model, tuple(runs), () if healthy else faults)
    raise RuntimeError(f"{plant.name}: none of {ATTEMPTS} robots of seed {seed} follows its motions")


def _followed(run: Recording) -> bool:
    """Whether a run is finite, and each joint within half of its motion's range of its reference."""
    reference = run.reference_position
    if reference is None or not (np.isfinite(run.position).all() and np.isfinite(run.torque).all()):
        return False
    return bool((np.abs(run.position - reference).max(axis=0) < 0.5 * np.ptp(reference, axis=0)).all())


def kind_of(name: str, seed: int) -> Kind:
    """Of the robot of a plant and seed."""
    kinds = list(SHARES)
    choosing = np.random.default_rng([seed, *name.encode()])
    return kinds[choosing.choice(len(kinds), p=list(SHARES.values()))]


def _streams(name: str, seed: int, attempt: int) -> list[np.random.Generator]:
    """Independent generators, one for each thing that is drawn; the same in every process."""
    entropy = np.random.SeedSequence([seed, attempt, *name.encode()])
    return [np.random.default_rng(each) for each in entropy.spawn(STREAMS)]


def _with_faults(
    plant: Plant,
    robot: Any,
    kind: Kind,
    motion: Motion,
    choosing: np.random.Generator,
    figures: np.random.Generator,
) -> tuple[Any, tuple[Fault, ...]]:
    """The robot with the faults of its kind, and what they are."""
    count = {"healthy": 0, "pair": 2}.get(kind, 1)
    sick, faults, taken = robot, list[Fault](), list[Place]()
    clean = plant.run(robot, motion, None).torque if count else np.zeros((1, 1))
    for _ in range(ATTEMPTS):
        if len(faults) == count:
            break
        place = _place(plant.places(robot), kind == UNKNOWN, taken, choosing)
        seed = int(figures.integers(2**32))
        wanted = float(np.exp(choosing.uniform(np.log(SMALLEST), np.log(LARGEST))))
        size, share = _sized(plant, robot, place, seed, wanted, motion, clean)
        if not LEAST <= share <= MOST:
            continue
        sick = plant.faulty(sick, place, size, np.random.default_rng(seed))
        taken.append(place)
        faults.append(_fault(plant, robot, place, share))
    if len(faults) < count:
        raise RuntimeError(f"{plant.name}: no {kind} fault moves enough torque in {ATTEMPTS} attempts")
    return sick, tuple(faults)


def _place(places: tuple[Place, ...], unknown: bool, taken: list[Place], rng: np.random.Generator) -> Place:
    """One of the places, each effect as likely as any other; no effect and no joint twice."""
    used = {place.effect for place in taken}
    joints = frozenset().union(*(place.where for place in taken))
    free = [
        place
        for place in places
        if (place.effect == UNKNOWN) == unknown and place.effect not in used and not place.where & joints
    ]
    names = sorted({(place.effect, place.law) for place in free})
    chosen = names[rng.integers(len(names))]
    there = [place for place in free if (place.effect, place.law) == chosen]
    return there[rng.integers(len(there))]


def _sized(
    plant: Plant, robot: Any, place: Place, seed: int, wanted: float, motion: Motion, clean: Array
) -> tuple[float, float]:
    """The size at which a fault moves nearly the wanted share of torque, and the share that it moves."""
    size, best = 1.0, (1.0, 0.0)
    for _ in range(3):
        sick = plant.faulty(robot, place, size, np.random.default_rng(seed))
        share = moved(plant.run(sick, motion, None).torque, clean, place.joint)
        if not np.isfinite(share):
            size *= 0.2
            continue
        if abs(np.log(max(share, 1e-9) / wanted)) < abs(np.log(max(best[1], 1e-9) / wanted)):
            best = size, share
        if abs(share / wanted - 1) < 0.15:
            break
        size = float(np.clip(size * np.clip(wanted / max(share, 1e-9), 0.1, 10), *SIZES))
    return best


def moved(torque: Array, clean: Array, joint: int | None) -> float:
    """RMS of a torque (N, n) less the healthy one over the RMS of that, at the joint or the most moved."""
    with np.errstate(over="ignore", invalid="ignore"):
        share = np.sqrt(((torque - clean) ** 2).mean(axis=0) / (clean**2).mean(axis=0))
    return float(share.max() if joint is None else share[joint])


def _fault(plant: Plant, robot: Any, place: Place, share: float) -> Fault:
    names = plant.links(robot).names
    joint, into = (None if j is None else names[j] for j in (place.joint, place.into))
    return Fault(place.effect, joint, into, place.law, share)


def log_of(
    plant: str, links: Links, rate: float, position: Array, torque: Array, motion: Motion | None = None
) -> Recording:
    """A robot-log; rate: Hz. motion: at that rate, the reference where the controller logs it."""
    reference = motion or (None, None, None)
    return Recording(
        robot=plant,
        joint_names=links.names,
        sample_rate=rate,
        source=f"plant {plant}",
        time=np.arange(len(position)) / rate,
        position=position,
        torque=torque,
        reference_position=reference[0],
        reference_velocity=reference[1],
        reference_acceleration=reference[2],
        controller=Controller("unknown", rate),
        is_slide=tuple(bool(slide) for slide in links.slide),
    )
