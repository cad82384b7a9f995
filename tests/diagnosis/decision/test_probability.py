"""How likely an effect is a fault: by its size, this robot's other joints, and what it explains."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.special import expit, logit, ndtr
from scipy.stats import t as student

from diagnosis.data.preparation import prepare
from diagnosis.decision import probability as model
from diagnosis.decision.findings import NamedEffect
from diagnosis.decision.probability import MODEL_HOLDS, ONE_RUN, Size, fault_probability
from diagnosis.model.candidates import candidates
from diagnosis.report.sentence import sentence_of
from testbench.effects.signature import Quantity

from ...diagnosed import exact_gap, simulated_runs

EFFECT, ELBOW, RUNS = "cable_spring", 1, 3


@pytest.fixture(scope="module")
def spring(arm):
    own = candidates(prepare(arm, simulated_runs(arm, [], runs=1)), only=[EFFECT])
    return next(each for each in own if each.family.joint == ELBOW)


def _own(times: float) -> Size:
    return Size(EFFECT, ELBOW, times)


def test_the_odds_are_those_of_the_formula():
    size, others, share = 3.0, np.array([0.4, 0.8]), 0.7
    seen = [Size(EFFECT, joint, times) for joint, times in zip((0, 2), others, strict=True)]
    variance = 1 / (1 / model.BETWEEN**2 + 2 / model.WITHIN**2)
    level = variance * (model.LEVEL / model.BETWEEN**2 + np.log(others).sum() / model.WITHIN**2)
    deviation = np.sqrt(variance + model.WITHIN**2)
    healthy = student.pdf((np.log(size) - level) / deviation, model.TAILS) / deviation
    ends = np.log([size, model.LARGEST / size]) / model.WITHIN
    fault = np.prod(ndtr(ends)) / np.log(model.LARGEST)
    expected = MODEL_HOLDS * expit(np.log(model.PRIOR * fault / healthy) + model.EXPLAINED * logit(share))
    assert fault_probability(_own(size), seen, share, 0.0, RUNS) == pytest.approx(expected)


@given(st.floats(0.05, 10.0), st.floats(1.05, 5.0), st.floats(0.0, 1.0))
def test_a_larger_effect_is_likelier_a_fault(times: float, factor: float, share: float):
    one, other = (fault_probability(_own(each), (), share, 0.0, RUNS) for each in (times, factor * times))
    # Far below any healthy size the tails of both densities are of no meaning.
    assert other > one or times < 0.3


@given(st.floats(1.0, 10.0), st.floats(0.05, 0.9), st.integers(1, 5))
def test_what_other_joints_have_less_of_is_likelier_a_fault(times: float, share: float, count: int):
    def beside(others: float) -> float:
        seen = [Size(EFFECT, ELBOW + 1 + k, others) for k in range(count)]
        return fault_probability(_own(times), seen, share, 0.0, RUNS)

    assert beside(0.1) > beside(times)


def test_only_the_same_effect_at_other_joints_counts():
    alone = fault_probability(_own(3.0), (), 0.8, 0.0, RUNS)
    others = [_own(3.0), Size("gravity_spring", 0, 3.0), Size(EFFECT, 0, np.inf), Size(EFFECT, 2, 0.0)]
    assert fault_probability(_own(3.0), others, 0.8, 0.0, RUNS) == alone
    assert fault_probability(_own(3.0), [Size(EFFECT, 0, 3.0)], 0.8, 0.0, RUNS) < alone


def test_parameters_that_come_nearer_to_the_model_explain_as_a_share_does():
    absorbed = fault_probability(_own(3.0), (), 0.02, 30.0, RUNS)
    assert absorbed == pytest.approx(fault_probability(_own(3.0), (), 1 - np.exp(-3.0), 0.0, RUNS))
    nothing = fault_probability(_own(3.0), (), 0.02, 0.0, RUNS)
    assert absorbed > fault_probability(_own(3.0), (), 0.02, -30.0, RUNS) == nothing


def test_no_healthy_robot_is_pushed():
    assert fault_probability(Size("external_contact", 0, np.inf), (), 0.0, 0.0, RUNS) == MODEL_HOLDS


def test_one_run_does_not_show_what_another_would():
    several, one = (fault_probability(_own(5.0), (), 0.9, 0.0, runs) for runs in (2, 1))
    assert one == pytest.approx(ONE_RUN * several)
    assert several < MODEL_HOLDS


@pytest.mark.parametrize(
    ("probability", "alike", "stated"),
    [
        (0.93, ("gravity_spring",), "cable spring at elbow, cable spring at elbow;"),
        (0.55, (), "cable spring at elbow, perhaps cable spring at elbow;"),
        (0.45, ("gravity_spring",), "cable spring at elbow, cable spring or gravity spring at elbow;"),
    ],
)
def test_the_sentence_says_what_is_as_likely_as_not(arm, spring, probability, alike, stated):
    size = {"stiffness": Quantity(2.0, 0.01, "N·m/rad"), "rest": Quantity(0.1, 0.5, "rad")}
    first = NamedEffect(EFFECT, ELBOW, None, 1.0, size, spring)
    second = NamedEffect(EFFECT, ELBOW, None, probability, size, spring, confusable_with=alike)
    floor = np.ones(2)
    gap = exact_gap(5 * floor, np.array([2.0, 4.0]), floor, floor)
    sentence = sentence_of(arm, "effect", [first, second], (), gap, np.full(arm.joints, 10.0))
    assert sentence.startswith(f"The gap comes from {stated}")
