"""Transmission ripple: torque that is periodic in the joint's position."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.chain import Chain

from ..robot import Robot
from .action import (
    LOAD,
    MOTOR_TORQUE,
    POSITION,
    Action,
    SimulatedRobot,
    Stage,
    bus_row,
    hook,
    hook_kernel,
    require_joint,
    vector,
)
from .base import EffectDescription, EffectParameter, Injection, Scope
from .columns import on_one_joint
from .experiment import Experiment
from .passive_device import passive_device
from .signature import Family, Logged, Member, Quantity, wave_parameters

Array = NDArray[np.float64]

HARMONIC, TWO_WAVES, LOAD_MODULATED = "harmonic", "two_waves", "load_modulated"

DESCRIPTION = EffectDescription(
    name="transmission_ripple",
    title="Transmission ripple",
    law="drive torque needed + amplitude·sin(cycles·q + phase); two_waves adds "
    "second_amplitude·sin(second_cycles·q + second_phase), load_modulated scales it with unloaded + "
    "(1 - unloaded)·|tau_load| / full_load",
    reference='Preissner, Royston & Shu, "A high-fidelity harmonic drive model", J. Dyn. Sys. 134(1), 2012',
    scope=Scope.JOINT,
    parameters=(
        EffectParameter("amplitude", "N·m", 0.0, np.inf, (0.005, 0.03), "torque_limit"),
        EffectParameter("cycles", "-", 0.5, 2000.0, (12.0, 40.0)),
        EffectParameter("phase", "rad", -2 * np.pi, 2 * np.pi, (0.0, 1.0)),
        EffectParameter("second_amplitude", "N·m", 0.0, np.inf, (0.0015, 0.009), "torque_limit", TWO_WAVES),
        EffectParameter("second_cycles", "-", 0.5, 4000.0, (24.0, 80.0), law=TWO_WAVES),
        EffectParameter("second_phase", "rad", -2 * np.pi, 2 * np.pi, (0.0, 2.0), law=TWO_WAVES),
        EffectParameter("unloaded", "-", 0.0, 1.0, (0.5, 0.5), law=LOAD_MODULATED),
        EffectParameter("full_load", "N·m", 1e-9, np.inf, (0.2, 0.2), "torque_limit", LOAD_MODULATED),
    ),
    laws=(HARMONIC, TWO_WAVES, LOAD_MODULATED),
    confused_with=("encoder_eccentricity", "gravity_spring"),
    shown_by=(Experiment.TWO_SLOW_SPEEDS,),
    of_friction=True,
    # No motion is free of a ripple of a hundredth: an amplitude of .8 of this share is beyond it.
    least=0.03,
)

# Share of a ripple that a joint without load has, where it goes with the load: looked for first.
LIKELY_UNLOADED = 0.5

# Cycles a revolution, or in 2 pi metres; what is slower is a spring's business. A strain wave gear's wave
# generator has two a turn of the motor, a ball screw one a lead of some millimetres.
LOWEST, HIGHEST, HIGHEST_OF_SLIDE = 5.0, 400.0, 1500.0
# Cycles a revolution: the teeth of any gear are more, and what is slower is a law of the joint's position.
SLOWEST = 10.0
PEAKS = 4
# Of the position, within the shortest cycle.
CELLS = 10
# Slower than this share of its greatest speed a joint shows no ripple, only friction's reversal.
MOVING = 0.05
PERIODOGRAM_RATE = 200.0


def action(injection: Injection, simulated: SimulatedRobot) -> Action:
    """A torque at the motor that depends on its position."""
    joint = require_joint(DESCRIPTION.name, injection.joint, simulated.robot.joints)
    values = [injection.values[name] for name in ("amplitude", "cycles", "phase")]
    # A second wave of nothing, where there is none.
    second = ("second_amplitude", "second_cycles", "second_phase")
    values += [injection.values.get(name, 0.0) for name in second]
    # And one that is the same at any load.
    unloaded, full_load = (injection.values.get(name, 1.0) for name in ("unloaded", "full_load"))
    values += [unloaded, (1.0 - unloaded) / full_load]
    return Action((hook(Stage.TORQUE, _ripple, joint, values),))


@hook_kernel
def _ripple(bus: int, parameters: int, state: int, joint: int) -> None:
    row, value = bus_row(bus, joint), vector(parameters, 8)
    q = row[POSITION]
    wave = value[0] * np.sin(value[1] * q + value[2]) + value[3] * np.sin(value[4] * q + value[5])
    row[MOTOR_TORQUE] -= wave * (value[6] + value[7] * abs(row[LOAD]))


def signature(runs: Sequence[Logged], joint: int | None, into: int | None) -> Family:
    """cos and sin of cycles·q, at the peaks of the residual's periodogram in position.

    By its other laws with those of a second wave, or in proportion to a share of the load.
    """
    joint = require_joint(DESCRIPTION.name, joint, runs[0].joints)
    return ripples(runs, joint, *periodogram_peaks(runs, joint))


def ripples(runs: Sequence[Logged], joint: int, peaks: Array, resolution: float) -> Family:
    """The same at given peaks, as of ``peaks_of``: two waves no nearer than the range can resolve."""

    def member(shape: Mapping[str, float]) -> Member:
        shape = _apart(shape, 4 * resolution)
        cycles = np.array([shape[name] for name in ("cycles", "second_cycles") if name in shape])

        def columns(run: Logged) -> Array:
            angles = run.q[:, joint, None] * cycles
            # cos and sin of the first, then of the second.
            waves: Array = np.stack([np.cos(angles), np.sin(angles)], axis=-1).reshape(run.samples, -1)
            if "unloaded" in shape:
                loaded = np.abs(run.load[:, joint, None]) / shape["full_load"]
                waves *= shape["unloaded"] + (1 - shape["unloaded"]) * loaded
            return waves

        free = np.full(2 * len(cycles), np.inf)
        law = LOAD_MODULATED if "unloaded" in shape else TWO_WAVES if len(cycles) > 1 else None
        return Member(dict(shape), (joint,), on_one_joint(runs, columns), -free, free, law)

    def richer(plain: Member) -> tuple[Member, ...]:
        shapes: list[dict[str, float]] = [{"second_cycles": 2 * plain.shape["cycles"]}]
        load = float(np.sqrt(np.mean(np.concatenate([run.load[:, joint] for run in runs]) ** 2)))
        if load > 0:
            shapes.append({"unloaded": LIKELY_UNLOADED, "full_load": load})
        return tuple(member({**plain.shape, **more}) for more in shapes)

    members = tuple(member({"cycles": cycles}) for cycles in peaks)
    bounds = (max(LOWEST, peaks.min() - resolution), peaks.max() + resolution)
    # The grid's spacing is a quarter of the resolution.
    tried = round((highest_cycles(runs[0].chain, joint) - LOWEST) / (4 * resolution))
    return Family(
        effect=DESCRIPTION.name,
        joint=joint,
        members=members,
        parameters=_parameters,
        refine={"cycles": bounds, "second_cycles": bounds, "unloaded": (0.0, 1.0)},
        member=member,
        picked_from=tried,
        richer=richer,
    )


def _apart(shape: Mapping[str, float], least: float) -> dict[str, float]:
    """The shape with its second wave, if it has one, so far from the first: nearer ones cancel each other."""
    found = dict(shape)
    if "second_cycles" in found:
        first, second = found["cycles"], found["second_cycles"]
        below = second < first and first - least > LOWEST
        found["second_cycles"] = min(second, first - least) if below else max(second, first + least)
    return found


def _parameters(member: Member, c: Array, covariance: Array) -> dict[str, Quantity]:
    waves, shape = wave_parameters(c, covariance, "N·m"), member.shape
    # Of the shapes that are searched, after the coefficients.
    std = np.sqrt(np.maximum(np.diag(covariance)[len(c) :], 0.0))
    found = {"amplitude": waves.pop("amplitude"), "cycles": Quantity(shape["cycles"], float(std[0]), "-")}
    if member.law == TWO_WAVES:
        found["second_cycles"] = Quantity(shape["second_cycles"], float(std[1]), "-")
    if member.law == LOAD_MODULATED:
        found["unloaded"] = Quantity(shape["unloaded"], float(std[2]), "-")
        found["full_load"] = Quantity(shape["full_load"], 0.0, "N·m")
    return found | waves


def highest_cycles(chain: Chain, joint: int) -> float:
    """The most that are looked for."""
    return HIGHEST_OF_SLIDE if chain.is_slide[joint] else HIGHEST


def periodogram_peaks(runs: Sequence[Logged], joint: int) -> tuple[Array, float]:
    """``peaks_of`` the residual that re-identified parameters leave."""
    signals: tuple[list[Array], list[Array], list[Array]] = ([], [], [])
    for run in runs:
        step = max(int(run.sample_rate / PERIODOGRAM_RATE), 1)
        count = run.samples // step * step
        # Block means keep what is slower than the coarser grid and drop noise.
        means = [x[:count, joint].reshape(-1, step).mean(axis=1) for x in (run.q, run.dq, run.residual)]
        for found, mean in zip(signals, means, strict=True):
            found.append(mean)
    return peaks_of(*signals, highest_cycles(runs[0].chain, joint))


def peaks_of(
    angles: Sequence[Array], speeds: Sequence[Array], residuals: Sequence[Array], highest: float
) -> tuple[Array, float]:
    """Cycles a revolution at the highest peaks of a residual's least-squares periodogram, (PEAKS,).

    Also the spacing of its grid, a quarter of the resolution that the travelled range allows. angles, speeds,
    residuals: a run (N,). highest: the most cycles.
    """
    moved, left = [], []
    for own, speed, residual in zip(angles, speeds, residuals, strict=True):
        moving = np.abs(speed) > MOVING * np.abs(speed).max(initial=0.0)
        moved.append(own[moving])
        left.append(residual[moving] - residual[moving].mean() if moving.any() else residual[:0])
    angle, residual = np.concatenate(moved), np.concatenate(left)
    travelled = float(np.ptp(angle)) if angle.size else 0.0
    spacing = float(np.clip(np.pi / (2 * max(travelled, 1e-9)), 0.05, 2.0))
    cycles, power = _periodogram(angle, residual, spacing, highest)
    inner = power[1:-1]
    tops = 1 + np.flatnonzero((inner >= power[:-2]) & (inner > power[2:]))
    if not tops.size:
        tops = np.array([int(np.argmax(power))])
    best = tops[np.argsort(power[tops])[::-1][:PEAKS]]
    return np.maximum(cycles[np.sort(best)], LOWEST), spacing


def _periodogram(angle: Array, residual: Array, spacing: float, highest: float) -> tuple[Array, Array]:
    """Cycles (k,) from just below LOWEST on, no further apart, and |sum residual exp(i cycles angle)|² there.

    By the Fourier transform of the residual's sums over narrow cells of the position.
    """
    width = 2 * np.pi / (CELLS * highest)
    count = max(int(np.ceil(2 * np.pi / (spacing * width))), 1)
    place = ((angle - angle.min(initial=np.inf)) / width).astype(np.int64) % count
    power = np.square(np.abs(np.fft.rfft(np.bincount(place, residual, count))))
    cycles = float(2 * np.pi / (count * width)) * np.arange(power.size, dtype=np.float64)
    wanted = (cycles >= LOWEST - 2 * spacing) & (cycles < highest)
    return cycles[wanted], power[wanted]


def write(spec: Any, robot: Robot, injection: Injection) -> tuple[str, ...]:
    """The cogging torque of a passive dcmotor, whole cycles a revolution."""
    joint = require_joint(DESCRIPTION.name, injection.joint, robot.joints)
    sentences = []
    if injection.law == LOAD_MODULATED:
        sentences.append("MuJoCo's cogging torque does not depend on the load")
    for wave in ("", *(["second_"] if injection.law == TWO_WAVES else [])):
        amplitude, cycles, phase = (
            injection.values[wave + name] for name in ("amplitude", "cycles", "phase")
        )
        if cycles != round(cycles):
            sentences.append(
                f"MuJoCo's cogging torque has whole cycles: {round(cycles)} instead of {cycles:g}"
            )
        passive_device(spec, robot, joint, "ripple", cogging=(amplitude, round(cycles), phase + np.pi))
    return tuple(sentences)
