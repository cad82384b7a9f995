"""Logs whose torque is late against their positions: it is taken back before anything else is judged.

Drives report filtered currents, and messages of two senders are stamped as they arrive. A common timing error
is among the unknowns of every hypothesis, but linear: from a few milliseconds on what it leaves would look
like bristles or soft gearboxes.
"""

from collections.abc import Mapping

import numpy as np

from identification.prior import TIMING
from testbench.log import Recording
from testbench.robot import Robot
from testbench.torque_lag import IN_TIME, TorqueLag

from ..data.preparation import prepare
from ..data.run import Prepared
from ..model.base_regressor import BaseRegressor
from ..model.hypothesis import LATE
from .delay import likeliest_lateness
from .normal_equations import fitted_to, rms

# The linear timing says nothing of what is far off, where re-identification leaves this share of half the
# joints' torque.
LEFT = 0.1
# How much likelier it must be, in units of log-likelihood: real ones are so by a thousand.
SURELY = 100.0


def aligned(robot: Robot, recordings: Mapping[str, Recording], highest: float | None = None) -> Prepared:
    """The runs as of ``prepare``, their torque as of their positions where the logs have it late."""
    prepared = prepare(robot, recordings, highest=highest)
    lag = lateness(prepared)
    return prepare(robot, recordings, lag, highest) if lag.seconds > 0 else prepared


def lateness(prepared: Prepared) -> TorqueLag:
    """How all torque of these runs is surely late; in time where the unknown timing says as well."""
    hypothesis, fitted = fitted_to(BaseRegressor(prepared), [])
    poor = np.median(rms(fitted.residual, hypothesis) / hypothesis.base.torque_rms) > LEFT
    if fitted.values[hypothesis.timing] < TIMING and not poor:
        return IN_TIME
    lag = likeliest_lateness(hypothesis, fitted, SURELY)
    return lag if lag.seconds > LATE else IN_TIME
