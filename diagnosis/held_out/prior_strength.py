"""Strength of the prior of a fit, chosen by how well it predicts left-out runs.

The scales of the prior are those at which the fitted parameters are likeliest; a misfit makes them too large.
They are never made larger: runs that repeat one motion are predicted ever better by parameters that no other
motion supports.
"""

from dataclasses import replace

import numpy as np

from ..fit.normal_equations import Fit, fit, on_whole_runs, squares
from ..model.hypothesis import Design

# A multiple of the prior's variance scales that is tried, and by how much less its squared error must be.
TIGHTER, BETTER = 0.1, 0.05


def with_predictive_prior(hypothesis: Design, fitted: Fit) -> Fit:
    """The fit with whole runs held out, with a tighter prior where that predicts these better.

    As it is where a joint moves in one run alone: parts of one motion predict little of another. The joints'
    squared errors count by their own torque.
    """
    as_it_is = on_whole_runs(hypothesis, fitted)
    if hypothesis.prepared.moved_alone.any():
        return as_it_is
    like = replace(fitted, prior_scales=TIGHTER * fitted.prior_scales)
    tighter = on_whole_runs(hypothesis, fit(hypothesis, like))
    torque = squares([run.torque for run in hypothesis.prepared.runs])
    loaded = torque > 0
    before, after = (
        float(np.sum(squares(each.held_out)[loaded] / torque[loaded])) for each in (as_it_is, tighter)
    )
    return tighter if after < (1 - BETTER) * before else as_it_is
