"""Where a robot differs from its model and stated drives: figures that runs which were not fitted ask for."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.covariance import variance_inflation
from identification.output_error.fit import Fit
from identification.output_error.plant import Limb
from identification.output_error.servo_loop import Window, simulate
from identification.output_error.servo_run import ServoRun

from .identified import IdentifiedDrives, consistent, scale_of_kd

Array = NDArray[np.float64]

# Deviations between a figure and what was stated, and log-likelihood that runs lose without it.
DEVIATIONS, EVIDENCE = 3.0, 3.0
# Correlation of two figures beyond which runs do not distinguish them.
COLLINEAR = 0.95
# What a figure that differs is called.
NAMES = {
    "armature": "armature",
    "viscous": "viscous friction",
    "coulomb": "Coulomb friction",
    "offset": "torque offset",
    "kp_scale": "wrong gain kp",
    "kd_scale": "wrong gain kd",
    "delay": "command delay",
    "limit": "torque limit",
    "load_friction": "load-dependent friction",
    "stribeck": "Stribeck friction",
    "friction_slope": "friction that changes with position",
    "back_emf": "back EMF",
}


@dataclass(frozen=True)
class Difference:
    """A figure of a joint that is not as stated.

    name: a key of NAMES. stated, value, std: in its unit. evidence: log-likelihood that the judging runs lose
    where the figure is as stated and all others move as the fit has them depend on it. alike: figures of the
    same joint that the runs do not distinguish from it.
    """

    joint: str
    name: str
    unit: str
    stated: float
    value: float
    std: float
    evidence: float
    alike: tuple[str, ...]


def differences(found: IdentifiedDrives, runs: Sequence[ServoRun]) -> tuple[Difference, ...]:
    """The figures that differ, the best evidence first, judged by held-out runs where there are such.

    A figure is left out where it lies within three deviations of what was stated, or the runs lose less than
    three units of log-likelihood without it (a Bayes factor of 20).
    """
    out = [
        each
        for limb, own in zip(found.limbs, found.fits, strict=True)
        for each in _of_limb(limb, own, [run.of(limb.joints) for run in runs])
    ]
    return tuple(sorted(out, key=lambda each: -each.evidence))


def _of_limb(limb: Limb, found: Fit, runs: Sequence[ServoRun]) -> list[Difference]:
    unknown, std = found.unknowns, found.std
    apart = np.abs(found.values - unknown.mean) > DEVIATIONS * std
    tried = [
        place
        for place, (name, joint) in enumerate(zip(unknown.names, unknown.joints, strict=True))
        if joint >= 0 and name in NAMES and apart[place]
    ]
    if not tried:
        return []
    candidates = [found.values]
    for place in tried:
        back = found.covariance[:, place] / found.covariance[place, place]
        moved = unknown.held(found.values - back * (found.values[place] - unknown.mean[place]))
        moved[place] = unknown.mean[place]
        candidates.append(moved)
    tables = np.stack([consistent(unknown.table(each)) for each in candidates])
    likelihoods = _likelihoods(limb, tables, runs)
    correlation = found.covariance / np.outer(std, std)
    out = []
    for place, likelihood in zip(tried, likelihoods[1:], strict=True):
        evidence = float(likelihoods[0] - likelihood)
        if evidence < EVIDENCE:
            continue
        joint = int(unknown.joints[place])
        value, deviation = float(found.values[place]), float(std[place])
        if unknown.names[place] == "kd_scale":
            value, deviation = scale_of_kd(found, joint)
        alike = tuple(
            unknown.names[other]
            for other in np.flatnonzero(unknown.joints == joint)
            if other != place and abs(correlation[place, other]) > COLLINEAR
        )
        out.append(
            Difference(
                joint=limb.chain.joint_names[joint],
                name=unknown.names[place],
                unit=unknown.units[place],
                stated=float(unknown.mean[place]),
                value=value,
                std=deviation,
                evidence=evidence,
                alike=alike,
            )
        )
    return out


def _likelihoods(limb: Limb, tables: Array, runs: Sequence[ServoRun]) -> Array:
    """Log-likelihood of the runs' positions by tables (C, n, WIDTH), residuals weighted as the first's are.

    A table that runs away has none.
    """
    residuals: list[list[Array]] = [[] for _ in tables]
    for run in runs:
        position, velocity = run.smoothed
        start = (position[0], velocity[0])
        window = Window(run.command, run.kp, run.kd, 0, len(position), *start)
        for own, (simulated,) in zip(
            residuals, simulate(limb.chain, tables, [window], run.rate), strict=True
        ):
            own.append(simulated.position - run.position)
    used = [np.isfinite(each) for each in residuals[0]]
    variance, inflation = variance_inflation([np.nan_to_num(each) for each in residuals[0]], used)
    weights = 1 / (variance * inflation + 1e-300)
    out = [-0.5 * sum(float(np.sum(each**2 * weights)) for each in own) for own in residuals]
    return np.where(np.isfinite(out), out, -np.inf)
