"""A limb in order with one more effect: where it acts, how large, and which unknowns that makes."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from identification.output_error.plant import WIDTH
from identification.output_error.unknowns import Unknowns
from testbench.drives.effects import drive_effects
from testbench.drives.effects.base import PREFIX, DriveEffect, Law

from .sizes import Sizes

Array = NDArray[np.float64]

# Sizes of an effect that are looked at first, between its smallest and its largest, and then about the best
# of them, for effects in whose size position is not smooth.
SIZES, FINER = 4, 9
# What a drive without velocity gain has not, or not apart from its position gain.
OF_DAMPING = ("damping_gain_error", "torque_constant_error")


@dataclass(frozen=True)
class Place:
    """An effect by one of its laws at a joint of a limb; at all of them where joint is None."""

    effect: DriveEffect
    joint: int | None
    law: Law

    @property
    def key(self) -> tuple[str, int | None]:
        """Effect and joint, whatever the law."""
        return self.effect.name, self.joint

    def joints(self, count: int) -> list[int]:
        """The joints of a limb of so many that it acts on."""
        return list(range(count)) if self.joint is None else [self.joint]


def places(kd: Array, without: Sequence[str] = ()) -> list[Place]:
    """Every effect by every law at every joint, and at the whole limb. kd: (n,) as stated."""
    out = []
    for effect in drive_effects().values():
        if effect.name in without:
            continue
        joints: list[int | None] = [] if effect.only_whole else list(range(len(kd)))
        if effect.whole_limb and (len(kd) > 1 or effect.only_whole):
            joints.append(None)
        for joint in joints:
            if effect.name in OF_DAMPING and joint is not None and kd[joint] == 0:
                continue
            out += [Place(effect, joint, law) for law in effect.laws]
    return out


def grid(effect: DriveEffect) -> Array:
    """Sizes to look at, in the effect's scale, evenly in logarithm; both signs where it has both."""
    # The middles of equal parts.
    shares = (np.arange(SIZES) + 0.5) / SIZES
    sizes = effect.smallest * (effect.largest / effect.smallest) ** shares
    return np.concatenate([-sizes, sizes]) if effect.two_sided else sizes


def finer_grid(effect: DriveEffect, size: float) -> tuple[Array, float]:
    """Sizes about one of the grid, half way to the next ones, and the relative deviation that they leave."""
    step = np.log(effect.largest / effect.smallest) / SIZES
    sizes = size * np.exp(step * np.linspace(-0.5, 0.5, FINER))
    return np.clip(sizes, effect.smallest, effect.largest), float(step / (FINER - 1) / np.sqrt(12))


def direction(place: Place, sizes: Sizes, joints: int) -> Array:
    """Change of the table, (n, WIDTH), by one unit of an effect's size."""
    out = np.zeros((joints, WIDTH))
    for joint in place.joints(joints):
        for column, weight in place.effect.moves:
            out[joint, column] = weight * sizes.scales[place.effect.scale][joint]
    return out


def with_effect(unknown: Unknowns, place: Place, sizes: Sizes, size: float | None = None) -> Unknowns:
    """The unknowns with an effect at a place: one more, or none where its size is held."""
    joints = len(unknown.origin)
    origin = unknown.origin.copy()
    for joint in place.joints(joints):
        for column, value, scale in place.law.fixed:
            origin[joint, column] = value * sizes.scales[scale][joint]
    moved = direction(place, sizes, joints)
    if size is not None:
        return replace(unknown, origin=origin + size * moved)
    effect = place.effect
    bounds = (-effect.largest if effect.two_sided else 0.0, effect.largest)
    joint = -1 if place.joint is None else place.joint
    return replace(unknown, origin=origin).extended(
        PREFIX + effect.name, "-", joint, moved, effect.largest, bounds
    )


def handed_over(unknown: Unknowns, values: Array, place: Place, sizes: Sizes, size: float) -> Array:
    """Values (m,) of a limb in order, from which what an effect of this size does has been taken back.

    A wrong gain has been fitted as a gain in order that is far off; it is the effect's now.
    """
    moved = size * direction(place, sizes, len(unknown.origin))
    out = values.copy()
    for joint, column in zip(*np.nonzero(moved), strict=True):
        entries = unknown.basis[:, joint, column]
        # The unknown that is this entry, and nothing else.
        own = np.flatnonzero((entries != 0) & (unknown.joints == joint))
        if len(own):
            out[own[0]] -= moved[joint, column] / entries[own[0]]
    return unknown.held(out)
