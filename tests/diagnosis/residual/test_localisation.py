"""Where a residual with a known cause lies: position, periods, bands of frequency."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from diagnosis.data.preparation import prepare
from diagnosis.data.run import Prepared, Run
from diagnosis.residual.localisation import densest, regime_shares
from diagnosis.residual.shares import RegimeShare
from diagnosis.residual.spectrum import slow_share
from testbench.robot import Robot

from ...diagnosed import measured_only, simulated_runs
from ...small_arm import small_arm

JOINT = 1
Torque = Callable[[Run, np.random.Generator], np.ndarray]


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    return small_arm(tmp_path_factory.mktemp("robot"))


@pytest.fixture(scope="module")
def prepared(robot: Robot) -> Prepared:
    return prepare(robot, simulated_runs(robot, [], 3))


def shares(prepared: Prepared, torque: Torque, seed: int = 0) -> list[RegimeShare]:
    """Regimes of a residual that is this full-rate torque (N,) behind the low-pass."""
    rng = np.random.default_rng(seed)
    residual = []
    for run in prepared.runs:
        values = np.zeros_like(run.torque)
        values[:, JOINT] = run.filtered(torque(run, rng)[:, None], [JOINT])[:, 0]
        residual.append(np.where(run.used, values, 0.0))
    return regime_shares(prepared, residual, [run.used for run in prepared.runs], JOINT)


def named(prepared: Prepared, torque: Torque, seed: int = 0) -> str | None:
    found = densest(shares(prepared, torque, seed))
    return None if found is None else found.regime


def white(run: Run, rng: np.random.Generator) -> np.ndarray:
    return rng.standard_normal(len(run.logged.time))


def ripple(run: Run, rng: np.random.Generator) -> np.ndarray:
    return np.sin(12 * run.logged.q[:, JOINT] + 0.4) + 2 * white(run, rng)


@pytest.mark.parametrize("seed", range(6))
def test_white_noise_is_named_after_no_spectrum(prepared: Prepared, seed: int) -> None:
    assert named(prepared, white, seed) is None


@pytest.mark.parametrize("seed", range(6))
def test_coloured_noise_has_no_period_in_position(prepared: Prepared, seed: int) -> None:
    def coloured(run: Run, rng: np.random.Generator) -> np.ndarray:
        return lfilter([1.0], [1.0, -0.99], white(run, rng))

    regime = named(prepared, coloured, seed)
    assert regime is None or "cycles" not in regime


def test_ripple_is_named_with_its_cycles_and_most_of_the_gap(prepared: Prepared) -> None:
    found = densest(shares(prepared, ripple))
    assert found is not None
    assert found.regime == "position, 12 cycles per revolution"
    assert found.cycles == 12
    assert found.low < found.share < found.high
    assert found.low > 3 * found.expected


def test_ripple_under_noise_of_the_same_size_is_still_named(prepared: Prepared) -> None:
    def torque(run: Run, rng: np.random.Generator) -> np.ndarray:
        return np.sin(12 * run.logged.q[:, JOINT]) + 6 * white(run, rng)

    assert named(prepared, torque) == "position, 12 cycles per revolution"


@pytest.mark.parametrize(("frequency", "band"), [(7.5, "5 to 10 Hz"), (14.0, "above 10 Hz")])
def test_ringing_is_named_with_its_band(prepared: Prepared, frequency: float, band: str) -> None:
    def ringing(run: Run, rng: np.random.Generator) -> np.ndarray:
        # A resonance of a few per cent damping shaken all the time.
        rate = run.logged.sample_rate
        pole = np.exp((-0.05 + 1j) * 2 * np.pi * frequency / rate)
        return lfilter([1.0], [1.0, -2 * pole.real, abs(pole) ** 2], white(run, rng))

    assert named(prepared, ringing) == band


def test_friction_of_one_part_of_the_range_is_named_with_that_part(prepared: Prepared) -> None:
    low = min(float(run.q[:, JOINT].min()) for run in prepared.runs)
    high = max(float(run.q[:, JOINT].max()) for run in prepared.runs)

    def rubbing(run: Run, rng: np.random.Generator) -> np.ndarray:
        there = run.logged.q[:, JOINT] > low + 0.7 * (high - low)
        return there * np.sign(run.logged.dq[:, JOINT]) + white(run, rng)

    assert named(prepared, rubbing) == "upper third of the range"


def test_friction_near_reversal_is_no_period(prepared: Prepared) -> None:
    def stribeck(run: Run, rng: np.random.Generator) -> np.ndarray:
        v = run.logged.dq[:, JOINT]
        return np.sign(v) * np.exp(-((v / 0.05) ** 2)) + 0.1 * white(run, rng)

    assert named(prepared, stribeck) == "velocity reversal"


def test_bands_add_up_and_a_joint_without_gap_has_no_regimes(prepared: Prepared) -> None:
    bands = [each for each in shares(prepared, white) if each.aspect == "frequency"]
    assert sum(each.share for each in bands) == pytest.approx(1)
    assert shares(prepared, lambda run, rng: np.zeros(len(run.logged.time))) == []


@pytest.fixture(scope="module")
def noisily_coded(robot: Robot) -> Prepared:
    """Encoders so noisy that the bands end at about eight hertz."""
    rng, runs = np.random.default_rng(2), simulated_runs(robot, [], 3)
    return prepare(
        robot,
        {
            name: replace(
                measured_only(run), position=run.position + 1e-3 * rng.standard_normal(run.position.shape)
            )
            for name, run in runs.items()
        },
    )


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(("band", "hertz"), [("prepared", 3.7), ("noisily_coded", 2.3)])
def test_noise_is_as_fast_as_its_low_pass_and_what_follows_motion_is_slow(
    request: pytest.FixtureRequest, band: str, hertz: float, seed: int
) -> None:
    runs = request.getfixturevalue(band).runs

    def slow(torque: Torque) -> tuple[float, float]:
        rng = np.random.default_rng(seed)
        residual = [run.filtered(torque(run, rng)[:, None], [JOINT])[:, 0] for run in runs]
        return slow_share(runs, JOINT, residual, [run.used[:, JOINT] for run in runs])

    def hum(run: Run, rng: np.random.Generator) -> np.ndarray:
        return np.sin(2 * np.pi * hertz * run.logged.time)

    share, expected = slow(white)
    assert expected < 0.75
    # Three runs of some 400 samples at twice the band's Nyquist rate: 600 squares, of which half are slow.
    assert share == pytest.approx(expected, abs=5 * np.sqrt(expected * (1 - expected) / 600 * 2))
    assert slow(hum)[0] > 0.97
