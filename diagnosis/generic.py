"""Structure that no named effect claims: what a smooth function of the motion would explain.

Each family is a set of functions of one joint's own position, velocity, direction and time, free of
any law. Where such a set predicts runs that were left out and no effect of the catalogue does as
well, the cause is unknown, and the family says in which regime it shows.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from testbench.effects.signature import Family, Logged, Member, Quantity, single_joint

from .candidates import Candidate, candidate
from .preparation import Prepared

Array = NDArray[np.float64]

REGIMES = ("position", "velocity", "position and direction", "acceleration", "run time", "neighbour's motion")


def generic_candidates(prepared: Prepared) -> list[Candidate]:
    """One candidate a joint and regime."""
    logged = [run.logged for run in prepared.runs]
    found = []
    for joint in range(prepared.joints):
        for regime in REGIMES:
            columns = [_columns(run, joint, regime, logged) for run in logged]
            k = columns[0].shape[1]
            if k == 0:
                continue
            member = Member({}, (joint,), single_joint(columns), np.full(k, -np.inf), np.full(k, np.inf))
            family = Family(f"unknown: {regime}", joint, (member,), _no_parameters)
            found.append(candidate(prepared, family, member))
    return found


def _no_parameters(member: Member, c: Array, covariance: Array) -> dict[str, Quantity]:
    return {}


def _columns(run: Logged, joint: int, regime: str, runs: Sequence[Logged]) -> Array:
    """Functions of the motion (N, k), each of unit size or so."""
    q, v, a = run.q[:, joint], run.dq[:, joint], run.ddq[:, joint]
    top = max(max(float(np.max(np.abs(r.dq[:, joint]))) for r in runs), 1e-6)
    s = v / top
    if regime == "position":
        return np.column_stack([f(m * q) for m in (1, 2, 3) for f in (np.sin, np.cos)])
    if regime == "velocity":
        bumps = [np.sign(v) * np.exp(-np.abs(s) / width) for width in (0.02, 0.08, 0.3)]
        return np.column_stack([*bumps, s * np.abs(s), s**3, np.abs(s)])
    if regime == "position and direction":
        return np.column_stack([f(m * q) * np.sign(v) for m in (1, 2) for f in (np.sin, np.cos)])
    if regime == "acceleration":
        largest = max(float(np.max(np.abs(a))), 1e-6)
        return np.column_stack([a * np.abs(a) / largest**2, np.gradient(a) * run.sample_rate / largest])
    if regime == "run time":
        total = run.time[-1] - run.time[0]
        u = (run.time - run.time[0]) / max(total, 1e-9)
        return np.column_stack([u, u * np.sign(v), u * s, u**2 * s])
    others = [k for k in (joint - 1, joint + 1) if 0 <= k < run.joints]
    return np.column_stack([f for k in others for f in (run.dq[:, k], np.sign(run.dq[:, k]))])
