"""How large a fitted effect is: by its parameters' typical ranges, or by functions of its own file."""

from pathlib import Path

import numpy as np
import pytest

from testbench.effects import effect, effects, fitted_effect
from testbench.effects.experiment import Experiment
from testbench.effects.fitted_effect import FittedEffect
from testbench.effects.signature import Member, Quantity
from testbench.robot import Robot

from .small_arm import small_arm


@pytest.fixture
def robot(tmp_path: Path) -> Robot:
    return small_arm(tmp_path)


def _fitted(robot: Robot, name: str, values: dict[str, float], torque: float = 0.0) -> FittedEffect:
    """An effect of the elbow with these parameters, along runs that say nothing of it."""
    return FittedEffect(
        description=effect(name).DESCRIPTION,
        robot=robot,
        joint=1,
        member=Member({}, (1,), [np.zeros((1, 1, 1))], np.zeros(1), np.ones(1)),
        coefficients=np.ones(1),
        values={key: Quantity(value, 0.0, "") for key, value in values.items()},
        torque=torque,
        seconds=10.0,
        position_step=0.0,
    )


@pytest.mark.parametrize(
    ("name", "values", "torque", "expected"),
    [
        ("stribeck_friction", {"extra": 0.3}, 0.0, 3.0),  # mild: 0.1 of 1 N·m of Coulomb friction
        ("stribeck_friction", {"extra": 0.3}, 100.0, 0.5),  # but hardly any of 100 N·m
        ("backlash", {"gap": 0.0004}, 100.0, 4.0),
        ("presliding_hysteresis", {"stiffness": 750.0}, 0.0, 2.0),  # the softer, the more
    ],
)
def test_without_functions_of_its_own_parameters_tell_a_size(robot, name, values, torque, expected):
    assert fitted_effect.size(_fitted(robot, name, values, torque)) == pytest.approx(expected)


def test_a_file_may_judge_for_itself(robot, monkeypatch):
    fitted = _fitted(robot, "backlash", {"gap": 0.0004})
    assert fitted_effect.is_plausible(fitted)
    assert fitted_effect.is_distinct(fitted)
    assert not fitted_effect.is_excessive(fitted, share=0.5)
    own = {
        "size": lambda fitted: 7.0,
        "is_plausible": lambda fitted: fitted.value("gap") < 0.0001,
        "is_distinct": lambda fitted: False,
        "is_excessive": lambda fitted, share: share < 0.9,
    }
    for name, function in own.items():
        monkeypatch.setattr(effect("backlash"), name, function, raising=False)
    assert fitted_effect.size(fitted) == 7.0
    assert not fitted_effect.is_plausible(fitted)
    assert not fitted_effect.is_distinct(fitted)
    assert [fitted_effect.is_excessive(fitted, share) for share in (0.5, 0.95)] == [True, False]


def test_no_file_makes_a_parameter_plausible_beyond_its_bounds(robot, monkeypatch):
    monkeypatch.setattr(effect("backlash"), "is_plausible", lambda fitted: True, raising=False)
    assert not fitted_effect.is_plausible(_fitted(robot, "backlash", {"gap": 0.2}))


def test_descriptions_hold_together():
    for each in effects().values():
        description = each.DESCRIPTION
        names = {parameter.name for parameter in description.parameters}
        assert description.viscous in {"", *names}
        assert {*description.size_names} <= names
        assert description.at_times or not description.is_event
        assert description.or_of_one_joint or description.healthy_alone is None
        assert len({*description.shown_by}) == len(description.shown_by)
        assert {*description.confused_with} <= {*effects()}
    records = {record for each in effects().values() for record in each.DESCRIPTION.shown_by}
    assert records == {*Experiment}
