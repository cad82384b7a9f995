"""What would not show, even where it were severe."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.fit.likelihood import Weighed
from diagnosis.plausibility.materiality import SMALLEST_WALD
from diagnosis.plausibility.observability import not_observable
from testbench.effects import effect
from testbench.effects.size import typical_range

from ..certain_gain import healthy_stage


@pytest.mark.parametrize("name", ["load_dependent_friction", "encoder_offset"])
@pytest.mark.parametrize(("of_least", "hidden"), [(0.98, True), (1.02, False)])
def test_an_effect_is_hidden_that_the_severe_end_of_its_range_would_not_show(arm, name, of_least, hidden):
    """However much torque the runs need: what is too little of it for a name is another matter."""
    stage, (own, _) = healthy_stage(arm, name)
    _, severe = typical_range(effect(name).DESCRIPTION.parameters[0], arm, 0)
    gain = replace(stage.gain(own), information=np.eye(1) * of_least * SMALLEST_WALD / severe**2)
    assert not_observable(arm, [Weighed(gain, 0.0)]) == (((name, 0),) if hidden else ())
