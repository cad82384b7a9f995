"""Transmission ripple: torque that is periodic in the joint's position."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

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
from .passive_device import passive_device
from .signature import Family, Logged, Member, Quantity, amplitude_and_phase, single_joint
from .size import scale_of

Array = NDArray[np.float64]

DESCRIPTION = EffectDescription(
    name="transmission_ripple",
    title="Transmission ripple",
    law="drive torque needed + amplitude·sin(cycles·q + phase); second_harmonic adds 30 % at twice the "
    "cycles, load_modulated scales it with 0.5 + 2.5·|tau_load| / torque limit",
    reference='Preissner, Royston & Shu, "A high-fidelity harmonic drive model", J. Dyn. Sys. 134(1), 2012',
    scope=Scope.JOINT,
    parameters=(
        EffectParameter("amplitude", "N·m", 0.0, np.inf, (0.005, 0.03), "torque_limit"),
        EffectParameter("cycles", "-", 0.5, 2000.0, (12.0, 40.0)),
        EffectParameter("phase", "rad", -2 * np.pi, 2 * np.pi, (0.0, 1.0)),
    ),
    laws=("harmonic", "second_harmonic", "load_modulated"),
    confused_with=("encoder_eccentricity", "gravity_spring"),
    of_friction=True,
)

SECOND_HARMONIC = 0.3
# Load at which load-modulated ripple has its full amplitude, in torque limits, and its share without load.
FULL_LOAD, UNLOADED = 0.2, 0.5
HARMONIC, SECOND, MODULATED = range(3)

# Cycles a revolution, or in 2 pi metres; what is slower is a spring's business. A strain wave gear's wave
# generator has two a turn of the motor, a ball screw one a lead of some millimetres.
LOWEST, HIGHEST, HIGHEST_OF_SLIDE = 5.0, 400.0, 1500.0
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
    full_load = FULL_LOAD * scale_of("torque_limit", simulated.robot, joint)
    values += [DESCRIPTION.laws.index(injection.law), full_load]
    return Action((hook(Stage.TORQUE, _ripple, joint, values),))


@hook_kernel
def _ripple(bus: int, parameters: int, state: int, joint: int) -> None:
    row, value = bus_row(bus, joint), vector(parameters, 5)
    amplitude, law = value[0], value[3]
    angle = value[1] * row[POSITION] + value[2]
    wave = amplitude * np.sin(angle)
    if law == SECOND:
        wave += SECOND_HARMONIC * amplitude * np.sin(2.0 * angle)
    elif law == MODULATED:
        wave *= UNLOADED + (1.0 - UNLOADED) * abs(row[LOAD]) / value[4]
    row[MOTOR_TORQUE] -= wave


def signature(runs: Sequence[Logged], joint: int | None, into: int | None) -> Family:
    """cos and sin of cycles·q, at the peaks of the residual's periodogram in position."""
    joint = require_joint(DESCRIPTION.name, joint, runs[0].joints)
    found, resolution = periodogram_peaks(runs, joint)
    free = np.full(2, np.inf)

    def member(shape: Mapping[str, float]) -> Member:
        angles = [shape["cycles"] * run.q[:, joint] for run in runs]
        columns = [np.column_stack([np.cos(angle), np.sin(angle)]) for angle in angles]
        return Member(dict(shape), (joint,), single_joint(columns), -free, free)

    def parameters(member: Member, c: Array, covariance: Array) -> dict[str, Quantity]:
        amplitude, amplitude_std, phase, phase_std = amplitude_and_phase(
            float(c[0]), float(c[1]), covariance[:2, :2]
        )
        cycles_std = float(np.sqrt(max(covariance[2, 2], 0.0))) if len(covariance) > 2 else 0.0
        return {
            "amplitude": Quantity(amplitude, amplitude_std, "N·m"),
            "cycles": Quantity(member.shape["cycles"], cycles_std, "-"),
            "phase": Quantity(phase, phase_std, "rad"),
        }

    members = tuple(member({"cycles": cycles}) for cycles in found)
    bounds = (max(LOWEST, found.min() - resolution), found.max() + resolution)
    # The grid's spacing is a quarter of the resolution.
    tried = round((_highest(runs, joint) - LOWEST) / (4 * resolution))
    return Family(DESCRIPTION.name, joint, members, parameters, {"cycles": bounds}, member, picked_from=tried)


def _highest(runs: Sequence[Logged], joint: int) -> float:
    return HIGHEST_OF_SLIDE if runs[0].chain.is_slide[joint] else HIGHEST


def periodogram_peaks(runs: Sequence[Logged], joint: int) -> tuple[Array, float]:
    """Cycles a revolution at the highest peaks of the residual's least-squares periodogram, (PEAKS,).

    Also the spacing of its grid, a quarter of the resolution that the travelled range allows.
    """
    angles, residuals = [], []
    for run in runs:
        step = max(int(run.sample_rate / PERIODOGRAM_RATE), 1)
        count = run.samples // step * step
        # Block means keep what is slower than the coarser grid and drop noise.
        means = [x[:count, joint].reshape(-1, step).mean(axis=1) for x in (run.q, run.residual, run.dq)]
        moving = np.abs(means[2]) > MOVING * np.abs(means[2]).max(initial=0.0)
        angles.append(means[0][moving])
        residuals.append(means[1][moving] - means[1][moving].mean() if moving.any() else means[1][:0])
    angle, residual = np.concatenate(angles), np.concatenate(residuals)
    travelled = float(np.ptp(angle)) if angle.size else 0.0
    spacing = float(np.clip(np.pi / (2 * max(travelled, 1e-9)), 0.05, 2.0))
    cycles, power = _periodogram(angle, residual, spacing, _highest(runs, joint))
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
    amplitude, cycles, phase = (injection.values[name] for name in ("amplitude", "cycles", "phase"))
    sentences = []
    harmonics = [(amplitude, 1.0, phase)]
    if injection.law == "second_harmonic":
        harmonics.append((SECOND_HARMONIC * amplitude, 2.0, 2 * phase))
    if injection.law == "load_modulated":
        sentences.append("MuJoCo's cogging torque does not depend on the load")
    if cycles != round(cycles):
        sentences.append(f"MuJoCo's cogging torque has whole cycles: {round(cycles)} instead of {cycles:g}")
    for size, order, angle in harmonics:
        cogging = (size, order * round(cycles), angle + np.pi)
        passive_device(spec, robot, joint, "ripple", cogging=cogging)
    return tuple(sentences)
