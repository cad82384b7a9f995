"""Plays and soft gearboxes at the load that they carry, which is fitted beside them."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.data.preparation import prepare
from diagnosis.fit.likelihood import weigh
from diagnosis.fit.linearisation import first_linearised, linearised_anew
from diagnosis.fit.normal_equations import fitted_to
from diagnosis.fit.score import Stage
from diagnosis.model.base_regressor import BaseRegressor
from diagnosis.model.candidates import candidates
from diagnosis.model.gram import Bank
from diagnosis.proposals.transmission_load import linearised_until_settled, refined_again
from diagnosis.search.shortlist import choose
from testbench.effects import parse_injection

from ...diagnosed import simulated_runs

ELBOW, STIFFNESS = 1, 33.0
EFFECTS = (
    f"joint_elasticity:elbow:stiffness={STIFFNESS},damping=0.05",
    "torque_gain_error:shoulder:relative=0.1",
)


@pytest.fixture(scope="module")
def resonant(arm):
    """A gearbox that resonates with its link at 5 Hz, found at loads that a gain error bends."""
    runs = simulated_runs(arm, [parse_injection(arm, each) for each in EFFECTS], runs=3)
    prepared = first_linearised(prepare(arm, runs))
    stage = Stage.of(BaseRegressor(prepared), [])
    soft = [c for c in candidates(prepared, only=["joint_elasticity"]) if c.family.joint == ELBOW]
    weighed = weigh(stage, Bank(stage.base, soft))
    chosen = choose(arm, stage, weighed, weighed)
    assert chosen is not None
    return chosen[2]


def _off(hypothesis, fitted):
    """How far its coefficient and its stiffness are from what they are, relative."""
    coefficient = fitted.values[hypothesis.parts[0]][0]
    return max(abs(coefficient - 1), abs(hypothesis.accepted[0].member.shape["stiffness"] / STIFFNESS - 1))


def test_a_soft_gearbox_and_its_load_are_settled_together(arm, resonant):
    once = linearised_anew(*resonant)
    settled = linearised_until_settled(arm, *resonant)
    assert _off(*once) > 0.05
    # What the gain error bends is left.
    assert _off(*settled) < 0.03


def test_a_soft_gearbox_is_searched_for_again_when_something_else_is_taken_in(arm, resonant):
    gain = next(
        c for c in candidates(resonant[0].prepared, only=["torque_gain_error"]) if c.family.joint == 0
    )
    beside = fitted_to(resonant[0].base, [*resonant[0].accepted, gain])
    assert _off(*linearised_anew(*beside)) > 0.05
    hypothesis, fitted = linearised_until_settled(arm, *beside)
    assert _off(hypothesis, fitted) < 0.02
    assert fitted.values[-1] == pytest.approx(1 / 1.1 - 1, abs=0.01)


def test_what_shows_nothing_on_other_ground_stays_as_it_was(arm):
    prepared = prepare(arm, simulated_runs(arm, []))
    play = candidates(prepared, only=["backlash"])[0]
    unmoved = replace(play, filtered=tuple(np.zeros_like(run) for run in play.filtered))
    hypothesis, fitted = refined_again(arm, *fitted_to(BaseRegressor(prepared), [unmoved]))
    assert hypothesis.accepted == (unmoved,)
    assert fitted.values[-1] == 0.0
