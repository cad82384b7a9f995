"""Figures of joints that the model has alike, as those of legs: a limb's prior is what the others say.

A figure of such joints is theta_l = mu + d_l, with d_l of a small spread that makers' tolerances leave and mu
as widely known as a single figure is before. A limb is fitted again with what follows for it from the others
(Gelman et al., "Bayesian Data Analysis", 2013, ch. 5). Figures that differ by more than that stay apart.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from identification.output_error.fit import Fit, fit_near
from identification.output_error.plant import Limb
from identification.output_error.servo_run import ServoRun
from identification.parameters import ARMATURE, COULOMB, MASS, VISCOUS

Array = NDArray[np.float64]

NAMES = ("armature", "viscous", "coulomb", "kp_scale", "kd_scale", "delay")
# Of a figure, between joints that are built alike; of the deviation it is known to before, where it is small.
SPREAD, LEAST = 0.15, 0.02
# Figures are one where they would differ so much by chance in one case of twenty.
DIFFERENT = 0.05
# Relative difference of what a model states of joints that are alike.
SAME = 0.01


@dataclass(frozen=True)
class Tied:
    """A figure of joints that share it, or (``is_one`` false) that differ by more than their tolerances."""

    name: str
    joints: tuple[str, ...]
    is_one: bool


def tied_fits(
    parts: Sequence[Limb],
    given: Array,
    kp: Array,
    fits: Sequence[Fit],
    runs: Sequence[ServoRun],
    threads: int | None = None,
) -> tuple[tuple[Fit, ...], tuple[Tied, ...]]:
    """The fits with figures of alike joints tied to each other, and which are.

    given: the model's table (n, WIDTH). kp: (n,) as stated.
    """
    out, tied = list(fits), []
    for group in _alike_limbs(parts, given, kp):
        priors = [(fits[limb].unknowns.mean.copy(), fits[limb].unknowns.deviation.copy()) for limb in group]
        for name in NAMES:
            for place in range(len(parts[group[0]].joints)):
                own = [_place(fits[limb], name, place) for limb in group]
                if any(each is None for each in own):
                    continue
                at = [each for each in own if each is not None]
                each_fit = [fits[limb] for limb in group]
                is_one = _tie(each_fit, at, priors)
                joints = tuple(parts[limb].chain.joint_names[place] for limb in group)
                tied.append(Tied(name, joints, is_one))
        for limb, (mean, deviation) in zip(group, priors, strict=True):
            before = fits[limb]
            unknown = replace(before.unknowns, mean=mean, deviation=deviation)
            own_runs = [run.of(parts[limb].joints) for run in runs]
            again = fit_near(parts[limb].chain, unknown, own_runs, before.values, threads)
            # What was stated of it stays what it is compared with.
            out[limb] = replace(again, unknowns=before.unknowns)
    return tuple(out), tuple(tied)


def _alike_limbs(parts: Sequence[Limb], given: Array, kp: Array) -> list[list[int]]:
    """Groups of limbs, two and more, whose joints the model and the stated gains have alike."""
    groups: list[list[int]] = []
    for index, limb in enumerate(parts):
        for group in groups:
            first = parts[group[0]]
            if len(first.joints) == len(limb.joints) and np.allclose(
                _stated(first, given, kp), _stated(limb, given, kp), rtol=SAME, atol=1e-9
            ):
                group.append(index)
                break
        else:
            groups.append([index])
    return [group for group in groups if len(group) > 1]


def _stated(limb: Limb, given: Array, kp: Array) -> Array:
    table = given[limb.joints][:, [MASS, ARMATURE, VISCOUS, COULOMB]]
    return np.column_stack([table, kp[limb.joints]])


def _place(fit: Fit, name: str, joint: int) -> int | None:
    places = [each for each in fit.unknowns.at(name) if fit.unknowns.joints[each] == joint]
    return int(places[0]) if places else None


def _tie(fits: Sequence[Fit], places: Sequence[int], priors: Sequence[tuple[Array, Array]]) -> bool:
    """Put what the others say into each limb's prior, where the figures may be one; whether they may."""
    # What the runs alone say of each: an estimate and its precision.
    known = np.array([fit.unknowns.deviation[at] ** -2.0 for fit, at in zip(fits, places, strict=True)])
    means = np.array([fit.unknowns.mean[at] for fit, at in zip(fits, places, strict=True)])
    after = np.array([fit.std[at] ** -2.0 for fit, at in zip(fits, places, strict=True)])
    values = np.array([fit.values[at] for fit, at in zip(fits, places, strict=True)])
    precision = np.maximum(after - known, 1e-6 * known)
    estimates = (after * values - known * means) / precision
    pooled = float(np.sum(estimates * precision) / precision.sum())
    spread = SPREAD * abs(pooled) + LEAST * float(known[0] ** -0.5)
    weights = 1 / (1 / precision + spread**2)
    common = float(np.sum(weights * estimates) / weights.sum())
    misfit = float(np.sum(weights * (estimates - common) ** 2))
    if chi2.sf(misfit, len(fits) - 1) < DIFFERENT:
        return False
    for index, (mean, deviation) in enumerate(priors):
        others = np.arange(len(fits)) != index
        total = float(weights[others].sum() + known[index])
        combined = float(np.sum((weights * estimates)[others]) + known[index] * means[index]) / total
        unknown = fits[index].unknowns
        combined = float(np.clip(combined, unknown.lower[places[index]], unknown.upper[places[index]]))
        mean[places[index]], deviation[places[index]] = combined, np.sqrt(1 / total + spread**2)
    return True
