"""What the default scenario and the recordings of real robots must reach."""

import json
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from scipy.stats import binom, norm

from identification.excitation.design import DesignOptions, design_excitation, random_excitation
from identification.models import Preprocessing
from identification.parameters import GROUPS
from identification.pipeline import IdentificationOptions
from testbench.cli import main
from testbench.comparison import compare_with_truth
from testbench.jobs.identify import identify_recordings
from testbench.jobs.run import simulation_options
from testbench.log import read_log
from testbench.results import IdentificationResult
from testbench.robot import load_robot
from testbench.scenario import load_scenario
from testbench.simulation import sample_reference, simulate

ROOT = Path(__file__).parents[1]
SEEDS = 10
# These arms move slowly: a dead zone as wide as the default takes away what shows their friction.
REAL = Preprocessing(dead_zone=0.02)
# README of the TX-40 recording: the authors' essential weighted least squares, joints 1 to 4.
TX40_VISCOUS = np.array([8.03, 5.52, 2.00, 1.11])
TX40_COULOMB = np.array([7.23, 8.25, 6.29, 2.52])


@pytest.fixture(scope="module")
def identified() -> tuple[IdentificationResult, ...]:
    """The default scenario with one design start, identified from ten draws of its sensor noise."""
    scenario, _ = load_scenario(ROOT / "scenarios" / "tx90.yaml")
    robot = load_robot(scenario.model)
    excitation, section = scenario.excitation, scenario.identification
    designed = DesignOptions(
        harmonics=excitation.harmonics,
        base_frequency=excitation.base_frequency,
        groups=section.parameters,
        starts=1,
        limit_share=excitation.limit_share,
        seed=scenario.seed,
    )
    model = robot.chain, robot.parameters, robot.limits
    fitted = design_excitation(*model, excitation.criterion, designed).trajectory
    other = random_excitation(*model, designed).trajectory
    rate = scenario.simulation.control_rate
    references = [sample_reference(fitted, rate, scenario.simulation.periods), sample_reference(other, rate)]
    recordings = simulate(robot, references * SEEDS, simulation_options(scenario, robot), seed=scenario.seed)
    preprocessing = Preprocessing(section.cutoff, section.differentiation, section.dead_zone)
    options = IdentificationOptions(section.estimator, section.parameters, preprocessing)
    noise = scenario.noise.torque * robot.limits.torque
    results = []
    for fit, validation in zip(recordings[::2], recordings[1::2], strict=True):
        result = identify_recordings(robot, {"fit": fit}, {"validation": validation}, options)
        comparison = compare_with_truth(robot.chain, result.estimate, (fit,), noise, 0.0, preprocessing)
        results.append(replace(result, comparison=comparison))
    return tuple(results)


def test_base_parameters_come_within_twice_the_cramer_rao_bound(identified):
    # Both medians run over parameters and seeds. A bound-reaching Gaussian estimate has a median error of
    # 0.67 standard deviations, so twice the bound is about three times what the noise alone would leave.
    errors = [np.abs(result.comparison.error / result.comparison.truth) for result in identified]
    bounds = [result.comparison.cramer_rao / np.abs(result.comparison.truth) for result in identified]
    assert np.median(errors) <= 2 * np.median(bounds)


def test_validation_torque_is_off_by_little_more_than_noise(identified):
    squares = np.mean([result.validations[0].rms ** 2 for result in identified], axis=0)
    floor = identified[0].comparison.noise_floor
    ratios = np.sqrt(squares) / floor
    assert np.sqrt(np.mean(ratios**2)) <= 1.2
    assert ratios.max() <= 1.2, ratios.round(3)


def test_no_more_parameters_lie_outside_four_standard_deviations_than_chance_says(identified):
    scores = np.concatenate([result.comparison.error / result.estimate.std for result in identified])
    assert len(scores) == 520
    outside = int(np.sum(np.abs(scores) > 4))
    assert outside <= binom.ppf(0.999, len(scores), 2 * norm.sf(4))


def real(folder: Path, fit: str, validation: str | None = None) -> IdentificationResult:
    """A real recording identified with every group of parameters."""
    robot = load_robot(folder / "nominal.xml")
    validated = {} if validation is None else {validation: read_log(folder / f"{validation}.h5")}
    options = IdentificationOptions("wls", tuple(GROUPS), REAL)
    return identify_recordings(robot, {fit: read_log(folder / f"{fit}.h5")}, validated, options)


def test_half_of_a_tx40_run_predicts_the_other(real_data):
    (validation,) = real(real_data / "tx40", "half_1", "half_2").validations
    assert validation.overall_relative <= 0.175


def test_friction_of_a_tx40_agrees_with_its_authors(real_data):
    estimate = real(real_data / "tx40", "run1").estimate
    values = dict(zip(estimate.base.names, estimate.values, strict=True))
    for symbol, published in (("fv", TX40_VISCOUS), ("fc", TX40_COULOMB)):
        found = np.array([values[f"{symbol}_{joint}"] for joint in (1, 2, 3, 4)])
        assert np.abs(found / published - 1).max() <= 0.1, (symbol, found)


@pytest.mark.parametrize(("fit", "validation"), [("half_1", "half_2"), ("half_2", "half_1")])
def test_half_of_a_ur10_run_predicts_the_other(real_data, fit, validation):
    (result,) = real(real_data / "ur10", fit, validation).validations
    assert result.overall_relative <= 0.07


SMALL = """
name: small
model: {model}
seed: 3
excitation: {{harmonics: 3, base_frequency: 0.4 Hz, starts: 2}}
simulation: {{periods: 2}}
noise: {{encoder_bits: 17, torque: 0.01}}
validation: {{runs: 1, harmonics: 3, base_frequency: 0.4 Hz}}
"""


@pytest.fixture(scope="module")
def small_runs(tmp_path_factory) -> tuple[Path, Path]:
    """Results of one small scenario by the command line, on one thread and on two."""
    folder = tmp_path_factory.mktemp("small")
    scenario = folder / "small.yaml"
    scenario.write_text(SMALL.format(model=ROOT / "models" / "tx90.xml"))
    outs = folder / "one", folder / "two"
    for jobs, out in enumerate(outs, 1):
        main(["run", str(scenario), "--out", str(out), "--jobs", str(jobs)])
    return outs


def test_designs_and_estimates_do_not_depend_on_the_number_of_threads(small_runs):
    one, two = small_runs
    for name in ("excitation.json", "estimate.json"):
        assert (one / name).read_bytes() == (two / name).read_bytes(), name
    assert json.loads((one / "estimate.json").read_text())["base_parameters"]


def test_recordings_do_not_depend_on_the_number_of_threads(small_runs):
    one, two = small_runs
    logs = sorted(path.name for path in one.glob("*.h5"))
    assert logs == ["fit.h5", "validation_1.h5"]
    for name in logs:
        assert contents(one / name) == contents(two / name), name


def contents(path: Path) -> dict[str, object]:
    """Bytes of every dataset and value of every attribute of a robot-log, but for its time stamp."""
    found: dict[str, object] = {}

    def add(name: str, item: h5py.Dataset | h5py.Group) -> None:
        if isinstance(item, h5py.Dataset):
            found[name] = (item.shape, str(item.dtype), item[()].tobytes())
        found.update({f"{name}@{key}": np.asarray(value).tolist() for key, value in item.attrs.items()})

    with h5py.File(path) as file:
        add("", file)
        file.visititems(add)
    provenance = json.loads(str(found.pop("@provenance")))
    del provenance["created"]
    return found | {"provenance": provenance}
