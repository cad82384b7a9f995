"""Unknowns of a limb and its drives: how each enters the table of a robot, and its prior."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..base_parameters import base_parameters
from ..chain import Chain
from ..parameters import ARMATURE, COULOMB, INERTIAL, OFFSET, PER_JOINT, VISCOUS
from ..prior import parameter_widths
from .plant import (
    BACK_EMF,
    DELAY,
    EXTRA,
    FRICTION_CENTRE,
    FRICTION_SLOPE,
    KD_SCALE,
    KP_SCALE,
    LIMIT,
    LOAD_FRICTION,
    STRIBECK_VELOCITY,
    WIDTH,
)

Array = NDArray[np.float64]

# Gains are known to a factor between these; a scale of zero is no drive.
GAIN_BOUNDS = (0.05, 20.0)
# Of a joint's torque: cables, springs and zeros that are a little off.
OFFSET_SHARE = 0.1
# Stribeck velocity, as a share of a joint's RMS speed.
STRIBECK_SHARE = 0.2
# Deviation of the share of the load that friction is, and its highest: small gears lose a third and more.
LOAD_SHARE, MOST_LOAD = 0.3, 0.9
# Deviation of how much friction changes over a joint's motion, as a share of its torque.
SLOPE_SHARE = 0.5
EFFECTS = (
    "load_dependent_friction",
    "position_dependent_friction",
    "stribeck_friction",
)
# A combination of inertias whose effect is below this share of the largest is left as the model has it.
FAINT = 1e-6


@dataclass(frozen=True)
class Unknowns:
    """table = origin + sum_k x_k basis_k, linear in the m unknowns x.

    names, units, joints: m each; joint -1 for a combination of links. origin: (n, WIDTH). basis: (m, n,
    WIDTH). mean, deviation: (m,) of the Gaussian prior. lower, upper: (m,) bounds.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    joints: NDArray[np.int64]
    origin: Array
    basis: Array
    mean: Array
    deviation: Array
    lower: Array
    upper: Array

    @property
    def count(self) -> int:
        """Number of unknowns, m."""
        return len(self.names)

    def table(self, values: Array) -> Array:
        """The table (n, WIDTH) at values (m,), or (C, n, WIDTH) at (C, m)."""
        return np.asarray(self.origin + np.tensordot(values, self.basis, axes=1))

    def at(self, name: str) -> NDArray[np.int64]:
        """Places of the unknowns of a name, one a joint."""
        return np.flatnonzero(np.array(self.names) == name)

    def extended(
        self,
        name: str,
        unit: str,
        joint: int,
        direction: Array,
        deviation: float,
        bounds: tuple[float, float],
    ) -> "Unknowns":
        """These unknowns and one more, of mean 0, that moves the table along a direction (n, WIDTH)."""
        return Unknowns(
            (*self.names, name),
            (*self.units, unit),
            np.append(self.joints, joint),
            self.origin,
            np.concatenate([self.basis, direction[None]]),
            *(
                np.append(values, value)
                for values, value in (
                    (self.mean, 0.0),
                    (self.deviation, deviation),
                    (self.lower, bounds[0]),
                    (self.upper, bounds[1]),
                )
            ),
        )

    def held(self, values: Array) -> Array:
        """Values within the bounds."""
        return np.clip(values, self.lower, self.upper)


@dataclass(frozen=True)
class Knowledge:
    """Prior of the drives, (n,) each.

    gain_spread: relative standard deviation of kp and of kd; ratio_spread: that of kd over kp. delay_lower,
    delay_upper: s. limit_spread: relative, of the torque limit; 0 where it is exact, or never reached.
    stall_spread: likewise, of the back EMF of a servo that sets a voltage. torque_scale, speed_scale: N·m and
    rad/s typical of the runs. inertia: kg·m² that each joint moves, without its rotor. centre, reach: rad,
    the middle of each joint's motion and its deviation about it. effects: of EFFECTS, what each joint may
    have.
    """

    gain_spread: Array
    ratio_spread: float
    delay_lower: Array
    delay_upper: Array
    limit_spread: Array
    stall_spread: Array
    torque_scale: Array
    speed_scale: Array
    inertia: Array
    centre: Array
    reach: Array
    effects: tuple[str, ...] = ()


