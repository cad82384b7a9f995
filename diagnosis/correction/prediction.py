"""Torque along a measured motion, by the corrected model and by those before it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from identification.differentiation import differentiate
from identification.errors import InputError
from identification.filtering import zero_phase_lowpass
from identification.models import POSITION_BAND
from recordings.checks.positions import require_plausible_motion
from testbench.containment.json_text import read_bounded_json
from testbench.effects import effect
from testbench.effects.signature import Logged
from testbench.files import require_writable
from testbench.log import Recording, write_log
from testbench.lost_samples import lost_samples, mended
from testbench.runs import by_path, read_motion
from testbench.sampling import motion, on_grid
from testbench.simulation import Reference
from testbench.simulation.controller import feedforward
from testbench.torque_lag import TorqueLag

from ..data.preparation import logged_along, samples_near_rest
from ..data.run import filter_cutoff
from .correction_document import DOCUMENT, FORMAT, Corrected, Term, read_correction

Array = NDArray[np.float64]

# rad/s (m/s), w of fc tanh(v / w) where friction jumps with the speed's sign: of a joint at rest that sign is
# the encoder's noise, and none of its friction is predicted.
AT_REST = 0.005


@dataclass(frozen=True)
class PredictedTorque:
    """Torque (N, n) N·m at a log's instants: by the model as given, re-identified, and corrected."""

    nominal: Array
    parameters: Array
    corrected: Array


def predict(
    directory: Path, log: Path, out: Path, raw: bool = False, map_path: Path | None = None
) -> PredictedTorque:
    """Predict the torque along LOG's motion with DIR's corrected model, write it to ``out`` and say so.

    raw: at all frequencies; otherwise each joint's torque passes the low-pass of the fit, whose corner is the
    datasets' attribute ``band``, Hz.

    ``out`` is a robot-log with LOG's time and motion, the corrected model's torque as joint/torque, and
    nominal/torque and parameters/torque beside it. LOG's torque is never used. map_path: how a recording
    that is no robot-log is read. Raises InputError.
    """
    require_writable(out, log, Path(directory) / DOCUMENT)
    model = read_diagnosed(directory)
    recording = read_motion(log, model.chain, model.limits, map_path)
    predicted, band = predict_along(model, recording, log, raw)
    write_prediction(recording, predicted, band, out, {"diagnosis": Path(directory).name, "log": log.name})
    samples, joints = predicted.corrected.shape
    print(f"{out}: predicted torque of {joints} joints at {samples} instants of {log}")
    return predicted


def predict_along(
    model: Corrected, recording: Recording, log: Path, raw: bool = False
) -> tuple[PredictedTorque, Array | None]:
    """The torque along a recording's motion, and the corner (n,) Hz of each joint's low-pass, None if raw.

    log: the recording's file, which errors name. Raises InputError.
    """
    require_plausible_motion(recording, model.chain, model.limits, log)
    try:
        predicted = predict_torque(model, recording)
    except InputError as error:
        raise by_path(error, [log]) from None
    if raw:
        return predicted, None
    band = np.minimum(model.band, filter_cutoff(recording.sample_rate))
    return in_band(predicted, recording.sample_rate, band), band


def write_prediction(
    recording: Recording,
    predicted: PredictedTorque,
    band: Array | None,
    out: Path,
    provenance: dict[str, str] | None = None,
) -> None:
    """Write a robot-log with the recording's motion and the corrected model's torque, the others beside it.

    predicted, band: of ``predict_along``.
    """
    written = Recording(
        robot=recording.robot,
        joint_names=recording.joint_names,
        sample_rate=recording.sample_rate,
        source="prediction",
        time=recording.time,
        position=recording.position,
        torque=predicted.corrected,
        provenance=provenance or {},
        is_slide=recording.is_slide,
    )
    out.parent.mkdir(parents=True, exist_ok=True)
    beside = {"nominal/torque": predicted.nominal, "parameters/torque": predicted.parameters}
    write_log(written, out, beside, band)


def in_band(predicted: PredictedTorque, sample_rate: float, band: Array) -> PredictedTorque:
    """The torques with each joint's low-passed at its corner, (n,) Hz, as a fit has it."""
    torques = (predicted.nominal, predicted.parameters, predicted.corrected)
    return PredictedTorque(*(low_passed(torque, sample_rate, band) for torque in torques))


def low_passed(torque: Array, sample_rate: float, band: Array) -> Array:
    """A torque (N, n) with each joint's low-passed at its corner, (n,) Hz."""
    columns = zip(torque.T, band.tolist(), strict=True)
    return np.column_stack([zero_phase_lowpass(own, sample_rate, corner) for own, corner in columns])


def read_diagnosed(directory: Path) -> Corrected:
    """The corrected model of a folder that ``diagnose`` has written. Raises InputError."""
    path = Path(directory) / DOCUMENT
    if not path.is_file():
        raise InputError(directory, DOCUMENT, "a folder that diagnose has written", "no such file")
    document = read_bounded_json(path, "diagnosis")
    if not isinstance(document, dict) or document.get("format") != FORMAT:
        raise InputError(path, "format", FORMAT, "something else")
    return read_correction(document.get("correction"), path)


