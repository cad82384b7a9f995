"""Torque predicted along other logs by the corrected model."""

from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from scipy.ndimage import maximum_filter1d

from diagnosis.correction.corrected_model import corrected_model
from diagnosis.correction.correction_document import Term
from diagnosis.correction.prediction import logged_motion, predict, predict_torque, term_torque
from diagnosis.data.run import DEAD_ZONE
from diagnosis.decision.findings import Diagnosis
from diagnosis.held_out.shrinkage import Kept
from identification.filtering import zero_phase_lowpass
from identification.inverse_dynamics import inverse_dynamics
from identification.parameters import COULOMB, PER_JOINT, VISCOUS
from testbench.effects import effects
from testbench.effects.base import Scope
from testbench.log import Recording, read_log

from ...diagnosed import measured_only
from .arm import LIFT


def test_prediction_closes_the_gap_of_a_run_never_diagnosed(
    folder: Path, runs: dict[str, Recording], answer: Diagnosis
) -> None:
    predict(folder, folder / "unseen.h5", folder / "predicted.h5")
    unseen = runs["run_3"]
    moving = np.abs(np.gradient(unseen.position[:, LIFT], 1e-3)) > 0.05

    def error(torque: np.ndarray) -> float:
        smooth = zero_phase_lowpass((torque - unseen.torque)[:, [LIFT]], 1000.0, 20.0)
        return float(np.sqrt(np.mean(smooth[moving] ** 2)))

    with h5py.File(folder / "predicted.h5") as file:
        assert list(file["joint/torque"].attrs["unit"]) == ["N·m", "N·m", "N"]
        nominal, parameters, corrected = (
            error(np.array(file[f"{stage}/torque"])) for stage in ("nominal", "parameters", "joint")
        )
        np.testing.assert_array_equal(file["time"], unseen.time)
    assert corrected < 0.5 * min(nominal, parameters)


def test_prediction_is_in_the_band_of_the_fit_unless_it_is_asked_for_raw(
    folder: Path, tmp_path: Path, runs: dict[str, Recording], answer: Diagnosis
) -> None:
    model, unseen = corrected_model(answer), runs["run_3"]
    predicted = predict_torque(model, unseen).corrected
    predict(folder, folder / "unseen.h5", tmp_path / "in_band.h5")
    with h5py.File(tmp_path / "in_band.h5") as file:
        for joint, corner in enumerate(model.band.tolist()):
            np.testing.assert_allclose(
                file["joint/torque"][:, joint], zero_phase_lowpass(predicted[:, joint], 1000.0, corner)
            )
        for stage in ("joint", "nominal", "parameters"):
            np.testing.assert_array_equal(file[f"{stage}/torque"].attrs["band"], model.band)
    predict(folder, folder / "unseen.h5", tmp_path / "raw.h5", raw=True)
    np.testing.assert_array_equal(read_log(tmp_path / "raw.h5").torque, predicted)
    with h5py.File(tmp_path / "raw.h5") as file:
        assert "band" not in file["joint/torque"].attrs


def test_a_joint_of_which_nothing_is_kept_is_predicted_as_the_model_given_has_it(
    runs: dict[str, Recording], answer: Diagnosis
) -> None:
    model = corrected_model(answer)
    shares = np.array([0.0, 1.0, 0.5]), np.array([0.0, 1.0, 1.0])
    half = Kept(*shares, *shares, parameters_whole=1.0, effects_whole=1.0)
    whole, shrunk = (predict_torque(each, runs["run_3"]) for each in (model, replace(model, kept=half)))
    np.testing.assert_array_equal(shrunk.corrected[:, 0], whole.nominal[:, 0])
    np.testing.assert_allclose(shrunk.corrected[:, 1], whole.corrected[:, 1])
    np.testing.assert_allclose(shrunk.parameters[:, 2], (whole.nominal + whole.parameters)[:, 2] / 2)


def test_what_is_kept_near_rest_alone_changes_only_samples_near_rest(
    runs: dict[str, Recording], answer: Diagnosis
) -> None:
    model = corrected_model(answer)
    nothing_at_rest = replace(model.kept, parameters_at_rest=np.zeros(3), effects_at_rest=np.zeros(3))
    whole, moving = (
        predict_torque(each, runs["run_3"]) for each in (model, replace(model, kept=nothing_at_rest))
    )
    velocity = np.abs(logged_motion(model, runs["run_3"]).dq)
    resting = velocity <= DEAD_ZONE
    assert resting.any()
    np.testing.assert_array_equal(moving.corrected[resting], whole.nominal[resting])
    # The low-pass of the fit spreads what is near rest over a period of its corner.
    spread = int(2 * 1000 / model.band.min())
    fast = ~maximum_filter1d(resting, spread, axis=0)
    assert fast.any()
    np.testing.assert_array_equal(moving.corrected[fast], whole.corrected[fast])


