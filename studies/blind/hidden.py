"""Errors along the hidden run: by a diagnosis's models and at the healthy twin's floor; torque moved."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d

from diagnosis.correction.correction_document import Corrected
from diagnosis.correction.prediction import PredictedTorque, predict_torque
from diagnosis.data.decimation import decimating_filter
from diagnosis.data.preparation import REACH_PERIODS, prepare
from diagnosis.data.run import DEAD_ZONE, filter_cutoff
from diagnosis.fit.normal_equations import fit
from diagnosis.held_out.shrinkage import everything
from diagnosis.model.base_regressor import BaseRegressor
from diagnosis.model.hypothesis import design
from identification.differentiation import differentiate
from identification.inverse_dynamics import inverse_dynamics
from identification.models import POSITION_BAND
from testbench.log import Recording
from testbench.robot import Robot
from testbench.sampling import motion

from .simulated import IdealRuns

Array = NDArray[np.float64]


def hidden_error(model: Corrected, hidden: Recording) -> PredictedTorque:
    """RMS (n,) of filtered torque less predicted, away from rest, by each stage of a corrected model."""
    predicted = predict_torque(model, hidden)
    rate = hidden.sample_rate
    cutoff = filter_cutoff(rate)
    low_pass = decimating_filter(rate, cutoff)
    velocity = differentiate(motion(hidden), "butterworth_central", POSITION_BAND * cutoff).dq
    used = ~_resting(velocity, rate)[low_pass.kept(len(velocity))]
    stages = (predicted.nominal, predicted.parameters, predicted.corrected)
    return PredictedTorque(*(_rms(low_pass(hidden.torque - torque), used) for torque in stages))


def floor(nominal: Robot, twin: Sequence[Recording]) -> Array:
    """RMS (n,) N·m on the twin's hidden run, its last, of parameters alone, fitted to its other runs."""
    *given, hidden = twin
    prepared = prepare(nominal, {f"run_{index}": run for index, run in enumerate(given)})
    fitted = fit(design(BaseRegressor(prepared)))
    count = len(nominal.parameters)
    parameters = nominal.parameters + fitted.values[:count]
    logged = prepared.runs[0].logged
    model = Corrected(
        chain=nominal.chain,
        limits=nominal.limits,
        nominal=nominal.parameters,
        parameters=parameters,
        parameters_timing=float(fitted.values[count]),
        final=parameters,
        final_timing=float(fitted.values[count]),
        lag=prepared.lag,
        linearised=parameters,
        coulomb_smoothing=prepared.coulomb_smoothing,
        coulomb_lead=prepared.coulomb_lead,
        zeros=prepared.zeros,
        body_rotation=logged.body_rotation,
        body_origin=logged.body_origin,
        terms=(),
        kept=everything(nominal.joints),
        band=prepared.cutoff,
    )
    return hidden_error(model, hidden).parameters


@dataclass(frozen=True)
class Moved:
    """Torque moved along runs that are given, RMS (n,) N·m.

    together: by all effects. alone: by each without the others. torque: what the healthy robot needs.
    """

    together: Array
    alone: tuple[Array, ...]
    torque: Array


def moved(robot: Robot, runs: IdealRuns) -> Moved:
    """RMS torque that the effects move, together and each by itself.

    It is the torque that the ideal logs need beyond the true model along their own motion, less the same of
    the healthy twin, which leaves out the background and what filtering does to any log.
    """
    healthy = _residuals(robot, runs.healthy)

    def rms(recordings: Sequence[Recording]) -> Array:
        ill = _residuals(robot, recordings)
        used = np.concatenate([a.used & b.used for a, b in zip(ill, healthy, strict=True)])
        changes = [a.beyond - b.beyond for a, b in zip(ill, healthy, strict=True)]
        return _rms(np.concatenate(changes), used)

    together = rms(runs.together)
    several = len(runs.alone) > 1
    used = np.concatenate([run.used for run in healthy])
    return Moved(
        together,
        tuple(rms(each) if several else together for each in runs.alone),
        _rms(np.concatenate([run.torque for run in healthy]), used),
    )


@dataclass(frozen=True)
class _Residual:
    """One run, filtered: torque, torque beyond the true model, and samples away from rest; (M, n) each."""

    torque: Array
    beyond: Array
    used: NDArray[np.bool_]


def _residuals(robot: Robot, recordings: Sequence[Recording]) -> list[_Residual]:
    found = []
    for recording in recordings:
        rate = recording.sample_rate
        cutoff = filter_cutoff(rate)
        low_pass = decimating_filter(rate, cutoff)
        signals = differentiate(motion(recording), "butterworth_central", POSITION_BAND * cutoff)
        torque = inverse_dynamics(
            robot.chain, robot.parameters, signals.q, signals.dq, signals.ddq, threads=1
        )
        used = ~_resting(signals.dq, rate)[low_pass.kept(len(torque))]
        found.append(_Residual(low_pass(signals.tau), low_pass(signals.tau - torque), used))
    return found


def _resting(velocity: Array, rate: float) -> NDArray[np.bool_]:
    """Samples (N, n) that the friction's unknown sign reaches, as in the diagnosis."""
    reach = 2 * round(REACH_PERIODS * rate / filter_cutoff(rate)) + 1
    return maximum_filter1d(np.abs(velocity) <= DEAD_ZONE, reach, axis=0)


def _rms(values: Array, used: NDArray[np.bool_]) -> Array:
    """RMS (n,) over the used samples (M, n); 0 for a joint that never moves."""
    counts = np.maximum(np.sum(used, axis=0), 1)
    return np.sqrt(np.sum(np.where(used, values, 0.0) ** 2, axis=0) / counts)
