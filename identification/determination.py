"""Which base parameters a set of runs determines, and in words why it leaves others open."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .observations import Observations
from .prior import BasePrior
from .problem import Problem

Array = NDArray[np.float64]

# A base parameter is determined where the runs leave it this share of the prior's variance at most.
DETERMINED = 0.5
# Share of a joint's motion that one sine makes where it holds nothing else.
ONE_SINE = 0.98
# Frequencies that differ by less than this factor are one.
SAME = 1.1


@dataclass(frozen=True)
class Determination:
    """directions: how many combinations of the b base parameters the runs know better than the prior does.

    determined: (b,) bool, of single base parameters. remarks: sentences on what the motion leaves open.
    """

    directions: int
    determined: NDArray[np.bool_]
    remarks: tuple[str, ...]


def determination(problem: Problem, prior: BasePrior, weights: Array, noise: float) -> Determination:
    """The determination of a problem's parameters by its rows, against a prior taken at its word.

    weights: (e,) of the equations' rows. noise: standard deviation of a weighted row.
    """
    products = np.zeros((problem.base.count, problem.base.count))
    for scaled, _ in problem.weighted_parts(weights / noise):
        products += scaled.T @ scaled
    inverse_root = np.linalg.inv(prior.root)
    information, vectors = np.linalg.eigh(inverse_root.T @ products @ inverse_root)
    information = np.maximum(information, 0.0)
    spread = (inverse_root @ vectors) ** 2
    left = spread @ (1 / (1 + information)) / np.diag(prior.covariance)
    directions = int(np.sum(1 / (1 + information) <= DETERMINED))
    return Determination(directions, left <= DETERMINED, motion_remarks(problem))


def motion_remarks(problem: Problem) -> tuple[str, ...]:
    """Joints that stood still in all runs, and those that followed one sine in each."""
    dead_zone = problem.preprocessing.dead_zone
    names = problem.chain.joint_names
    still: list[str] = []
    same: list[str] = []
    several: list[str] = []
    for joint, name in enumerate(names):
        moving = [run for run in problem.observations if np.abs(run.dq[:, joint]).max() > dead_zone]
        found = [sine_frequency(run, joint) for run in moving]
        if not moving:
            still.append(name)
        elif None not in found:
            frequencies = [each for each in found if each is not None]
            (same if max(frequencies) < SAME * min(frequencies) else several).append(name)
    remarks = []
    if still:
        remarks.append(f"{_listed(still)} stood still")
    for joints, when, apart in (
        (same, "one sine at one frequency", "cannot"),
        (several, "one sine in each run", "can hardly"),
    ):
        if joints:
            verb = "follows" if len(joints) == 1 else "follow"
            remarks.append(
                f"{_listed(joints)} {verb} {when}: inertia and gravity there {apart} be distinguished"
            )
    return tuple(remarks)


def sine_frequency(run: Observations, joint: int) -> float | None:
    """The frequency, Hz, of a joint that follows one sine in a run; None where its motion holds more, or less
    than a period.

    A sine's acceleration is -w² times its position, so inertia and a linear gravity torque are collinear.
    """
    position = run.q[:, joint] - run.q[:, joint].mean()
    total = float(position @ position)
    if total == 0:
        return None
    lines = np.fft.rfftfreq(len(position), 1 / run.sample_rate)
    peak = float(lines[1 + np.argmax(np.abs(np.fft.rfft(position))[1:])])
    # Between the lines of a short run, one on either side of its largest.
    tried = peak + np.linspace(-1, 1, 41) * lines[1]
    left, frequency = min((_without_sine(position, run.time, each), each) for each in tried if each > 0)
    is_whole = frequency * len(position) >= run.sample_rate
    return float(frequency) if is_whole and left < (1 - ONE_SINE) * total else None


def _without_sine(position: Array, time: Array, frequency: float) -> float:
    """Squares that a constant and a sine of this frequency leave of a position."""
    angle = 2 * np.pi * frequency * time
    columns = np.column_stack([np.ones_like(time), np.sin(angle), np.cos(angle)])
    solution = np.linalg.lstsq(columns, position, rcond=None)[0]
    return float(np.sum((position - columns @ solution) ** 2))


def _listed(names: list[str]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"
