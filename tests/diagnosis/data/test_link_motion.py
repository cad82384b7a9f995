"""The link of an elastic joint along a logged motion."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.data.preparation import prepare
from testbench.effects.link_motion import LinkRow, elastic_change, link_row

from ...diagnosed import simulated_runs

STIFFNESS, DAMPING = 50.0, 0.05


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
