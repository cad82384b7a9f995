"""Exact gradient of each design criterion (adjoint of the regressor) against forward differences."""

import numpy as np

from identification.base_parameters import base_parameters
from identification.excitation.constraints import SmoothConstraints
from identification.excitation.criteria import CRITERIA
from identification.excitation.fourier import FourierBasis
from identification.excitation.problem import DesignProblem, sampling_times

from ._arms import tx90
from ._report import Goal, Report
from ._timing import alternate

ROUNDS = 15
BASIS = FourierBasis(base_frequency=0.1, harmonics=5)
# The step that balances truncation and rounding of a forward difference.
STEP = float(np.sqrt(np.finfo(float).eps))


def measure() -> Report:
    robot = tx90()
    rng = np.random.default_rng(0)
    z = 0.1 * rng.standard_normal(BASIS.size * robot.joints)
    rows, speedups, worst = [], {}, 0.0
    for criterion in CRITERIA:
        problem = DesignProblem(
            robot.chain,
            BASIS,
            base_parameters(robot.chain).columns,
            robot.limits.torque,
            CRITERIA[criterion],
            SmoothConstraints(robot.chain, robot.parameters, robot.limits, None),
        )

        def exact(problem: DesignProblem = problem) -> np.ndarray:
            # What is kept from the last point would make a repeated call free.
            problem._last = None
            return problem.gradient(z)

        def differences(problem: DesignProblem = problem) -> np.ndarray:
            problem._last = None
            value = problem.value(z)
            return np.array([(problem.value(z + STEP * unit) - value) / STEP for unit in np.eye(len(z))])

        error = np.linalg.norm(differences() - exact()) / np.linalg.norm(exact())
        worst = max(worst, float(error))
        times = alternate({"exact": exact, "differences": differences}, ROUNDS)
        speedups[criterion] = times.speedup("differences", "exact")
        rows.append(
            (
                criterion,
                f"{1e3 * times.median('exact'):.2f}",
                f"{1e3 * times.median('differences'):.1f}",
                f"{speedups[criterion]:.1f}",
                f"{error:.1e}",
            )
        )
    return Report(
        columns=("criterion", "exact, ms", "differences, ms", "times faster", "relative difference"),
        rows=tuple(rows),
        goals=(
            Goal("Hadamard, exact against forward differences", speedups["hadamard"], 15),
            Goal("largest relative difference between the two", worst, 1e-4, at_least=False),
        ),
        notes=(
            f"TX-90, {len(z)} variables, {len(sampling_times(BASIS))} samples;",
            "both times hold the criterion's value at the point.",
        ),
    )
