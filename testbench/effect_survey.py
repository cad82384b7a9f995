"""How every effect shows in the simulated robot, and which signatures explain it: measured, not listed."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d
from scipy.optimize import lsq_linear, minimize_scalar

from identification.base_parameters import base_parameters
from identification.excitation.design import DesignOptions, random_excitation
from identification.filtering import decimation_step, edge_samples, zero_phase_lowpass
from identification.parameters import GROUPS
from identification.regressor import regressor

from .effects import effect, effects, injection
from .effects.base import Injection, Scope
from .effects.logged import Logged, logged_run
from .effects.signature import Family, Member
from .robot import Robot
from .simulation import SimulationOptions, sample_reference, simulate

Array = NDArray[np.float64]

# The standard excitation: a seeded Fourier series of 10 s.
EXCITATION = DesignOptions(harmonics=12, base_frequency=0.1, limit_share=0.9, seed=3)
PERIODS, RATE, CUTOFF = 1, 1000.0, 20.0
PHYSICS_TIMESTEP = 2e-4
# The position keeps twice the band of the equations, so that its filter leaves that band flat.
POSITION_BAND = 2.0
# A joint slower than this (rad/s) does not count, nor within half a period of the cut-off before and after:
# there its own friction jumps.
DEAD_ZONE, REACH_PERIODS = 0.02, 0.5
# A saturation that no torque reaches shows nothing: the limit as a share of the largest torque.
SATURATED_SHARE = 0.75
# A signature that explains less on the grid of its shapes is none between them either.
WORTH_REFINING = 0.1


@dataclass(frozen=True)
class Sighting:
    """One effect seen in the simulated robot. K samples on the decimated grid.

    injection: what was put in. shown: the joint that is looked at. time: (K,) s. q, dq: (K,) of that joint.
    change: (K,) N·m, torque less what the true model predicts along the motion, less the same of a healthy
    robot, which leaves out what filtering does to any log.
    left: (K,) N·m, what of it re-identified parameters cannot take up. survives: RMS of left over change,
    all joints, each in shares of its torque limit. explained: effect to the share (0 to 1) of what is left
    that its signature at the same place explains.
    """

    injection: Injection
    shown: int
    time: Array
    q: Array
    dq: Array
    change: Array
    left: Array
    survives: float
    explained: dict[str, float]


def survey(robot: Robot, joint: int = 1, threads: int | None = None) -> dict[str, Sighting]:
    """Every effect of the catalogue at its typical size, on one joint, along the standard excitation.

    joint: index; a pair is this joint and the next. Raises InputError for a robot that cannot be excited.
    """
    motion = random_excitation(robot.chain, robot.parameters, robot.limits, EXCITATION, None).trajectory
    reference = sample_reference(motion, RATE, PERIODS)
    healthy = simulate(robot, [reference], SimulationOptions(physics_timestep=PHYSICS_TIMESTEP))[0]
    peak = float(np.abs(healthy.torque[:, joint]).max())
    injected = {name: _typical(robot, name, joint, peak) for name in effects()}
    options = [
        SimulationOptions(physics_timestep=PHYSICS_TIMESTEP, effects=(each,)) for each in injected.values()
    ]
    recordings = simulate(robot, [reference] * len(options), options, threads=threads)
    band = POSITION_BAND * CUTOFF
    floor = logged_run(robot, healthy, robot.parameters, band).residual
    sightings = {}
    for (name, each), recording in zip(injected.items(), recordings, strict=True):
        run = logged_run(robot, recording, robot.parameters, band)
        sightings[name] = _sighting(robot, each, joint, replace(run, tau=run.tau - floor))
    return sightings


def _typical(robot: Robot, name: str, joint: int, peak: float) -> Injection:
    """The effect in the middle of its typical range."""
    scope = effect(name).DESCRIPTION.scope
    values: Mapping[str, float] = {"limit": SATURATED_SHARE * peak} if name == "torque_saturation" else {}
    first = None if scope is Scope.ROBOT else joint + 1
    return injection(robot, name, first, values, into=joint + 2 if scope is Scope.PAIR else None)


def _sighting(robot: Robot, injected: Injection, joint: int, run: Logged) -> Sighting:
    """What the run shows, and how much of it each signature at the same place explains."""
    scale = np.where(np.isfinite(robot.limits.torque), robot.limits.torque, 1.0)
    reach = 2 * round(REACH_PERIODS * RATE / CUTOFF) + 1
    resting = maximum_filter1d(np.abs(run.dq) <= DEAD_ZONE, reach, axis=0)
    used = _decimated(np.where(resting, 0.0, 1.0), filtered=False)
    weights = used / scale
    columns = base_parameters(run.chain, tuple(GROUPS)).columns
    base = _weighted(regressor(run.chain, run.q, run.dq, run.ddq, columns), weights)
    basis = np.linalg.qr(base / np.maximum(np.linalg.norm(base, axis=0), 1e-300))[0]
    change = _weighted(run.residual, weights)[:, 0]
    left = change - basis @ (basis.T @ change)
    explained = {}
    for name, each in effects().items():
        scope = each.DESCRIPTION.scope
        place = (None, None) if scope is Scope.ROBOT else (joint, joint + 1 if scope is Scope.PAIR else None)
        explained[name] = _explained(each.signature([run], *place), run, weights, basis, left)
    seen = _decimated(run.residual)
    remaining = left.reshape(weights.shape) * scale
    # Base tilt shows at the joint that gravity does not load.
    shown = 0 if injected.effect == "base_tilt" else joint
    moving = used[:, shown] > 0
    return Sighting(
        injection=injected,
        shown=shown,
        time=_decimated(run.time[:, None], filtered=False)[:, 0][moving],
        q=_decimated(run.q, filtered=False)[moving, shown],
        dq=_decimated(run.dq, filtered=False)[moving, shown],
        change=seen[moving, shown],
        left=remaining[moving, shown],
        survives=float(np.linalg.norm(left)) / max(float(np.linalg.norm(change)), 1e-300),
        explained=explained,
    )


def _explained(family: Family, run: Logged, weights: Array, basis: Array, left: Array) -> float:
    """Largest share of ``left`` that one member, its coefficients in bounds, explains beside the parameters.

    A family on continuous shapes is searched along the first between the neighbours of each law's best too.
    """

    def share(member: Member) -> float:
        columns = np.zeros((*weights.shape, member.count))
        rows = list(member.rows)
        columns[:, rows] = _decimated(member.columns[0]) * weights[:, rows, None]
        flat = columns.reshape(-1, member.count)
        flat = flat - basis @ (basis.T @ flat)
        norms = np.linalg.norm(flat, axis=0)
        seen = norms > 0
        if not seen.any():
            return 0.0
        bounds = member.lower[seen] * norms[seen], member.upper[seen] * norms[seen]
        found = lsq_linear(flat[:, seen] / norms[seen], left, bounds, method="bvls").cost
        return 1 - 2 * float(found) / float(np.sum(left**2))

    laws = dict.fromkeys(member.law for member in family.members)
    of_each = ([member for member in family.members if member.law == law] for law in laws)
    return max((_of_law(family, members, share) for members in of_each), default=0.0)


def _of_law(family: Family, members: Sequence[Member], share: Callable[[Member], float]) -> float:
    """The largest share of a law's members, searched as of ``_explained``."""
    shares = [share(member) for member in members]
    best = max(shares)
    if family.member is None or not family.refine or best < WORTH_REFINING:
        return best
    name, shape = next(iter(family.refine)), members[shares.index(best)].shape
    if name not in shape:
        return best
    grid = sorted({member.shape[name] for member in members})
    near = grid.index(shape[name])
    around = grid[max(near - 1, 0)], grid[min(near + 1, len(grid) - 1)]
    make = family.member
    refined = minimize_scalar(
        lambda value: -share(make(shape | {name: value})),
        bounds=around,
        method="bounded",
        options={"maxiter": 16},
    )
    return max(best, -float(refined.fun))


def _weighted(x: Array, weights: Array) -> Array:
    """Filtered, decimated rows of x (N, n) or (N, n, k), each times its weight: (K n, k)."""
    low = _decimated(x)
    return (low.reshape(*weights.shape, -1) * weights[:, :, None]).reshape(weights.size, -1)


def _decimated(x: Array, filtered: bool = True) -> Array:
    """Every so-many-th sample away from the edges, low-passed first unless ``filtered`` is False."""
    low = zero_phase_lowpass(x, RATE, CUTOFF) if filtered else x
    edge = edge_samples(RATE, CUTOFF)
    return low[edge : len(x) - edge : decimation_step(RATE, CUTOFF)]
