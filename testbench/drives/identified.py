"""The identification of a robot's drives: every limb fitted, and what its simulation is judged by."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from identification.inverse_dynamics import mass_matrices
from identification.output_error.fit import Fit, fit
from identification.output_error.plant import BACK_EMF, KD_SCALE, STALL, WIDTH, Limb, limbs, plant_table
from identification.output_error.servo_loop import Window, simulate
from identification.output_error.servo_run import ServoRun
from identification.output_error.start import regression_start
from identification.output_error.unknowns import Knowledge, Unknowns, unknowns
from identification.parameters import (
    ARMATURE,
    INERTIAL,
    MASS,
    VISCOUS,
    inertial_parameters,
    pseudo_inertia,
    without_friction,
)

from ..robot import Robot
from .effects.base import PREFIX
from .shared import Tied, tied_fits
from .stated import Servo

Array = NDArray[np.float64]

# Poses at which a joint's inertia is averaged.
POSES = 64
# Share of the prior's variance that a determined figure keeps at most.
DETERMINED = 0.5
# Of a link's largest second moment of mass, the least that its thinnest axis has.
THIN = 1e-3


@dataclass(frozen=True)
class Figure:
    """One figure of one joint: as identified, and as known before (None for a sum of two)."""

    name: str
    unit: str
    joint: str
    value: float
    std: float
    prior: float | None
    prior_std: float | None

    @property
    def is_determined(self) -> bool | None:
        """Whether the runs know it better than it was known before; None where nothing was."""
        return None if self.prior_std is None else self.std**2 <= DETERMINED * self.prior_std**2


@dataclass(frozen=True)
class Alike:
    """A figure of the same joint of several limbs: their common value, and whether they differ by chance.

    p_value: of the hypothesis that they are one (chi-squared of their deviations).
    """

    name: str
    unit: str
    joints: tuple[str, ...]
    value: float
    std: float
    p_value: float


@dataclass(frozen=True)
class IdentifiedDrives:
    """robot, servo: as given. given, identified: tables (n, WIDTH) of plant.py. fits: one a limb.

    separate: the fits before joints that are alike shared their figures. tied: figures that they share, and
    those that differ.
    """

    robot: Robot
    servo: Servo
    given: Array
    identified: Array
    limbs: tuple[Limb, ...]
    fits: tuple[Fit, ...]
    separate: tuple[Fit, ...]
    tied: tuple[Tied, ...] = ()

    @cached_property
    def figures(self) -> tuple[Figure, ...]:
        """Every joint's figures, by name and then by joint."""
        return self._figures_of(self.fits)

    def _figures_of(self, fits: Sequence[Fit]) -> tuple[Figure, ...]:
        found = [
            figure
            for limb, own in zip(self.limbs, fits, strict=True)
            for figure in _figures(limb, own, self.servo)
        ]
        names = list(dict.fromkeys(figure.name for figure in found))
        order = {name: place for place, name in enumerate(self.robot.joint_names)}
        return tuple(sorted(found, key=lambda each: (names.index(each.name), order[each.joint])))

    @property
    def alike(self) -> tuple[Alike, ...]:
        """Figures of limbs with as many joints, each limb fitted by itself, compared joint by joint."""
        figures = {(figure.name, figure.joint): figure for figure in self._figures_of(self.separate)}
        out = []
        for length in dict.fromkeys(len(limb.joints) for limb in self.limbs):
            same = [limb for limb in self.limbs if len(limb.joints) == length]
            if len(same) < 2:
                continue
            for name in dict.fromkeys(figure.name for figure in self.figures):
                for place in range(length):
                    joints = tuple(limb.chain.joint_names[place] for limb in same)
                    own = [figures[name, joint] for joint in joints if (name, joint) in figures]
                    if len(own) == len(joints):
                        out.append(_alike(own))
        return tuple(out)


