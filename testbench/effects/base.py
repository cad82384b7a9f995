"""What an unmodelled effect is: its law, its parameters, and where it acts."""

from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np

from .experiment import Experiment


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
    offers, the default first. confused_with: names of effects that look alike. shown_by: the records that
    distinguish it from them.

    Where it acts: loads: behind the gearboxes, which carry its torque. hinges_only: its law is of an angle.
    or_of_one_joint: an effect of the whole robot that one joint may have alone. of_position: it is a law of
    the joint's position. of_encoder: it is an error of the joint's encoder. of_transmission: between the
    motor, where the encoder is, and the link. of_last_link: its coefficients are inertial parameters that the
    last link has more of. of_friction: its columns are made of the joints' friction as far as that is known.
    yields: friction that yields before it slides, soft near rest and perhaps bent as a run begins. falls:
    friction that falls as the joint leaves rest. late: the drive's torque acts later than it is reported.
    at_times: only at times, by which it is recognised; it is searched for in a way of its own. is_event: in
    the runs that show it, and never again. viscous: its parameter that damps the joints it acts on by their
    own speed too, which re-identified viscous friction has as well; "" where none does.

    How it is fitted: relinearised: the runs are linearised anew with it, as it moves the parameters that
    columns are taken at, or its own columns hold near what was fitted only. laws_apart: far from its best
    shape another of its laws may seem the likelier, so that each is refined by itself. like_encoder_noise:
    it takes off torque that noise of the encoders seems to add. least_coefficient: of its first column; with
    less it is another effect's. known_by: parameters that it may be known by where its size is not.
    explains_all: share of a joint's squared residual from which on no other law of position acts there.

    How large it is on arms: sizes: the parameters whose largest is its size, the first where none is given.
    healthy: what joints of healthy robots reach, as a multiple of the mild end of its typical range; 0 where
    no healthy robot has any. healthy_alone: the same of an effect of the whole robot where one joint alone
    has it; None for ``healthy``. of_sample: the share of a log's sample that is no more than the log's own
    lateness. least: N·m are judged against at least this share of the joint's torque. A file whose sizes need
    more has functions of its own: fitted_effect.py.
    """

    name: str
    title: str
    law: str
    reference: str
    scope: Scope
    parameters: tuple[EffectParameter, ...]
    laws: tuple[str, ...] = ("default",)
    confused_with: tuple[str, ...] = ()
    shown_by: tuple[Experiment, ...] = ()
    loads: bool = False
    hinges_only: bool = False
    or_of_one_joint: bool = False
    of_position: bool = False
    of_encoder: bool = False
    of_transmission: bool = False
    of_last_link: bool = False
    of_friction: bool = False
    yields: bool = False
    falls: bool = False
    late: bool = False
    at_times: bool = False
    is_event: bool = False
    viscous: str = ""
    relinearised: bool = False
    laws_apart: bool = False
    like_encoder_noise: bool = False
    least_coefficient: float = -np.inf
    known_by: tuple[str, ...] = ()
    # No law is quite that of a joint.
    explains_all: float = 0.995
    sizes: tuple[str, ...] = ()
    healthy: float = 0.8
    healthy_alone: float | None = None
    of_sample: float = 0.0
    least: float = 0.006

    @property
    def size_names(self) -> tuple[str, ...]:
        """The parameters whose largest is its size."""
        return self.sizes or (self.parameters[0].name,)

    @property
    def is_lag(self) -> bool:
        """Whether it is a lag of one joint's drive."""
        return self.late and self.scope is Scope.JOINT

    def parameter(self, name: str) -> EffectParameter:
        """Its parameter of that name."""
        return next(each for each in self.parameters if each.name == name)


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
