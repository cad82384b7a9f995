"""The best of the criteria: Hadamard's to get there, the determinant to stay.

Hadamard's inequality bounds the determinant by the column norms alone, which are cheap and enlarge the
motion at once, but do not see collinear columns (Jin & Gans 2015). So every start is taken so far by
Hadamard only as it pays, and from there by -log det, which does see them; both with exact gradients.
"""

import numpy as np
from numpy.typing import NDArray

from ..base_parameters import base_parameters
from ..chain import Chain
from .constraints import SmoothConstraints
from .criteria import criterion_named
from .design import descend, feasible_motions, optimise, torque_scale
from .excitation import DesignOptions
from .limits import Clearance, Limits
from .problem import DesignProblem
from .trajectory import Trajectory

Array = NDArray[np.float64]

# Hadamard's own optimum lies beyond what is best for the determinant: it is left after so many iterations.
FIRST_ITERATIONS = 15
# Points tried on the way back to where the limits are kept.
BACKWARD = 25


def design_two_stage(
    chain: Chain,
    parameters: Array,
    limits: Limits,
    options: DesignOptions | None = None,
    clearance: Clearance | None = None,
) -> tuple[Trajectory | None, int]:
    """The motion of least -log det over the starts of ``options``, and the evaluations it took.

    None where no start keeps the limits on the fine grid. Raises InputError for limits that cannot be met.
    """
    options = options or DesignOptions()
    motions = feasible_motions(chain, parameters, limits, options, clearance)
    columns = base_parameters(chain, options.groups).columns
    scale = torque_scale(motions, limits, options.seed)
    constraints = SmoothConstraints(chain, parameters, motions.limits, clearance)
    first, second = (
        DesignProblem(chain, motions.basis, columns, scale, criterion_named(name), constraints)
        for name in ("hadamard", "logdet")
    )
    best, motion = np.inf, None
    for generator in np.random.default_rng(options.seed).spawn(options.starts):
        start = first.variables(motions.draw(generator))
        z = _kept(first, start, descend(first, start, FIRST_ITERATIONS, _unreported))
        value, found, _ = optimise(second, motions, first.coefficients(z), options.iterations, _unreported)
        if value < best:
            best, motion = value, found
    return motion, first.evaluations + second.evaluations


def _kept(problem: DesignProblem, start: Array, z: Array) -> Array:
    """The variables nearest to z on the way from the start, which keeps the limits, that keep them too.

    The optimiser was stopped half-way, where it may have stepped over them.
    """
    for share in np.linspace(1.0, 0.0, BACKWARD, endpoint=False):
        between = start + share * (z - start)
        if problem.constraint_values(between).min() >= 0:
            return between
    return start


def _unreported(iteration: int, value: float) -> None:
    """Progress that nobody asked for."""