def identify_drives(
    robot: Robot, servos: Sequence[Servo], runs: Sequence[ServoRun], effects: tuple[str, ...] = ()
) -> IdentifiedDrives:
    """The robot's drives and parameters by runs, whose servos are stated one each.

    effects: names of EFFECTS in unknowns.py that every joint may have.
    """
    servo = servos[0]
    given = given_table(robot, servo)
    parts, fits, identified = limbs(robot.chain), [], given.copy()
    for limb in parts:
        own = [run.of(limb.joints) for run in runs]
        unknown = unknowns(limb.chain, given[limb.joints], knowledge(robot, limb, servo, own, effects))
        fits.append(fit(limb.chain, unknown, own, regression_start(limb.chain, unknown, own)))
    shared, tied = tied_fits(parts, given, servo.kp, fits, runs)
    for limb, found in zip(parts, shared, strict=True):
        identified[limb.joints] = consistent(found.table)
    return IdentifiedDrives(robot, servo, given, identified, parts, shared, tuple(fits), tied)


def given_table(robot: Robot, servo: Servo) -> Array:
    """The table (n, WIDTH) of the model and the servos as stated."""
    delay = np.clip(0.0, servo.delay_lower, servo.delay_upper)
    table = plant_table(robot.parameters, delay, servo.limit)
    if servo.voltage is not None:
        table[:, STALL], table[:, BACK_EMF] = servo.voltage.stall, servo.voltage.back_emf
    return table


