"""An arm whose axes are all parallel feels no turn of its base but one about them, which is an offset."""

import numpy as np
import pytest

from diagnosis.data.preparation import prepare
from diagnosis.decision.probability import MODEL_HOLDS, ONE_RUN
from diagnosis.decision.reported_effects import CONFUSABLE
from diagnosis.diagnose import diagnose
from diagnosis.model.candidates import candidates
from diagnosis.search.growth import attribute
from testbench.effects import parse_injection

from ..diagnosed import simulated_runs
from ..small_arm import ARM, small_arm

PLANAR = ARM.replace('axis="0 0 1" range="-2 2" armature=".05"', 'axis="0 1 0" range="-2 2" armature=".05"')


def test_a_turn_that_no_joint_feels_is_held_at_zero(tmp_path):
    arm = small_arm(tmp_path, PLANAR)
    (tilt,) = candidates(prepare(arm, simulated_runs(arm, [], runs=1)), only=["base_tilt"])
    roll, pitch = 0, 1
    assert tilt.member.lower[roll] == tilt.member.upper[roll] == 0
    assert tilt.member.lower[pitch] < 0 < tilt.member.upper[pitch]
    assert not np.any(tilt.filtered[0][:, :, roll])
    assert np.any(tilt.filtered[0][:, :, pitch])


def test_a_tilt_and_an_offset_of_the_first_joint_are_reported_as_one(tmp_path):
    arm = small_arm(tmp_path, PLANAR)
    tilted = simulated_runs(arm, [parse_injection(arm, "base_tilt::pitch=0.08,roll=0")], runs=3)
    (first, *_) = [each for each in attribute(prepare(arm, tilted)).accepted if each.named]
    said = {first.candidate.family.effect: first.probability}
    said |= {rival.candidate.family.effect: share for rival, share in first.rivals}
    assert {"base_tilt", "encoder_offset"} <= {name for name, share in said.items() if share > CONFUSABLE}


@pytest.mark.parametrize(("runs", "level"), [(1, ONE_RUN * MODEL_HOLDS), (3, MODEL_HOLDS)])
def test_a_name_and_its_rivals_share_what_a_name_has(tmp_path, runs, level):
    arm = small_arm(tmp_path, PLANAR)
    tilted = simulated_runs(arm, [parse_injection(arm, "base_tilt::pitch=0.08,roll=0")], runs=runs)
    found = diagnose(arm, tilted)
    assert "encoder offset or base tilt at shoulder" in found.sentence
    ranked = [each for each in found.ranked if each.probability > CONFUSABLE]
    assert {each.effect for each in ranked} == {"base_tilt", "encoder_offset"}
    assert 0.95 * level < sum(each.probability for each in ranked) <= level
