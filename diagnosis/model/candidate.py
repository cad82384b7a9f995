"""Candidate effect: one shape of one family, with its columns along these runs."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from testbench.effects import effects
from testbench.effects.base import EffectDescription, Scope
from testbench.effects.columns import over_all_joints
from testbench.effects.signature import Family, Member

Array = NDArray[np.float64]

# An effect's name, its joint and the second joint of a pair.
Place = tuple[str, int | None, int | None]
# Effects with a search of their own: a push, which happens in one run and says nothing of another; a limit,
# beyond which the torque that is regressed on would stand on both sides; a delay, and a zero, which are found
# at any size.
PUSH, SATURATION = "external_contact", "torque_saturation"
DELAY, ZERO = "torque_delay", "encoder_offset"
# No effect takes more of a joint than so many times the largest torque that it has.
MOST_TORQUE = 3.0
# What the effect of a free function of the motion is called before its regime.
FREE = "unknown: "
# Of what is under no law of the catalogue.
NO_EFFECT = EffectDescription(name="", title="", law="", reference="", scope=Scope.JOINT, parameters=())


@dataclass(frozen=True)
class Candidate:
    """One member of a family on these runs.

    family: the effect and its place. member: which shape. filtered: a run, (M, r, k) at the member's rows.
    joints: n of the robot. samples: of all these runs together, at the full rate. sample_time: s, the longest
    of them. position_step: (n,) rad (m), that their encoders count in, the coarsest. largest_torque: (n,) N·m
    (N), of the joints along them. is_carried: whether the load of these runs has its torque already.
    """

    family: Family
    member: Member
    filtered: tuple[Array, ...]
    joints: int
    samples: int
    sample_time: float
    position_step: Array
    largest_torque: Array
    is_carried: bool = False

    @cached_property
    def columns(self) -> tuple[Array, ...]:
        """A run each, (M, n, k): filtered, and zero where the effect does not reach."""
        return tuple(over_all_joints(run, self.member.rows, self.joints) for run in self.filtered)

    @cached_property
    def bounds(self) -> tuple[Array, Array]:
        """Lower and upper bounds (k,) of the coefficients.

        The law's, and where it takes more torque at some sample than any effect does: where no sample counts,
        as near rest, nothing else keeps it small. A push has none of these.
        """
        lower, upper = self.member.lower, self.member.upper
        if self.is_event:
            return lower, upper
        most = MOST_TORQUE * self.largest_torque[list(self.member.rows), None]
        peak = np.max([np.maximum(run.max(axis=0), -run.min(axis=0)) for run in self.filtered], axis=0)
        bounded = (most > 0) & (peak > 0)
        largest = np.divide(most, peak, out=np.full(peak.shape, np.inf), where=bounded).min(axis=0)
        return np.maximum(lower, -largest), np.minimum(upper, largest)

    @property
    def description(self) -> EffectDescription:
        """The description of its effect, an empty one where it is under no law of the catalogue."""
        known = effects().get(self.family.effect)
        return NO_EFFECT if known is None else known.DESCRIPTION

    @property
    def count(self) -> int:
        """Number of coefficients, k."""
        return self.member.count

    @property
    def precision(self) -> Array:
        """Prior precision (k,) of the coefficients; 0 where they may have any size."""
        widths = self.member.widths
        return np.zeros(self.count) if widths is None else np.asarray(widths**-2.0)

    @property
    def shapes(self) -> int:
        """Number of shapes of its law that are tried."""
        of_its_law = sum(member.law == self.member.law for member in self.family.members)
        return max(of_its_law, self.family.picked_from, 1)

    @property
    def shows(self) -> bool:
        """Whether anything of it is in these runs' torque."""
        return any(run.any() for run in self.filtered)

    @property
    def is_event(self) -> bool:
        """Whether it belongs to the runs it was seen in, and not to the robot."""
        return self.description.is_event

    @property
    def is_free(self) -> bool:
        """Whether it is a free function of the motion, under no law."""
        return self.family.effect.startswith(FREE)

    @property
    def is_common_delay(self) -> bool:
        """Whether it has the torque of all joints act late."""
        return self.description.late and self.family.joint is None

    @property
    def is_late_alone(self) -> bool:
        """Whether it has one joint's torque act late, and no other's."""
        description = self.description
        return description.late and not description.is_lag and self.family.joint is not None

    @property
    def place(self) -> Place:
        """Effect, joint and second joint."""
        return self.family.effect, self.family.joint, self.family.into