def unknowns(chain: Chain, table: Array, known: Knowledge) -> Unknowns:
    """The unknowns of a limb whose model and drives, as stated, have this table (n, WIDTH).

    Of links: the combinations that the torque shows, within the widths of ``prior.py``. Of each joint:
    armature, viscous and Coulomb friction from zero up, loosely held about the model's, and a torque offset.
    Of each drive: scales of its gains, the delay, and the torque limit where it is uncertain.
    """
    table = table.copy()
    table[:, FRICTION_CENTRE] = known.centre
    if "stribeck_friction" in known.effects:
        table[:, STRIBECK_VELOCITY] = STRIBECK_SHARE * known.speed_scale
    build = Builder(table)
    for direction in inertial_directions(chain, table, known.torque_scale, known.speed_scale, known.inertia):
        build.add("inertia", "-", -1, direction, 0.0, 1.0)
    for joint in range(chain.joints):
        own = table[joint]
        build.of_joint("armature", "kg·m²", joint, ARMATURE, max(own[ARMATURE], known.inertia[joint]))
        per_speed = known.torque_scale[joint] / known.speed_scale[joint]
        build.of_joint("viscous", "N·m·s/rad", joint, VISCOUS, max(own[VISCOUS], per_speed))
        build.of_joint("coulomb", "N·m", joint, COULOMB, max(own[COULOMB], known.torque_scale[joint]))
        width = OFFSET_SHARE * known.torque_scale[joint]
        build.of_joint("offset", "N·m", joint, OFFSET, width, (-np.inf, np.inf))
        build.of_gains(joint, float(known.gain_spread[joint]), known.ratio_spread)
        if "load_dependent_friction" in known.effects:
            bounds = (0.0, MOST_LOAD)
            build.of_joint("load_friction", "-", joint, LOAD_FRICTION, LOAD_SHARE, bounds)
        if "position_dependent_friction" in known.effects:
            width = SLOPE_SHARE * known.torque_scale[joint] / known.reach[joint]
            build.of_joint("friction_slope", "N·m/rad", joint, FRICTION_SLOPE, width, (-np.inf, np.inf))
        if "stribeck_friction" in known.effects:
            build.of_joint("stribeck", "N·m", joint, EXTRA, known.torque_scale[joint])
        lower, upper = known.delay_lower[joint], known.delay_upper[joint]
        if upper > lower:
            build.of_joint("delay", "s", joint, DELAY, (upper - lower) / np.sqrt(12.0), (lower, upper))
        if known.limit_spread[joint] > 0:
            width = known.limit_spread[joint] * own[LIMIT]
            build.of_joint("limit", "N·m", joint, LIMIT, width, (0.1 * own[LIMIT], np.inf))
        build.of_voltage(joint, known)
    return build.unknowns()


class Builder:
    """Collects unknowns one by one."""

    def __init__(self, table: Array):
        self._origin = table.copy()
        self._rows: list[tuple[str, str, int, Array, float, float, float, float]] = []

    def add(
        self,
        name: str,
        unit: str,
        joint: int,
        direction: Array,
        mean: float,
        deviation: float,
        bounds: tuple[float, float] = (-np.inf, np.inf),
    ) -> None:
        """An unknown that moves the table (n, WIDTH) along a direction."""
        self._rows.append((name, unit, joint, direction, mean, deviation, *bounds))

    def of_joint(
        self,
        name: str,
        unit: str,
        joint: int,
        column: int,
        deviation: float,
        bounds: tuple[float, float] = (0.0, np.inf),
    ) -> None:
        """An unknown that is an entry of the table, about what the table has there."""
        direction = np.zeros_like(self._origin)
        direction[joint, column] = 1.0
        mean = float(self._origin[joint, column])
        self._origin[joint, column] = 0.0
        self.add(name, unit, joint, direction, mean, deviation, bounds)

    def of_gains(self, joint: int, spread: float, ratio_spread: float) -> None:
        """Scales of both gains, each known to a spread, their ratio to another; nothing where they are exact.

        Their correlation is r = 1 - ratio_spread² / (2 spread²), none below zero. So the scale of kd is
        r (kp_scale - 1) + kd_scale, and kd_scale is independent of kp_scale.
        """
        if spread == 0:
            return
        shared = max(0.0, 1 - 0.5 * (ratio_spread / spread) ** 2)
        self.of_joint("kp_scale", "-", joint, KP_SCALE, spread, GAIN_BOUNDS)
        self._rows[-1][3][joint, KD_SCALE] = shared
        self.of_joint("kd_scale", "-", joint, KD_SCALE, spread * np.sqrt(1 - shared**2), GAIN_BOUNDS)
        self._origin[joint, KD_SCALE] = -shared

    def of_voltage(self, joint: int, known: Knowledge) -> None:
        """Back EMF of a drive that sets a voltage, within what is known of it."""
        if known.stall_spread[joint] > 0:
            own = float(self._origin[joint, BACK_EMF])
            width = known.stall_spread[joint] * own
            self.of_joint("back_emf", "N·m·s/rad", joint, BACK_EMF, width, (0.1 * own, np.inf))

    def unknowns(self) -> Unknowns:
        """All of them."""
        names, units, joints, basis, *figures = zip(*self._rows, strict=True)
        numbers = [np.array(each, dtype=np.float64) for each in figures]
        return Unknowns(
            names, units, np.array(joints, dtype=np.int64), self._origin, np.array(basis), *numbers
        )


def inertial_directions(
    chain: Chain, table: Array, torque_scale: Array, speed_scale: Array, inertia: Array
) -> Array:
    """Moves of the table (b, n, WIDTH), each one deviation of the links' inertias, that the torque shows.

    What of the prior's covariance the base parameters see, in its own axes: combinations that no torque
    shows stay as the model has them, and the others are shared by the links as their widths allow.
    """
    standard = table[:, :PER_JOINT].ravel()
    widths = parameter_widths(standard, torque_scale, speed_scale, torque_scale / inertia)
    inertial = (np.arange(len(standard)) % PER_JOINT) < INERTIAL
    widths = np.where(inertial, widths, 0.0)
    base = base_parameters(chain, ("inertial",))
    seen = base.projection * widths
    # Base parameters have different units: each is judged by its own prior width.
    size = np.linalg.norm(seen, axis=1)
    _, strength, axes = np.linalg.svd(seen[size > 0] / size[size > 0, None], full_matrices=False)
    kept = axes[strength > FAINT * strength[:1].max(initial=0.0)] * widths
    out = np.zeros((len(kept), chain.joints, WIDTH))
    out[:, :, :PER_JOINT] = kept.reshape(-1, chain.joints, PER_JOINT)
    return out
