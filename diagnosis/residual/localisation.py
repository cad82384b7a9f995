"""Localisation of the gap: by joint, and within a joint by the regime of the motion.

Most regimes are sets of samples: near reversal, slow, fast, moving forward or back, in a part of the range,
heavily loaded, accelerating hard, early or late in the run. Their share is their part of the joint's squared
residual, and expected is their part of its samples. Those of spectrum.py are parts of the residual itself.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..data.run import Prepared, Run, filter_cutoff
from ..fit.normal_equations import Fit, rms
from ..fit.score import Stage
from ..model.hypothesis import Design
from .intervals import blocks, drawn_sums, interval
from .shares import EVERYWHERE, RegimeShare, Share
from .spectrum import FREQUENCY, PERIODIC, band_shares, periodic_share

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

# A regime is named from so many times its expected share, if its interval is above that too.
DENSE = 1.3
# A period is named where it holds this much of the joint's gap, too, and a band from this much on.
LEAST = {PERIODIC: 0.2, FREQUENCY: 0.5}


def sample_regimes(
    run: Run, joint: int, top_speed: float, top_acceleration: float, span: tuple[float, float]
) -> dict[tuple[str, str, str], Mask]:
    """The samples (M,) of each regime of one joint in one run, by aspect, part, and both in words.

    top_speed, top_acceleration: SI. span: lowest and highest position in all runs.
    """
    v, a = run.dq[:, joint], run.ddq[:, joint]
    speed, hard = np.abs(v) / top_speed, np.abs(a) / top_acceleration
    load = np.abs(run.filtered(run.logged.load[:, [joint]], [joint])[:, 0])
    third = np.clip((3 * (run.q[:, joint] - span[0]) / max(span[1] - span[0], 1e-12)).astype(int), 0, 2)
    middle = np.median(run.time)
    return {
        ("speed", "reversal", "velocity reversal"): speed < 0.1,
        ("speed", "slow", "slow"): (speed >= 0.1) & (speed < 0.5),
        ("speed", "fast", "fast"): speed >= 0.5,
        ("direction", "forward", "moving forward"): v > 0,
        ("direction", "back", "moving back"): v < 0,
        ("load", "high", "high load"): load > np.median(load),
        ("acceleration", "hard", "hard acceleration"): hard > 0.5,
        ("time", "early", "early in the run"): run.time < middle,
        ("time", "late", "late in the run"): run.time >= middle,
        ("position", "lower third", "lower third of the range"): third == 0,
        ("position", "middle third", "middle third of the range"): third == 1,
        ("position", "upper third", "upper third of the range"): third == 2,
    }


def regime_shares(
    prepared: Prepared, residual: Sequence[Array], used: Sequence[Mask], joint: int
) -> list[RegimeShare]:
    """Every regime of one joint, for a residual a run (M, n); none where it has no gap."""
    runs = prepared.runs
    own = [values[:, joint] for values in residual]
    ok = [mask[:, joint] for mask in used]
    left = np.concatenate([values[u] for values, u in zip(own, ok, strict=True)])
    if not len(left) or not left.any():
        return []
    top_speed = max(max(float(np.abs(run.dq[:, joint]).max()) for run in runs), 1e-9)
    top_acceleration = max(max(float(np.quantile(np.abs(run.ddq[:, joint]), 0.98)) for run in runs), 1e-9)
    span = min(float(r.q[:, joint].min()) for r in runs), max(float(r.q[:, joint].max()) for r in runs)
    sets = [sample_regimes(run, joint, top_speed, top_acceleration, span) for run in runs]
    members = {
        name: np.concatenate([each[name][u] for each, u in zip(sets, ok, strict=True)]) for name in sets[0]
    }
    # Numbered without holes, over all runs.
    separate = [
        blocks(run)[u] + 1_000_000 * index for index, (run, u) in enumerate(zip(runs, ok, strict=True))
    ]
    block = np.unique(np.concatenate(separate), return_inverse=True)[1]
    position, velocity = (
        np.concatenate([getattr(run, name)[u, joint] for run, u in zip(runs, ok, strict=True)])
        for name in ("q", "dq")
    )
    cutoff = min(filter_cutoff(run.logged.sample_rate) for run in runs) * float(prepared.band[joint])
    slide = bool(prepared.robot.chain.is_slide[joint])
    period = periodic_share(position, velocity, left, block, cutoff, slide)
    return [
        *_of_samples(left**2, members, block),
        *([] if period is None else [period]),
        *band_shares(runs, joint, own, ok, block),
    ]


def _of_samples(
    square: Array, members: dict[tuple[str, str, str], Mask], block: NDArray[np.int64]
) -> list[RegimeShare]:
    """The shares of sets of samples (K,); those without any are left out."""
    held = {name: chosen for name, chosen in members.items() if chosen.any()}
    parts = np.stack(
        [np.bincount(block, square), *(np.bincount(block, square * chosen) for chosen in held.values())],
        axis=1,
    )
    drawn = drawn_sums(parts)
    spread = drawn / np.maximum(drawn[:, :1], 1e-300)
    shares = parts.sum(axis=0) / parts[:, 0].sum()
    found = []
    for index, (name, chosen) in enumerate(held.items(), start=1):
        low, high = interval(spread[:, index])
        rms = float(np.sqrt(np.mean(square[chosen])))
        found.append(RegimeShare(*name, float(shares[index]), low, high, float(chosen.mean()), rms))
    return found


def densest(shares: Sequence[RegimeShare]) -> RegimeShare | None:
    """The regime to report; None where no share is clearly beyond the expected one.

    Of the sets of samples the most concentrated; instead of it a part of a spectrum that has more of the gap
    beyond what it is expected to have.
    """
    dense = [s for s in shares if s.concentration >= DENSE and s.low > s.expected]
    samples = max((s for s in dense if s.aspect not in LEAST), key=lambda s: s.concentration, default=None)
    parts = [s for s in dense if s.aspect in LEAST and s.share >= LEAST[s.aspect]]
    if samples is not None:
        parts = [s for s in parts if s.excess > samples.excess]
        # A gap that goes with some part of the motion has that part's band, too.
        parts = [s for s in parts if s.aspect != FREQUENCY or s.concentration > samples.concentration]
    return max(parts, key=lambda s: s.excess, default=samples)


def where(prepared: Prepared, parameters_only: tuple[Design, Fit], noise: Array) -> tuple[Share, ...]:
    """Each joint's share of the gap that re-identification leaves, with the regime it is densest in.

    Joints are weighed by their own torque: a joint's gap counts relative to its RMS torque.
    noise: (n,) N·m, RMS that noise alone leaves.
    """
    hypothesis, fitted = parameters_only
    gap = rms(fitted.held_out, hypothesis)
    torque = rms([run.torque for run in prepared.runs], hypothesis)
    excess = np.maximum(gap**2 - noise**2, 0) / np.maximum(torque, 1e-12) ** 2
    total = max(float(excess.sum()), 1e-300)
    found = []
    for joint in range(prepared.joints):
        shares = regime_shares(prepared, fitted.held_out, hypothesis.used, joint)
        named = densest(shares)
        found.append(
            Share(
                joint=joint,
                regime=EVERYWHERE if named is None else named.regime,
                share=float(excess[joint] / total),
                gap_rms=float(gap[joint]),
                noise_rms=float(noise[joint]),
                regimes=tuple(shares),
            )
        )
    return tuple(sorted(found, key=lambda s: -s.share))


def share_left(first: Stage, last: Stage) -> Array:
    """The part of the held-out squared residual of the first stage that the last one leaves, (n,)."""
    return last.held_squares / np.maximum(first.held_squares, 1e-300)
