"""The worked examples of CONTRIBUTING.md do what it says, each found where its room is looked through."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import identification.estimators
import recordings.readers
import studies.plants
import testbench
import testbench.effects
from diagnosis.experiment.reasons import why
from testbench.log import Recording
from testbench.robot import Robot

from .diagnosed import measured_only

EXTENSIONS = Path(__file__).parents[1] / "examples" / "extensions"
ROOMS = {
    "effects": testbench.effects,
    "estimators": identification.estimators,
    "plants": studies.plants,
    "readers": recordings.readers,
}


def forget() -> None:
    testbench.effects.effects.cache_clear()
    recordings.readers.readers.cache_clear()
    studies.plants._found.cache_clear()
    studies.plants.plants.cache_clear()


@pytest.fixture(autouse=True)
def extended(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Each room looks through the folder of its example too."""
    for name, room in ROOMS.items():
        monkeypatch.setattr(room, "__path__", [*room.__path__, str(EXTENSIONS / name)])
    forget()
    yield
    forget()


@pytest.fixture
def runs(arm: Robot) -> dict[str, Recording]:
    """Two runs of the small arm with the effect of the example."""
    options = {"harmonics": 4, "base_frequency": 0.25, "starts": 1, "iterations": 5}
    found = {}
    for seed in range(2):
        motion = testbench.excite(arm, **options, seed=seed)
        effects = ["eddy_brake:elbow:peak=2,critical=0.5"]
        run = testbench.simulate(arm, motion, effects=effects, periods=1, seed=seed)
        found[f"run_{seed}"] = measured_only(run)
    return found


def test_the_diagnosis_finds_the_effect_with_the_parameters_that_act(
    arm: Robot, runs: dict[str, Recording]
) -> None:
    why = testbench.diagnose(arm, runs)
    ((found),) = why.effects
    assert (found.effect, found.joint) == ("eddy_brake", 1)
    assert found.parameters["peak"].value == pytest.approx(2.0, rel=0.05)
    assert found.parameters["critical"].value == pytest.approx(0.5, rel=0.05)


def test_the_record_that_tells_the_effect_is_advised() -> None:
    advice = why(("eddy_brake", "backlash"), (), None, "no motion is better")
    assert "move with content at 5 to 30 Hz" in advice
    advice = why(("none", "eddy_brake"), (), None, "no motion is better")
    assert "hold many constant speeds" in advice


def test_the_estimator_predicts_as_well_as_weighted_least_squares(
    arm: Robot, healthy_runs: dict[str, Recording]
) -> None:
    fitted, judged = ({name: healthy_runs[name]} for name in ("run_1", "run_2"))
    ours, theirs = (
        testbench.identify(arm, fitted, judged, estimator=name).validations[0].relative
        for name in ("by_torque", "wls")
    )
    np.testing.assert_allclose(ours, theirs, rtol=0.1)


def test_the_reader_returns_the_columns_of_the_array(tmp_path: Path) -> None:
    columns = np.array([(0.0, 1.0), (0.1, 2.0)], dtype=[("time", "f8"), ("q1", "f8")])
    np.save(tmp_path / "log.npy", columns)
    reader = recordings.readers.reader_of(tmp_path / "log.npy")
    (table,) = reader.read(tmp_path / "log.npy")
    read = {column.name: column.values.tolist() for column in table.columns()}
    assert read == {"time": [0.0, 0.1], "q1": [1.0, 2.0]}


def test_the_plant_carries_itself_by_the_torque_that_it_logs() -> None:
    plant = studies.plants.plant("positioner")
    robot = plant.ideal(plant.robot(np.random.default_rng(1)))
    sheet = plant.links(robot)
    # At rest: the torque is that of gravity, by the lever arms of the centres about the level axis.
    rest = np.zeros((200, 2)), np.zeros((200, 2)), np.zeros((200, 2))
    log = plant.run(robot, rest, None)
    mass, centre = sheet.mass[1], sheet.centre[1]
    assert log.torque[-1, 0] == pytest.approx(0.0, abs=1e-9)
    assert log.torque[-1, 1] == pytest.approx(-9.81 * mass * centre[0], rel=1e-3)
