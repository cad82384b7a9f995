"""What an unmodelled effect is: its law, its parameters, and where it acts."""

from dataclasses import dataclass, field
from enum import StrEnum


class Scope(StrEnum):
    """Where an effect acts: one joint, a pair of joints, or the whole robot."""

    JOINT = "joint"
    PAIR = "pair"
    ROBOT = "robot"


@dataclass(frozen=True)
class EffectParameter:
    """One parameter of an effect, SI at the joint.

    name, unit: as the diagnosis states them. lower, upper: hard bounds. typical: (mild, severe) on an
    industrial arm; for parameters that scale with the joint, as a share of ``relative_to`` (coulomb, viscous,
    viscous_torque, torque_limit, gravity, link_inertia), else absolute and relative_to is "". law: the only
    one of the effect's that has it; "" for all.
    """

    name: str
    unit: str
    lower: float
    upper: float
    typical: tuple[float, float]
    relative_to: str = ""
    law: str = ""


@dataclass(frozen=True)
class EffectDescription:
    """What is known of an effect, whichever face uses it.

    name: of the contract. title: for people. law: the formula. reference: where it comes from.
    scope: where it acts. parameters: in the order of the contract. laws: the variants simulation
    offers, the default first. confused_with: names of effects that look alike. loads: it acts behind the
    gearboxes, which carry its torque. hinges_only: its law is of an angle. of_friction: its columns are made
    of the joints' friction as far as that is known. or_of_one_joint: an effect of the whole robot that one
    joint may have alone.

    How large it is on arms: sizes: the parameters whose largest is its size, the first where none is given.
    healthy: what joints of healthy robots reach, as a multiple of the mild end of its typical range; 0 where
    no healthy robot has any. of_sample: the share of a log's sample that is no more than the log's own
    lateness. least: N·m are judged against at least this share of the joint's torque.
    """

    name: str
    title: str
    law: str
    reference: str
    scope: Scope
    parameters: tuple[EffectParameter, ...]
    laws: tuple[str, ...] = ("default",)
    confused_with: tuple[str, ...] = ()
    loads: bool = False
    hinges_only: bool = False
    of_friction: bool = False
    or_of_one_joint: bool = False
    sizes: tuple[str, ...] = ()
    healthy: float = 0.8
    of_sample: float = 0.0
    least: float = 0.006

    @property
    def size_names(self) -> tuple[str, ...]:
        """The parameters whose largest is its size."""
        return self.sizes or (self.parameters[0].name,)


@dataclass(frozen=True)
class Injection:
    """One effect put into the simulated robot.

    effect: its name. joint: index, or None for the whole robot. values: parameter to SI value.
    law: which variant. into: index of the second joint of a pair, or None.
    """

    effect: str
    joint: int | None
    values: dict[str, float] = field(default_factory=dict)
    law: str = "default"
    into: int | None = None
