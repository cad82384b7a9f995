"""What tests of signatures share: an arm along a motion in closed form, and what a family explains of it."""

from dataclasses import replace

import numpy as np

from identification.filtering import zero_phase_lowpass
from identification.inverse_dynamics import inverse_dynamics
from identification.parameters import DEFAULT_GROUPS, group_columns
from identification.regressor import regressor
from testbench.effects.signature import Family, Logged
from testbench.robot import Robot

from .exact_motion import exactly

RATE, CUTOFF = 500.0, 40.0
TIME = np.arange(6000) / RATE
FINENESS = 10
FINE_STEP = 1 / (RATE * FINENESS)
FINE = np.arange(len(TIME) * FINENESS) * FINE_STEP
J, K = 1, 2  # the joint with the effect, and the other of a pair


def motion() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """q, dq, ddq (N, 3) of sums of sines up to 3 Hz, in closed form."""
    q, dq, ddq = (np.zeros((len(TIME), 3)) for _ in range(3))
    rng = np.random.default_rng(4)
    for frequency in (0.11, 0.27, 0.53, 1.1, 2.1, 3.0):
        w = 2 * np.pi * frequency
        amplitude, phase = rng.uniform(0.3, 1.0, 3) / (1 + 2 * frequency**1.5), rng.uniform(0, 6, 3)
        angle = w * TIME[:, None] + phase
        q += amplitude * np.sin(angle)
        dq += amplitude * w * np.cos(angle)
        ddq -= amplitude * w**2 * np.sin(angle)
    return q, dq, ddq


Q, DQ, DDQ = motion()


def closed_form_run(arm: Robot) -> Logged:
    """The motion with the torque that the model needs for it."""
    return exactly(arm, TIME, CUTOFF, (Q, DQ, DDQ))


def filtered(columns: np.ndarray) -> np.ndarray:
    """Columns (N, n, k) as a fit sees them, stacked (M, k)."""
    low = zero_phase_lowpass(columns, RATE, CUTOFF / 2)[100:-100:5]
    return low.reshape(-1, columns.shape[2])


def base_space(arm: Robot) -> np.ndarray:
    """Orthonormal basis of what standard parameters explain, without the offset, which effects have too."""
    columns = group_columns(3, DEFAULT_GROUPS)
    return np.linalg.qr(filtered(regressor(arm.chain, Q, DQ, DDQ, columns)))[0]


def unexplained(base: np.ndarray, torque: np.ndarray, family: Family) -> tuple[float, dict[str, float]]:
    """Share of a change of torque (N, n) that base regressor and the best member leave, by power.

    Also that member's parameters.
    """
    wanted = filtered(torque[:, :, None])[:, 0]
    wanted = wanted - base @ (base.T @ wanted)
    best: tuple[float, dict[str, float]] = (np.inf, {})
    for member in family.members:
        columns = filtered(member.spread(0, 3))
        columns = columns - base @ (base.T @ columns)
        c = np.linalg.lstsq(columns, wanted, rcond=1e-9)[0]
        c = np.clip(c, member.lower, member.upper)
        left = float(np.sum((wanted - columns @ c) ** 2) / np.sum(wanted**2))
        if left < best[0]:
            size = member.count + len(family.refine)
            found = family.parameters(member, c, 1e-6 * np.eye(size))
            best = (left, {name: float(each.value) for name, each in found.items()})
    return best


def single(family: Family, **shape: float) -> Family:
    """The family with no other member than that of this shape."""
    return replace(family, members=(family.member(shape),))


def on_joint(torque: np.ndarray, joint: int = J) -> np.ndarray:
    """(N, 3) with the torque on one joint."""
    return torque[:, None] * np.eye(3)[joint]


def link_side(arm: Robot, joint: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Standard parameters without rotors and friction, the joint's load (N,) and its link's inertia (N,)."""
    table = arm.parameters.reshape(3, 14).copy()
    table[:, 10:] = 0
    links = table.ravel()
    load = inverse_dynamics(arm.chain, links, Q, DQ, DDQ)[:, joint]
    weightless = replace(arm.chain, gravity=np.zeros(3))
    inertia = inverse_dynamics(weightless, links, Q, 0 * Q, 0 * Q + np.eye(3)[joint])[:, joint]
    return links, load, inertia
