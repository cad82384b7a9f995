"""The scales of a log's torques, searched by all that a model has of them: links, rotors and friction."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from scipy.optimize import minimize_scalar

from .convention import Convention

# Factors that are tried, and the step between them.
LARGEST, STEP = 2000.0, 1.8
# Joints whose factors are one but for errors of the model.
IN_COMMON = 1.5

Score = Callable[[Convention], float]


def rescaled(score: Score, convention: Convention, joints: Sequence[int]) -> Convention:
    """The convention with the factors of torque to the model's that the score likes best.

    Of one of these joints after the other, of those that are alike, and of all at once.
    """
    n = len(convention.scale)
    best, value = convention, score(convention)

    def take(tried: Convention) -> None:
        nonlocal best, value
        if (found := score(tried)) > value:
            best, value = tried, found

    count = int(np.ceil(np.log(LARGEST) / np.log(STEP)))
    factors = STEP ** np.arange(-count, count + 1.0)
    for joint in joints:
        for factor in factors.tolist():
            take(best.with_value("scale", joint, float(factor)))
    for factor in factors.tolist():
        take(replace(best, scale=(float(factor),) * n))
    for factor in set(best.scale) - {1.0}:
        # A model that is too light or heavy throughout is no other unit of the others.
        over = tuple(1.0 if each == factor else each / factor for each in best.scale)
        take(replace(best, scale=over))
    for alike in _alike(best):
        take(_finest(score, best, alike))
    if any(factor != 1 for factor in best.scale):
        logs = [np.log(factor) for factor in best.scale if factor != 1]
        common = replace(best, scale=(float(np.exp(np.mean(logs))),) * n)
        take(_finest(score, common, list(range(n))))
    return best


def _alike(convention: Convention) -> list[list[int]]:
    """The joints whose scales are alike, and not the model's; and each of them by itself."""
    off = [joint for joint, factor in enumerate(convention.scale) if factor != 1]
    groups = []
    for joint in off:
        near = np.log(np.array(convention.scale)[off] / convention.scale[joint])
        groups.append([other for other, far in zip(off, near, strict=True) if abs(far) < np.log(IN_COMMON)])
    return [*([joint] for joint in off), *groups]


def _finest(score: Score, convention: Convention, joints: list[int]) -> Convention:
    """The convention with one factor of these joints, at its likeliest."""
    start = float(np.mean([np.log(convention.scale[joint]) for joint in joints]))

    def at(logarithm: float) -> Convention:
        scale = tuple(
            float(np.exp(logarithm)) if joint in joints else factor
            for joint, factor in enumerate(convention.scale)
        )
        return replace(convention, scale=scale)

    found = minimize_scalar(
        lambda logarithm: -score(at(float(logarithm))),
        bounds=(start - np.log(STEP), start + np.log(STEP)),
        method="bounded",
        options={"xatol": 0.01},
    )
    return at(float(found.x))
