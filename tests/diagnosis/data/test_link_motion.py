"""The link of an elastic joint along a logged motion."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.data.preparation import prepare
from testbench.effects.link_motion import LinkRow, elastic_change, link_row, loose_change

from ...diagnosed import simulated_runs

STIFFNESS, DAMPING = 50.0, 0.05
GAP, CONTACT = 0.004, 60.0


@pytest.fixture(scope="module")
def link(arm) -> LinkRow:
    """A link that gravity holds where it hangs."""
    (run, *_) = prepare(arm, simulated_runs(arm, [])).runs
    row = link_row(run.logged, 1)
    return replace(row, by_position=np.abs(row.by_position))


def test_a_spring_carries_what_its_link_does(link):
    assert elastic_change(link, STIFFNESS, DAMPING).any()


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("times", [1.5, 20.0])
def test_a_spring_that_gravity_outweighs_explains_nothing(link, times):
    # Upside down, the link would fall off such a spring.
    tipped = replace(link, by_position=np.full_like(link.by_position, -times * STIFFNESS))
    assert not elastic_change(tipped, STIFFNESS, DAMPING).any()


def test_a_link_in_a_gap_moves_the_torque(link):
    assert loose_change(link, GAP, CONTACT).any()


@pytest.mark.filterwarnings("error")
def test_teeth_that_gravity_outweighs_explain_nothing(link):
    # A link of next to no inertia has next to no contact either, and falls off its teeth.
    light = np.full_like(link.inertia, 1e-8)
    tipped = replace(link, inertia=light, by_position=np.full_like(link.by_position, -1.0))
    assert not loose_change(tipped, GAP, CONTACT).any()
