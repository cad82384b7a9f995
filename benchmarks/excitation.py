"""Excitation design by each criterion: time, evaluations, and the accuracy the motion allows."""

import numpy as np

from identification.base_parameters import base_parameters
from identification.excitation.criteria import CRITERIA
from identification.excitation.design import DesignOptions, Excitation, design_excitation, random_excitation
from identification.regressor import regressor
from testbench.clearance import robot_clearance

from ._arms import tx90
from ._report import Goal, Report

SEEDS = (1, 2, 3, 4, 5)
CLEARANCE = 0.03
NOISE, RATE = 0.01, 1000.0


def measure() -> Report:
    # The first design of a process also loads compiled kernels.
    _design("hadamard", 0, iterations=2)
    found: dict[str, list[Excitation]] = {criterion: [] for criterion in CRITERIA}
    for seed in SEEDS:
        for criterion in np.roll(list(CRITERIA), seed):
            found[criterion].append(_design(criterion, seed))
    rows = [_row(criterion, designs, found["hadamard"]) for criterion, designs in found.items()]
    rows.append(_row("random", [_random(seed) for seed in SEEDS], found["hadamard"]))
    everything = [design for designs in found.values() for design in designs]
    kept = np.mean([design.margins.kept for design in everything])
    return Report(
        columns=(
            "criterion",
            "s",
            "times hadamard",
            "evaluations",
            "ms each",
            "cond",
            "log det",
            "Cramér-Rao",
        ),
        rows=tuple(rows),
        goals=(Goal("share of designs that keep every limit on the fine grid", float(kept), 1),),
        notes=(
            f"TX-90, one start, medians over {len(SEEDS)} seeds; every limit and the clearance kept.",
            "log det: of the information a sample, larger is better. Cramér-Rao: median over the base",
            "parameters of the smallest relative standard deviation after one period at 1 kHz,",
            f"torque noise {100 * NOISE:g} % of the limit.",
        ),
    )


def _design(criterion: str, seed: int, iterations: int = DesignOptions.iterations) -> Excitation:
    robot = tx90()
    options = DesignOptions(starts=1, seed=seed, iterations=iterations)
    clearance = robot_clearance(robot, CLEARANCE)
    return design_excitation(robot.chain, robot.parameters, robot.limits, str(criterion), options, clearance)


def _random(seed: int) -> Excitation:
    robot = tx90()
    options, clearance = DesignOptions(seed=seed), robot_clearance(robot, CLEARANCE)
    return random_excitation(robot.chain, robot.parameters, robot.limits, options, clearance)


def _row(name: str, designs: list[Excitation], reference: list[Excitation]) -> tuple[str, ...]:
    seconds = np.array([design.seconds for design in designs])
    ratio = np.median(seconds / np.array([design.seconds for design in reference]))
    evaluations = np.array([design.evaluations for design in designs])
    return (
        name,
        f"{np.median(seconds):.2f}",
        f"{ratio:.2f}",
        f"{np.median(evaluations):.0f}",
        f"{1e3 * np.median(seconds / evaluations):.1f}" if evaluations.all() else "-",
        f"{np.median([design.values.condition_number for design in designs]):.0f}",
        f"{-np.median([design.values.logdet for design in designs]):.1f}",
        f"{100 * np.median([_relative_cramer_rao(design) for design in designs]):.2f} %",
    )


def _relative_cramer_rao(design: Excitation) -> float:
    """Median over the base parameters of the Cramér-Rao bound over the true value, along the motion."""
    robot = tx90()
    base = base_parameters(robot.chain)
    time = np.arange(0.0, design.trajectory.duration, 1 / RATE)
    rows = regressor(robot.chain, *design.trajectory.evaluate(time), base.columns)
    weighted = (rows / (NOISE * robot.limits.torque)[:, None]).reshape(-1, base.count)
    scale = np.linalg.norm(weighted, axis=0)
    gram = (weighted / scale).T @ (weighted / scale)
    bound = np.sqrt(np.diag(np.linalg.inv(gram))) / scale
    return float(np.median(bound / np.abs(base.values(robot.parameters))))