def test_prediction_never_reads_the_logs_torque(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    predict(folder, folder / "unseen.h5", tmp_path / "one.h5")
    with h5py.File(folder / "unseen.h5") as source, h5py.File(tmp_path / "scrambled.h5", "w") as target:
        for key, value in source.attrs.items():
            target.attrs[key] = value
        for key in source:
            source.copy(key, target)
        rng = np.random.default_rng(0)
        for name in ("joint/torque", "joint/torque_command"):
            target[name][...] = 100 * rng.standard_normal(target[name].shape)
    predict(folder, tmp_path / "scrambled.h5", tmp_path / "two.h5")
    with h5py.File(tmp_path / "scrambled.h5", "a") as target:
        del target["joint/torque"]
    predict(folder, tmp_path / "scrambled.h5", tmp_path / "three.h5")
    for name in ("joint/torque", "nominal/torque", "parameters/torque"):
        with h5py.File(tmp_path / "one.h5") as one:
            for other in ("two.h5", "three.h5"):
                with h5py.File(tmp_path / other) as found:
                    np.testing.assert_array_equal(one[name], found[name])
    said = capsys.readouterr().out.splitlines()
    assert len(said) == 3
    assert said[0].startswith(f"{tmp_path / 'one.h5'}: predicted torque of 3 joints at ")


@pytest.mark.parametrize("name", effects())
def test_every_effect_of_the_catalogue_can_be_predicted(
    answer: Diagnosis, runs: dict[str, Recording], name: str
) -> None:
    # Gravity keeps the second joint's load from changing its sign, so backlash would not show there.
    joint: int | None = 0 if name == "backlash" else LIFT
    scope = effects()[name].DESCRIPTION.scope
    joint, into = (None, None) if scope is Scope.ROBOT else (joint, 2 if scope is Scope.PAIR else None)
    run = runs["run_3"]
    logged = logged_motion(corrected_model(answer), run)
    members = effects()[name].signature([logged], joint, into).of_all_laws
    # A contact shows in no torque of the model; where it recurs, its shape says when.
    assert bool(members) == (name != "external_contact")
    pushed = {"kind": 2.0, "stretch": 1.0, "first": 0.5, "last": 1.0}
    of_each = {each.law: (dict(each.shape), each.count) for each in members} or {None: (pushed, 2)}
    for shape, size in of_each.values():
        torque = term_torque(Term(name, joint, into, shape, np.ones(size)), logged)
        assert torque.shape == run.position.shape
        assert np.isfinite(torque).all()
        assert np.any(torque != 0)


@pytest.mark.parametrize(
    ("name", "shape"), [("actuator_lag", {}), ("backlash", {"gap": 0.003, "contact": 60.0})]
)
def test_nothing_is_predicted_above_the_band_of_the_motion(
    answer: Diagnosis, runs: dict[str, Recording], name: str, shape: dict[str, float]
) -> None:
    """A joint's friction jumps as it turns, which the derivative of a smooth motion has nothing against."""
    logged = logged_motion(corrected_model(answer), runs["run_3"])
    torque = term_torque(Term(name, 0, None, shape, np.ones(1)), logged)
    power = np.abs(np.fft.rfft(torque * np.hanning(len(torque))[:, None], axis=0)) ** 2
    above = np.fft.rfftfreq(len(torque), 1 / logged.sample_rate) > 2.5 * logged.cutoff
    assert power[above].sum() < 1e-4 * power.sum()


def test_a_joint_at_rest_has_no_friction_predicted_and_its_counts_are_no_lost_samples(
    answer: Diagnosis, runs: dict[str, Recording]
) -> None:
    """Of drives that stand, encoders flicker by a count, which had been friction or a step at the end."""
    model, moving = corrected_model(answer), runs["run_3"]
    count = 2.4e-5
    flicker = count * np.repeat([0, 1, 0, 1, 0], [40, 3, 50, 3, 5])[:, None]
    standing = np.round(moving.position[:1] / count) * count + np.tile(flicker, (4, 3))
    still = replace(
        measured_only(moving),
        time=np.arange(len(standing)) / moving.sample_rate,
        position=standing,
        torque=np.zeros_like(standing),
    )
    predicted = predict_torque(model, still).corrected
    zero = np.zeros((1, 3))
    links = model.final.reshape(-1, PER_JOINT).copy()
    friction = links[:, COULOMB].copy()
    links[:, [VISCOUS, COULOMB]] = 0
    holding = inverse_dynamics(model.chain, links.ravel(), standing[:1], zero, zero)
    off = np.sqrt(np.mean((predicted - holding) ** 2, axis=0))
    assert np.all(off < 0.5 * friction)
    # Nothing of a run of joints that stand is as much as it takes to move them.
    assert np.all(np.abs(predicted - holding).max(axis=0) < 3 * friction)