def knowledge(
    robot: Robot, limb: Limb, servo: Servo, runs: Sequence[ServoRun], effects: tuple[str, ...]
) -> Knowledge:
    """The prior of a limb's drives, and the sizes that are typical of its runs."""
    joints = limb.joints
    squares, speeds, poses, samples = np.zeros(len(joints)), np.zeros(len(joints)), [], 0
    reached = np.zeros(len(joints), dtype=bool)
    for run in runs:
        position, velocity = run.smoothed
        torque = run.kp * (run.command - position) - run.kd * velocity
        reached |= np.any(np.abs(torque) > servo.limit[joints], axis=0)
        squares += np.sum(np.minimum(np.abs(torque), servo.limit[joints]) ** 2, axis=0)
        speeds += np.sum(velocity**2, axis=0)
        samples += len(position)
        poses.append(position[:: max(1, len(position) // POSES)])
    table = without_friction(robot.parameters).reshape(robot.joints, -1)[joints]
    table[:, ARMATURE] = 0.0
    masses = mass_matrices(limb.chain, table.ravel(), np.concatenate(poses))
    return Knowledge(
        gain_spread=servo.spread[joints],
        ratio_spread=servo.ratio_spread,
        delay_lower=servo.delay_lower[joints],
        delay_upper=servo.delay_upper[joints],
        limit_spread=np.where(reached, servo.limit_spread[joints], 0.0),
        stall_spread=np.zeros(len(joints)) if servo.voltage is None else servo.voltage.spread[joints],
        torque_scale=np.sqrt(squares / samples) + 1e-9,
        speed_scale=np.sqrt(speeds / samples) + 1e-9,
        inertia=np.mean(np.diagonal(masses, axis1=1, axis2=2), axis=0),
        centre=np.mean(np.concatenate(poses), axis=0),
        reach=np.std(np.concatenate(poses), axis=0) + 1e-9,
        effects=effects,
    )


def consistent(table: Array) -> Array:
    """The table with links that can exist: second moments of mass about each centre of mass are positive.

    Where some are not, as of a slender link whose thin axis no torque shows, they become all but zero.
    """
    out = table.copy()
    for row in out:
        if not row[MASS] > 0:
            continue
        pseudo = pseudo_inertia(row[:INERTIAL])
        centre = pseudo[:3, 3] / row[MASS]
        values, axes = np.linalg.eigh(pseudo[:3, :3] - row[MASS] * np.outer(centre, centre))
        if values[0] < 0:
            second = (axes * np.maximum(values, THIN * values[-1])) @ axes.T
            inertia = np.trace(second) * np.eye(3) - second
            row[:INERTIAL] = inertial_parameters(row[MASS], centre, inertia)
    return out


def _figures(limb: Limb, found: Fit, servo: Servo) -> list[Figure]:
    """The figures of a limb's joints; viscous friction and the drive's damping as their sum too."""
    unknown, out = found.unknowns, []
    for place, (name, unit, joint) in enumerate(
        zip(unknown.names, unknown.units, unknown.joints, strict=True)
    ):
        if joint >= 0 and not name.startswith(PREFIX):
            figures = (found.values[place], found.std[place], unknown.mean[place], unknown.deviation[place])
            if name == "kd_scale":
                before = _std(unknown, joint, np.diag(unknown.deviation**2))
                figures = (*scale_of_kd(found, joint), 1.0, before)
            out.append(Figure(name, unit, limb.chain.joint_names[joint], *(float(each) for each in figures)))
    for joint, name in enumerate(limb.chain.joint_names):
        kd = servo.kd[limb.joints[joint]]
        if kd > 0:
            weights = _entry(unknown, joint, VISCOUS) + kd * _entry(unknown, joint, KD_SCALE)
            value = found.table[joint, VISCOUS] + kd * found.table[joint, KD_SCALE]
            std = float(np.sqrt(weights @ found.covariance @ weights))
            out.append(Figure("damping", "N·m·s/rad", name, float(value), std, None, None))
    return out


def scale_of_kd(found: Fit, joint: int) -> tuple[float, float]:
    """The scale of a joint's kd, part of which it shares with kp, and its deviation."""
    return float(found.table[joint, KD_SCALE]), _std(found.unknowns, joint, found.covariance)


def _std(unknown: Unknowns, joint: int, covariance: Array) -> float:
    """Deviation of the scale of a joint's kd by the covariance (m, m) of the unknowns."""
    weights = _entry(unknown, joint, KD_SCALE)
    return float(np.sqrt(weights @ covariance @ weights))


def _entry(unknown: Unknowns, joint: int, column: int) -> Array:
    """How an entry of the table depends on the unknowns, (m,)."""
    return unknown.basis.reshape(unknown.count, -1, WIDTH)[:, joint, column]


def _alike(figures: Sequence[Figure]) -> Alike:
    values, stds = np.array([each.value for each in figures]), np.array([each.std for each in figures])
    weights = 1 / stds**2
    mean = float(weights @ values / weights.sum())
    misfit = float(weights @ (values - mean) ** 2)
    joints = tuple(each.joint for each in figures)
    p_value = float(chi2.sf(misfit, len(figures) - 1))
    return Alike(figures[0].name, figures[0].unit, joints, mean, float(weights.sum() ** -0.5), p_value)


@dataclass(frozen=True)
class Simulation:
    """A run simulated from its first sample to its last, (N, n): rad, rad/s, N·m."""

    position: Array
    velocity: Array
    torque: Array


def simulated(parts: Sequence[Limb], table: Array, run: ServoRun) -> Simulation:
    """The run's command followed by the plant of a table (n, WIDTH), from the measured state at its start."""
    position, velocity = run.smoothed
    out = Simulation(*np.empty((3, *run.position.shape)))
    for limb in parts:
        joints = limb.joints
        own = run.of(joints)
        window = Window(
            own.command, own.kp, own.kd, 0, len(own.position), position[0, joints], velocity[0, joints]
        )
        ((found,),) = simulate(limb.chain, table[None, joints], [window], own.rate)
        for name in ("position", "velocity", "torque"):
            getattr(out, name)[:, joints] = getattr(found, name)
    return out


def position_rms(parts: Sequence[Limb], table: Array, runs: Sequence[ServoRun]) -> Array:
    """RMS (n,) rad of the simulated position less the measured one, all runs pooled."""
    squares = sum(np.sum((simulated(parts, table, run).position - run.position) ** 2, axis=0) for run in runs)
    return np.asarray(np.sqrt(squares / sum(len(run.position) for run in runs)))


def split(run: ServoRun, share: float) -> tuple[ServoRun, ServoRun]:
    """The first share of a run, and the rest of it."""
    cut = round(share * len(run.position))
    first, rest = (
        replace(run, position=run.position[part], command=run.command[part])
        for part in (slice(0, cut), slice(cut, None))
    )
    return first, rest