def predict_torque(model: Corrected, recording: Recording) -> PredictedTorque:
    """Torque along a recording's measured motion, at its own instants.

    The effects are their families' columns along that motion, with the measured torque and command
    replaced by what the models say.
    """
    logged = logged_motion(model, recording)
    nominal, *fitted = torque_along(model, logged)
    parameters, corrected = (model.lag.put_on(torque, logged.sample_rate) for torque in fitted)
    # What is known of the log and of friction near rest is no parameter, and is kept.
    known = replace(logged, parameters=model.nominal).predicted
    late = model.lag.put_on(known, logged.sample_rate)
    at_rest = samples_near_rest(logged, np.minimum(model.band, filter_cutoff(logged.sample_rate)))
    torques = (nominal, *model.kept.of_torque(late, parameters, corrected, at_rest))
    # A log whose time stamps stray was resampled.
    return PredictedTorque(*(_at(recording.time, logged.time, torque) for torque in torques))


def torque_along(model: Corrected, logged: Logged) -> tuple[Array, Array, Array]:
    """Torque (N, n) N·m along a motion: as given, re-identified, and corrected, all of what was fitted.

    logged: of ``logged_motion``, or the like of a run.
    """
    rate = logged.sample_rate
    given = replace(logged, coulomb_smoothing=np.full(logged.joints, AT_REST), coulomb_lead=0.0)
    nominal = replace(given, parameters=model.nominal).predicted
    parameters, corrected = (replace(logged, parameters=p).predicted for p in (model.parameters, model.final))
    corrected = TorqueLag(model.final_timing).put_on(corrected, rate)
    for torque in _term_torques(model.terms, logged):
        corrected += torque
    return nominal, TorqueLag(model.parameters_timing).put_on(parameters, rate), corrected


def _term_torques(terms: Sequence[Term], logged: Logged) -> list[Array]:
    """Each effect's torque along one run, (N, n) N·m: first of those that the load has."""
    carried = [term_torque(each, logged) for each in terms if each.is_carried]
    if carried:
        logged = replace(logged, carried=np.sum(carried, axis=0))
        logged = replace(logged, tau=logged.predicted)
    return [*carried, *(term_torque(each, logged) for each in terms if not each.is_carried)]


def term_torque(term: Term, logged: Logged) -> Array:
    """An effect's torque along one run, (N, n) N·m; zero for an event that this run does not show.

    Raises InputError for shapes that the effect has not got, as those of another version.
    """
    family = effect(term.effect).signature([logged], term.joint, term.into)
    shapes = [sorted(each.shape) for each in family.of_all_laws]
    shapes += [sorted([*each.shape, *family.made_with]) for each in family.members]
    if shapes and sorted(term.shape) not in shapes:
        expected = f"the shapes {' or '.join(dict.fromkeys(', '.join(each) or 'none' for each in shapes))}"
        raise InputError(
            "diagnosis", f"correction {term.effect}", expected, ", ".join(sorted(term.shape)) or "none"
        )
    member = family.at(term.shape)
    if member is None or member.count != len(term.coefficients):
        return np.zeros_like(logged.q)
    # einsum, not a BLAS product: its sums do not depend on the number of threads.
    torque = np.einsum("tjk,k->tj", member.spread(0, logged.joints), term.coefficients)
    description = effect(term.effect).DESCRIPTION
    if not (description.of_transmission or description.is_lag):
        return torque
    # Made of derivatives, or of teeth that land: above the band of the motion nothing of it is known.
    return zero_phase_lowpass(torque, logged.sample_rate, logged.cutoff)


def as_predicted(model: Corrected, logged: Logged) -> Logged:
    """A run that was fitted, its Coulomb friction near rest as predictions have it, at the linearisation."""
    logged = replace(
        logged,
        parameters=model.linearised,
        coulomb_smoothing=np.maximum(model.coulomb_smoothing, AT_REST),
    )
    return replace(logged, tau=logged.predicted)


def logged_motion(model: Corrected, recording: Recording) -> Logged:
    """The motion of a recording with no trace of its torque, and the model along it."""
    # The torque is not read, so that it cannot matter.
    recording = replace(recording, torque=np.zeros_like(recording.position))
    recording = on_grid(mended(recording, lost_samples(recording)))
    raw = motion(recording)
    rate = raw.sample_rate
    signals = differentiate(raw, "butterworth_central", POSITION_BAND * filter_cutoff(rate))
    along = logged_along(model.chain, model.limits, model.nominal, recording, signals, rate)
    logged = replace(
        along,
        parameters=model.linearised,
        tau=np.zeros_like(signals.q),
        body_rotation=model.body_rotation,
        body_origin=model.body_origin,
        coulomb_smoothing=np.maximum(model.coulomb_smoothing, AT_REST),
        coulomb_lead=model.coulomb_lead,
        zeros=model.zeros,
    )
    return replace(logged, tau=logged.predicted, torque_command=_command(model, recording, logged.dq))


def _command(model: Corrected, recording: Recording, dq: Array) -> Array | None:
    """Torque command of the log's controller along this motion, (N, n) N·m; None where it is not known."""
    controller = recording.controller
    position, velocity = recording.reference_position, recording.reference_velocity
    if controller is None or controller.kp is None or controller.kd is None:
        return None
    if position is None or velocity is None:
        return None
    command = controller.kp * (position - recording.position) + controller.kd * (velocity - dq)
    if controller.kind == "pd_with_model_feedforward":
        acceleration, smoothing = recording.reference_acceleration, controller.coulomb_smoothing
        if acceleration is None or smoothing is None:
            return None
        reference = Reference(position, velocity, acceleration)
        command = command + feedforward(model.chain, model.nominal, reference, smoothing)
    return np.clip(command, -model.limits.torque, model.limits.torque)


def _at(time: Array, grid: Array, torque: Array) -> Array:
    """A torque on a grid, at other instants."""
    if len(time) == len(grid):
        return torque
    return np.column_stack([np.interp(time, grid, column) for column in torque.T])
