"""Memory that columns of long runs take: nothing at the full rate is held for all candidates at once."""

import tracemalloc
from collections.abc import Callable

import numpy as np
import pytest

from diagnosis.data.preparation import prepare
from diagnosis.data.run import Prepared
from diagnosis.model.candidate import Candidate
from diagnosis.model.candidates import candidates
from diagnosis.model.free_functions import generic_candidates
from identification.inverse_dynamics import inverse_dynamics
from testbench.effects.columns import AT_ONCE
from testbench.log import Recording
from testbench.robot import Robot

RATE, SAMPLES = 200.0, 4 * AT_ONCE
# In signals of both joints. What a run keeps of itself: load, direction, predicted torque and residual; with
# what making them takes.
OF_A_RUN = 8
# Of each joint three derivatives of the load that are kept, and as many while they are made.
DERIVATIVES = 2 * 6
# Columns that each of two threads has at a time, and what they are made of.
COLUMNS = 2 * 10


@pytest.fixture(scope="module")
def long_run(arm: Robot) -> Prepared:
    """Sines of both joints for eleven minutes, with the torque of the model."""
    time = np.arange(SAMPLES) / RATE
    turns, phases = 2 * np.pi * np.array([0.23, 0.37]), np.array([0.0, 1.0])
    angle = turns * time[:, None] + phases
    q, dq, ddq = np.sin(angle), turns * np.cos(angle), -(turns**2) * np.sin(angle)
    torque = inverse_dynamics(arm.chain, arm.parameters, q, dq, ddq)
    log = Recording(arm.name, arm.joint_names, RATE, "hardware", time, q, torque)
    return prepare(arm, {"long": log})


def _beyond_what_is_kept(make: Callable[[], list[Candidate]]) -> tuple[float, float]:
    """Bytes at the peak beyond the decimated columns, and of all the candidates' columns at the full rate."""
    tracemalloc.start()
    found = make()
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    kept = sum(run.nbytes for each in found for run in each.filtered)
    return peak - kept, 8 * SAMPLES * sum(each.count * len(each.member.rows) for each in found)


def test_effects_hold_a_few_columns_at_the_full_rate(long_run: Prepared) -> None:
    names = ["gravity_spring", "encoder_eccentricity", "stribeck_friction", "nonlinear_viscous_friction"]
    names += ["thermal_friction_drift", "cable_spring", "joint_elasticity", "joint_coupling", "torque_delay"]
    peak, whole = _beyond_what_is_kept(lambda: candidates(long_run, only=names))
    most = (OF_A_RUN + DERIVATIVES + COLUMNS) * long_run.runs[0].logged.q.nbytes
    assert peak < most < whole / 2


@pytest.mark.parametrize("name", ["payload", "base_tilt"])
def test_columns_of_all_joints_are_made_a_part_of_a_run_at_a_time(long_run: Prepared, name: str) -> None:
    peak, whole = _beyond_what_is_kept(lambda: candidates(long_run, only=[name]))
    # A part, its absolute values, and what it is made of.
    assert peak < 5 * whole * AT_ONCE / SAMPLES


def test_free_functions_are_made_a_part_of_a_run_at_a_time(long_run: Prepared) -> None:
    peak, whole = _beyond_what_is_kept(lambda: generic_candidates(long_run))
    most = (OF_A_RUN + COLUMNS) * long_run.runs[0].logged.q.nbytes
    assert peak < most < whole / 2
