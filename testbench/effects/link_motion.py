"""The link of one joint along a logged motion of its motor, where the transmission is elastic or loose.

The encoder is on the motor, so q is logged and the link is at q - w with a windup w. To first order in w the
load there is load(q) - (dload/dq w + dload/d(dq) dw/dt + dload/d(ddq) d²w/dt²), so on the joint's own row

    M d²w/dt² + (dM/dt) dw/dt + (dload/dq) w + s(w, dw/dt) = load(q),

with the link's inertia M and the torque s that the transmission carries (Spong, "Modeling and control of
elastic joint robots", J. Dyn. Sys. 109(4), 1987). The other joints move as logged. Once w is simulated, the
change of the load is that of every joint's torque.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.inverse_dynamics import inverse_dynamics
from identification.kinematics import kernel
from identification.parameters import ARMATURE, INERTIAL, PER_JOINT

from .logged import Logged

Array = NDArray[np.float64]

# A link whose inertia re-identification has made too small or negative still moves like one.
LEAST_INERTIA_SHARE = 0.01
# Nor is any link less than this share of its rotor.
LEAST_ROTOR_SHARE = 1e-3
# Of the contact at the ends of a gap; teeth hardly bounce.
CONTACT_DAMPING_RATIO = 0.7
# Hz, at least, of the steps through the gap: a contact lasts a few milliseconds.
GAP_RATE = 4000.0
POSES, UNLIMITED_RANGE = 64, np.pi
# A spring that carries so many times the load does not hold the link: gravity tips it, or damping drives it.
HOLDS = 100.0
# Newton's steps within one of time, from where it would go without a load.
NEWTON = 4


def typical_link_inertia(run: Logged, joint: int) -> float:
    """The inertia that a joint's transmission moves, by the model as given: RMS over poses, kg·m² (kg).

    Not the rotor, which is on the other side. The same for every run of a robot, whatever was re-identified.
    """
    limits = run.limits
    lower = np.where(np.isfinite(limits.lower), limits.lower, -UNLIMITED_RANGE)
    upper = np.where(np.isfinite(limits.upper), limits.upper, UNLIMITED_RANGE)
    poses = np.random.default_rng(0).uniform(lower, upper, (POSES, run.joints))
    links = run.nominal.reshape(-1, PER_JOINT).copy()
    armature = float(links[joint, ARMATURE])
    links[:, INERTIAL:] = 0.0
    still, unit = np.zeros_like(poses), np.eye(run.joints)[joint]
    torque = [
        inverse_dynamics(run.chain, links.ravel(), poses, still, still + push, threads=1)[:, joint]
        for push in (unit, -unit)
    ]
    link = float(np.sqrt(np.mean(((torque[0] - torque[1]) / 2) ** 2)))
    return max(link, LEAST_ROTOR_SHARE * armature)


@dataclass(frozen=True)
class LinkRow:
    """What a link's own row of the equations of motion needs, along one run.

    load, by_position, by_velocity, inertia: (N,) load(q), dload/dq, dload/d(dq) and M.
    """

    run: Logged
    joint: int
    load: Array
    by_position: Array
    by_velocity: Array
    inertia: Array


def link_row(run: Logged, joint: int) -> LinkRow:
    """The row of one joint."""
    kept = run.kept_with_derivatives(joint)
    if "row" not in kept:
        own = [np.ascontiguousarray(part[:, joint]) for part in (run.load, *run.load_derivatives(joint))]
        own[3] = np.maximum(own[3], LEAST_INERTIA_SHARE * typical_link_inertia(run, joint))
        kept["row"] = tuple(own)
    return LinkRow(run, joint, *kept["row"])


def elastic_change(row: LinkRow, stiffness: float, damping: float, doubling: float = np.inf) -> Array:
    """Change of the torque where the transmission is a spring with a damper, (N, n) N·m.

    stiffness: N·m/rad, without a windup. damping: N·m·s/rad. doubling: rad, the windup at which a hardening
    spring carries twice what it would by that stiffness. Zero where the spring does not hold the link.
    """
    windup = np.empty((row.run.samples, 3))
    motion = row.load, row.by_position, row.by_velocity, row.inertia
    _elastic(*motion, stiffness, damping, stiffness / doubling**2, 1 / row.run.sample_rate, windup)
    if not _is_held(row, stiffness, windup[:, 0]):
        return np.zeros((row.run.samples, row.run.joints))
    return row.run.load_change(row.joint, -windup)


def _is_held(row: LinkRow, stiffness: float, depth: Array) -> bool:
    """Whether a spring, N·m/rad, wound up by (N,) rad carries no more than HOLDS times the load."""
    # False where the windup is infinite or undefined.
    return bool(stiffness * np.abs(depth).max() <= HOLDS * np.abs(row.load).max())


def loose_change(row: LinkRow, gap: float, contact: float) -> Array:
    """Change of the torque where the transmission has play, less that of its contact alone, (N, n) N·m.

    gap, contact: as of ``gap_windup``. Zero where the link never leaves the end of the gap that it starts at:
    that is an offset of the encoder and nothing more. Zero too where the contact does not hold the link.
    """
    nothing = np.zeros((row.run.samples, row.run.joints))
    loose = gap_windup(row, gap, contact)
    if (loose[:, 0] > 0).all() or (loose[:, 0] < 0).all():
        return nothing
    tight = _tight(row, contact)
    stiffness = (2 * np.pi * contact) ** 2 * float(row.inertia.max())
    deepest = np.maximum(np.abs(loose[:, 0]) - gap / 2, np.abs(tight[:, 0]))
    return row.run.load_change(row.joint, tight - loose) if _is_held(row, stiffness, deepest) else nothing


def _tight(row: LinkRow, contact: float) -> Array:
    """Windup and its derivatives (N, 3) without play; those of the last two contacts are kept."""
    kept, name = row.run.kept_with_derivatives(row.joint), ("tight", contact)
    if (found := kept.get(name)) is None:
        found = (gap_windup(row, 0.0, contact),)
        for old in [each for each in kept if each != "row"][:-1]:
            kept.pop(old, None)
        kept[name] = found
    return found[0]


def gap_windup(row: LinkRow, gap: float, contact: float) -> Array:
    """Windup and its two derivatives, (N, 3), of a link with this play, rad; 0 for its contact alone.

    contact: Hz, of the teeth with the link's own inertia.
    """
    windup = np.empty((row.run.samples, 3))
    substeps = 2 * int(np.ceil(GAP_RATE / (2 * row.run.sample_rate)))
    motion = row.load, row.by_position, row.by_velocity, row.inertia
    _through_gap(*motion, gap, contact, 1 / row.run.sample_rate, substeps, windup)
    return windup


@kernel
def _elastic(
    load: Array,
    by_position: Array,
    by_velocity: Array,
    inertia: Array,
    stiffness: float,
    damping: float,
    cubic: float,
    timestep: float,
    out: Array,
) -> None:
    """Windup and its two derivatives, (N, 3), from rest under the first load.

    Newmark's method of average acceleration: stable for any stiffness, without damping of its own; each step
    by Newton's, which a linear spring needs once. cubic: N·m/rad³.
    """
    solved = NEWTON if cubic > 0.0 else 1
    windup = 0.0
    for _ in range(2 * solved):
        carried = windup * (stiffness + by_position[0] + cubic * windup * windup)
        windup += (load[0] - carried) / (stiffness + by_position[0] + 3.0 * cubic * windup * windup)
    out[0, 0] = windup
    out[0, 1] = out[0, 2] = 0.0
    for t in range(1, load.size):
        k, d = stiffness + by_position[t], damping + by_velocity[t]
        place = out[t - 1, 0] + timestep * (out[t - 1, 1] + 0.25 * timestep * out[t - 1, 2])
        rate = out[t - 1, 1] + 0.5 * timestep * out[t - 1, 2]
        acceleration = 0.0
        for _ in range(solved):
            w = place + 0.25 * timestep * timestep * acceleration
            v = rate + 0.5 * timestep * acceleration
            stiffer = cubic * w * w
            effective = inertia[t] + 0.5 * timestep * (d + 0.5 * timestep * (k + 3.0 * stiffer))
            left = load[t] - (k + stiffer) * w - d * v - inertia[t] * acceleration
            acceleration += left / effective
        out[t, 0] = place + 0.25 * timestep * timestep * acceleration
        out[t, 1] = rate + 0.5 * timestep * acceleration
        out[t, 2] = acceleration


@kernel
def _through_gap(
    load: Array,
    by_position: Array,
    by_velocity: Array,
    inertia: Array,
    gap: float,
    contact: float,
    timestep: float,
    substeps: int,
    out: Array,
) -> None:
    """Windup and its two derivatives, (N, 3), of a link with play; without a gap the contact holds both ways.

    substeps: even, of a sample. The acceleration is the mean over a sample, as an impact is shorter than one.
    """
    half, step = 0.5 * gap, timestep / substeps
    frequency = 2 * np.pi * contact
    deep = load[0] / (frequency * frequency * inertia[0])
    windup = deep + half * np.sign(load[0])
    rate = middle = 0.0
    out[0, 0], out[0, 1] = windup, rate
    for t in range(1, load.size):
        before = middle
        for k in range(substeps):
            share = (k + 0.5) / substeps
            torque = load[t - 1] + share * (load[t] - load[t - 1])
            own = inertia[t - 1] + share * (inertia[t] - inertia[t - 1])
            deep = windup - min(max(windup, -half), half)
            stiffness = damping = push = 0.0
            if deep != 0.0:
                stiffness = frequency * frequency * own
                damping = 2 * CONTACT_DAMPING_RATIO * frequency * own
                push = stiffness * deep + damping * rate
                # Teeth push and never pull.
                if gap > 0.0 and push * deep < 0.0:
                    stiffness = damping = push = 0.0
            force = torque - push - by_position[t] * windup - by_velocity[t] * rate
            # As in simulation/transmission.py: stable for any contact, of second order.
            rate += step * force / (own + 0.5 * step * (damping + 0.5 * step * stiffness))
            windup += step * rate
            if 2 * (k + 1) == substeps:
                middle = rate
        out[t, 0], out[t, 1] = windup - 0.5 * step * rate, rate
        out[t - 1, 2] = (middle - before) / timestep
    out[-1, 2] = 0.0
