"""Where the gap lies: by joint, and within a joint by the regime of the motion.

A regime is a set of samples: near reversal, slow, fast, moving forward or back, heavily loaded,
accelerating hard, early or late in the run. Its concentration is the mean square of the residual in it
over that of the joint; its share is its part of the joint's sum of squares.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .evidence import Design, Fit
from .findings import Share
from .preparation import Prepared, Run

Array = NDArray[np.float64]

# Blocks of this many seconds are drawn anew for the intervals of shares: longer than residuals remember.
BLOCK_SECONDS = 0.5
DRAWS = 200


@dataclass(frozen=True)
class RegimeShare:
    """One regime of one joint. share: of the joint's gap, with a 90 % interval. concentration: see above."""

    joint: int
    regime: str
    share: float
    low: float
    high: float
    concentration: float
    rms: float


def regimes(run: Run, joint: int, top_speed: float, top_acceleration: float) -> dict[str, NDArray[np.bool_]]:
    """The samples (M,) of each regime of one joint in one run."""
    v, a = run.dq[:, joint], run.ddq[:, joint]
    speed, hard = np.abs(v) / top_speed, np.abs(a) / top_acceleration
    load = np.abs(run.filtered(run.logged.load[:, joint]))
    middle = np.median(run.time)
    return {
        "velocity reversal": speed < 0.1,
        "slow": (speed >= 0.1) & (speed < 0.5),
        "fast": speed >= 0.5,
        "moving forward": v > 0,
        "moving back": v < 0,
        "high load": load > np.median(load),
        "hard acceleration": hard > 0.5,
        "early in the run": run.time < middle,
        "late in the run": run.time >= middle,
    }


def regime_shares(
    prepared: Prepared, residual: Sequence[Array], used: Sequence[NDArray[np.bool_]]
) -> list[RegimeShare]:
    """Every regime of every joint, for a residual a run (M, n)."""
    found = []
    rng = np.random.default_rng(0)
    for joint in range(prepared.joints):
        speeds = [np.abs(run.dq[:, joint]) for run in prepared.runs]
        accelerations = [np.abs(run.ddq[:, joint]) for run in prepared.runs]
        top_speed = max(max(float(s.max()) for s in speeds), 1e-9)
        top_acceleration = max(max(float(np.quantile(a, 0.98)) for a in accelerations), 1e-9)
        squares, members, blocks = [], [], []
        for index, run in enumerate(prepared.runs):
            ok = used[index][:, joint]
            squares.append(residual[index][ok, joint] ** 2)
            sets = regimes(run, joint, top_speed, top_acceleration)
            members.append({name: chosen[ok] for name, chosen in sets.items()})
            blocks.append((run.time[ok] / BLOCK_SECONDS).astype(int) + 1_000_000 * index)
        square, block = np.concatenate(squares), np.concatenate(blocks)
        if not len(square) or square.sum() == 0:
            continue
        _, block = np.unique(block, return_inverse=True)
        totals = np.bincount(block, square)
        draws = rng.integers(0, len(totals), (DRAWS, len(totals)))
        for name in members[0]:
            chosen = np.concatenate([m[name] for m in members])
            if not chosen.any():
                continue
            parts = np.bincount(block, square * chosen, minlength=len(totals))
            spread = parts[draws].sum(axis=1) / np.maximum(totals[draws].sum(axis=1), 1e-300)
            share = float(parts.sum() / totals.sum())
            found.append(
                RegimeShare(
                    joint=joint,
                    regime=name,
                    share=share,
                    low=float(np.quantile(spread, 0.05)),
                    high=float(np.quantile(spread, 0.95)),
                    concentration=share / float(chosen.mean()),
                    rms=float(np.sqrt(np.mean(square[chosen]))),
                )
            )
    return found


def where(prepared: Prepared, parameters_only: tuple[Design, Fit], noise: Array) -> tuple[Share, ...]:
    """Each joint's share of the gap that re-identification leaves, with the regime it is densest in.

    Joints are weighed by their own torque: a joint's gap counts relative to its RMS torque.
    noise: (n,) N·m, RMS that noise alone leaves.
    """
    hypothesis, fitted = parameters_only
    counts = np.maximum(sum(np.sum(u, axis=0) for u in hypothesis.used), 1)
    rms = np.sqrt(sum(np.sum(r**2, axis=0) for r in fitted.held_out) / counts)
    torque = np.sqrt(sum(np.sum(run.torque**2, axis=0) for run in prepared.runs) / counts)
    excess = np.maximum(rms**2 - noise**2, 0) / np.maximum(torque, 1e-12) ** 2
    total = max(float(excess.sum()), 1e-300)
    shares = regime_shares(prepared, fitted.held_out, hypothesis.used)
    found = []
    for joint in range(prepared.joints):
        own = [s for s in shares if s.joint == joint]
        densest = max(own, key=lambda s: s.concentration * (s.low > 0), default=None)
        everywhere = densest is None or densest.concentration < 1.3
        found.append(
            Share(
                joint=joint,
                regime="everywhere" if everywhere or densest is None else densest.regime,
                share=float(excess[joint] / total),
                gap_rms=float(rms[joint]),
                noise_rms=float(noise[joint]),
            )
        )
    return tuple(sorted(found, key=lambda s: -s.share))
