"""How loosely the prior holds a fit, by what it predicts of runs that were left out.

The scales of the prior are those at which the fitted parameters are likeliest. A motion of few parameters
leaves them too small, and a misfit makes them too large.
"""

from dataclasses import replace

import numpy as np

from ..fit.normal_equations import Fit, fit, on_whole_runs, squares
from ..model.hypothesis import Design

# Multiples of the prior's variance scales that are tried, and by how much less a squared error must be.
MULTIPLES = (0.1, 1.0)
BETTER = 0.05


def with_predictive_prior(hypothesis: Design, fitted: Fit) -> Fit:
    """The fit with whole runs held out, by the multiple of its prior's scales that predicts these best.

    As it is unless another one is better by BETTER, and where a joint moves in one run alone: parts of one
    motion tell little of another. The joints' squared errors count by their own torque.
    """
    if hypothesis.prepared.moved_alone.any():
        return on_whole_runs(hypothesis, fitted)
    torque = squares([run.torque for run in hypothesis.prepared.runs])
    as_it_is = on_whole_runs(hypothesis, fitted)
    found = {1.0: as_it_is}
    for multiple in MULTIPLES:
        if multiple != 1.0:
            like = replace(fitted, prior_scales=multiple * fitted.prior_scales)
            found[multiple] = on_whole_runs(hypothesis, fit(hypothesis.prepared, hypothesis, like))
    loaded = torque > 0
    error = {
        multiple: float(np.sum(squares(each.held_out)[loaded] / torque[loaded]))
        for multiple, each in found.items()
    }
    best = min(error, key=lambda multiple: error[multiple])
    return found[best] if error[best] < (1 - BETTER) * error[1.0] else as_it_is
