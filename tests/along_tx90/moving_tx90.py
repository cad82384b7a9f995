"""What tests of drive, sensing and body share: the TX90 along a fast motion, what a family explains of it."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from identification.base_parameters import base_parameters
from identification.excitation.fourier import FourierSeries
from identification.filtering import decimation_step, edge_samples, zero_phase_lowpass
from identification.inverse_dynamics import inverse_dynamics
from identification.regressor import regressor
from testbench.effects import injection
from testbench.effects.logged import Logged
from testbench.effects.signature import Family
from testbench.log import Recording
from testbench.robot import Robot
from testbench.simulation import SimulationOptions, sample_reference, simulate

from ..exact_motion import exactly

RATE, STEP_SIZE, CUTOFF = 1000.0, 2e-4, 20.0


def fast_motion() -> FourierSeries:
    """A motion of every joint, fast enough for torques of the size the drives have; 2.5 s."""
    rng = np.random.default_rng(4)
    a, b = rng.normal(size=(2, 6, 4))
    a[:, 0] -= a.sum(axis=1)
    b[:, 0] -= b @ np.arange(1, 5)
    series = FourierSeries(0.4, np.array([0.3, 0.5, 0.8, 0.2, 0.6, -0.4]), a, b)
    _, speed, _ = series.evaluate(np.linspace(0, 2.5, 500))
    return series.scaled(np.array([1.5, 1.3, 1.8, 3.0, 3.0, 4.0]) / np.abs(speed).max(axis=0))


def recorded(
    arm: Robot, motion: FourierSeries, injected: Mapping[str, tuple[Any, ...]]
) -> dict[str, Recording]:
    """The arm simulated along the motion with each of the effects in turn, given as to ``injection``."""
    options = [
        SimulationOptions(physics_timestep=STEP_SIZE, effects=(injection(arm, *each),) if each else ())
        for each in injected.values()
    ]
    reference = sample_reference(motion, RATE)
    runs = simulate(arm, [reference] * len(options), options, nominal=arm)
    return dict(zip(injected, runs, strict=True))


def exact_run(arm: Robot, motion: FourierSeries) -> Logged:
    """A closed-form motion with the model's own torque."""
    time = np.arange(2500) / RATE
    return exactly(arm, time, CUTOFF, motion.evaluate(time))


def rms(x: np.ndarray) -> float:
    return float(np.sqrt(np.mean(x**2)))


def torque(arm: Robot, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray) -> np.ndarray:
    return inverse_dynamics(arm.chain, arm.parameters, q, dq, ddq)


def filtered(x: np.ndarray) -> np.ndarray:
    """What identification makes of torque and regressor, (N, n, ...): low-passed, decimated, (K, ...)."""
    low = zero_phase_lowpass(x, RATE, CUTOFF)
    edge = edge_samples(RATE, CUTOFF)
    kept = low[edge : len(x) - edge : decimation_step(RATE, CUTOFF)]
    return kept.reshape(kept.shape[0] * kept.shape[1], -1)


def base_space(run: Logged) -> np.ndarray:
    """Orthonormal basis of what the base parameters can explain, (K, b)."""
    columns = base_parameters(run.chain, ("inertial", "armature", "viscous", "coulomb", "offset")).columns
    return np.linalg.qr(filtered(regressor(run.chain, run.q, run.dq, run.ddq, columns)))[0]


def explained(run: Logged, family: Family, change: np.ndarray, projected: bool = True) -> tuple[float, int]:
    """Largest share of a change of torque (N, n) that a member explains, and which member it is."""
    basis = base_space(run) if projected else None
    wanted = filtered(change)[:, 0]
    left = wanted if basis is None else wanted - basis @ (basis.T @ wanted)
    shares = []
    for member in family.members:
        columns = filtered(member.spread(0, run.joints))
        columns = columns if basis is None else columns - basis @ (basis.T @ columns)
        found = np.linalg.lstsq(columns, left, rcond=1e-9)[0]
        shares.append(1 - np.sum((left - columns @ found) ** 2) / np.sum(left**2))
    return max(shares), int(np.argmax(shares))


def fitted(run: Logged, family: Family, change: np.ndarray, index: int = 0):
    """The contract's parameters of a member fitted to a change of torque, without the base parameters."""
    member = family.members[index]
    c = np.linalg.lstsq(filtered(member.spread(0, run.joints)), filtered(change)[:, 0], rcond=1e-9)[0]
    return family.parameters(member, c, 1e-6 * np.eye(len(c) + len(member.shape)))
