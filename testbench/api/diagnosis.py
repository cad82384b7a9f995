"""Why simulator and robot disagree, and what the corrected model predicts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, overload

from identification.errors import InputError

from ..blas import single_blas_thread
from ..html_table import html_table
from .drives import DriveDiagnosis, DriveEstimate, PositionPrediction, diagnose_position, predict_position

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from diagnosis.correction.prediction import PredictedTorque
    from diagnosis.decision.findings import Diagnosis, Gap, NamedEffect
    from diagnosis.experiment.discriminating_motion import NextExperiment

    from ..log import Recording
    from ..robot import Robot
    from .drives import Stated

    Array = NDArray[np.float64]


@dataclass(frozen=True)
class DiagnosisResult:
    """A diagnosis and the runs that it is of.

    Attributes:
        details: everything that was found, with the fits behind it.
        recordings: the runs by name.
    """

    details: Diagnosis
    recordings: Mapping[str, Recording]

    @property
    def robot(self) -> Robot:
        """The model as given."""
        return self.details.robot

    @property
    def verdict(self) -> str:
        """``none``, ``parameters``, ``effect`` or ``unknown``."""
        return self.details.verdict

    @property
    def sentence(self) -> str:
        """The verdict in words."""
        return self.details.sentence

    @property
    def effects(self) -> tuple[NamedEffect, ...]:
        """The effects that are reported, the strongest first: name, joint, probability, parameters."""
        return self.details.effects

    @property
    def gap(self) -> Gap:
        """RMS torque error a joint on runs left out: as given, re-identified, and with the effects."""
        return self.details.gap

    def next_experiment(self, seed: int = 0) -> NextExperiment | None:
        """The motion that distinguishes what these runs leave open; None where nothing is open."""
        from diagnosis.experiment.discriminating_motion import next_experiment

        with single_blas_thread():
            return next_experiment(self.details, seed)

    def _repr_html_(self) -> str:
        """The verdict, and each reported effect with its place, probability and parameters."""
        from diagnosis.report import words

        rows = [
            (
                words.title(each.effect),
                words.place(self.robot, each.joint, each.into),
                f"{100 * each.probability:.0f} %",
                words.parameters(each, self.details.run_names),
            )
            for each in self.effects
        ]
        return html_table(("effect", "place", "probability", "parameters"), rows, (self.sentence,))

    def plot(self) -> Any:
        """The torque error of each joint before and after, as a plotly figure."""
        from diagnosis.report.figures import gap_by_joint

        return gap_by_joint(self.details)


@dataclass(frozen=True)
class Prediction:
    """The torque along a run's motion, by the model as given and by the corrected one.

    Attributes:
        recording: the run whose motion it is.
        torque: (N, n) N·m (N) at the run's instants: ``nominal``, ``parameters`` and ``corrected``.
        band: (n,) Hz, corner of the low-pass that each joint's torques passed; None for all frequencies.
    """

    recording: Recording
    torque: PredictedTorque
    band: Array | None

    @property
    def measured(self) -> Array | None:
        """The run's own torque (N, n) N·m (N) in the same band; None where none was measured."""
        from diagnosis.correction.prediction import low_passed

        if not self.recording.has_torque:
            return None
        torque = self.recording.torque
        return torque if self.band is None else low_passed(torque, self.recording.sample_rate, self.band)

    def _repr_html_(self) -> str:
        """RMS of each joint's torque and, where it was measured, of what each model leaves of it."""
        import numpy as np

        measured, names = self.measured, self.recording.joint_names
        stages = (self.torque.nominal, self.torque.parameters, self.torque.corrected)
        shown = stages if measured is None else (measured, *(measured - each for each in stages))
        models = ("as given", "re-identified", "corrected")
        headings = models if measured is None else ("measured", *(f"error {each}" for each in models))
        rms = [np.sqrt(np.mean(each**2, axis=0)).tolist() for each in shown]
        rows = [(name, *values) for name, *values in zip(names, *rms, strict=True)]
        return html_table(("joint", *headings), rows, ("Torque, RMS, N·m (N)",))

    def plot(self) -> Any:
        """Torque over time, a panel a joint, as a plotly figure."""
        from ..report.run_figures import by_joint

        measured = self.measured
        torques = {} if measured is None else {"measured": measured}
        torques |= {"model as given": self.torque.nominal, "corrected": self.torque.corrected}
        return by_joint(
            self.recording.time, torques, self.recording.joint_names, self.recording.torque_units()
        )


@overload
def diagnose(
    robot: Robot,
    runs: Mapping[str, Recording],
    *,
    without: Sequence[str] = (),
    cutoff: float | None = None,
    payloads: Mapping[str, float] | None = None,
) -> DiagnosisResult: ...


@overload
def diagnose(
    robot: Robot, runs: Mapping[str, Recording], *, without: Sequence[str] = (), drive: Stated
) -> DriveDiagnosis: ...


@single_blas_thread()
def diagnose(
    robot: Robot,
    runs: Mapping[str, Recording],
    *,
    without: Sequence[str] = (),
    cutoff: float | None = None,
    payloads: Mapping[str, float] | None = None,
    drive: Stated | None = None,
) -> DiagnosisResult | DriveDiagnosis:
    """Where model and robot disagree, which effect causes it, and how far it shrinks on runs left out.

    Of a robot that measures no torque (``drive``), in its position: the closed loop is simulated.

    Args:
        robot: the model as given.
        runs: by name; two or more, of a minute in all, determine most.
        without: effects to leave out of the catalogue.
        cutoff: Hz, no joint's band is wider; as its encoders let when None.
        payloads: kg by a run's name: that run carries this mass and the others do not.
        drive: as of ``identify``; neither ``cutoff`` nor ``payloads`` goes with it.

    Raises:
        InputError: a run is unsound or too short, or an option has no such value, or not beside the others.
    """
    if drive is not None:
        if cutoff is not None or payloads:
            option = "payloads" if payloads else "cutoff"
            expected, got = "runs with torque", "a loop that is simulated, which has none"
            raise InputError("diagnose", option, expected, got)
        return diagnose_position(robot, runs, drive, without)
    from diagnosis.job import diagnose_runs

    return DiagnosisResult(diagnose_runs(robot, runs, without, cutoff, payloads), dict(runs))


@overload
def predict(
    diagnosis: DriveEstimate | DriveDiagnosis, run: Recording, *, drive: Stated | None = None
) -> PositionPrediction: ...


@overload
def predict(diagnosis: DiagnosisResult, run: Recording, *, raw: bool = False) -> Prediction: ...


@overload
def predict(
    diagnosis: str | Path, run: Recording, *, raw: bool = False, drive: Stated | None = None
) -> Prediction | PositionPrediction: ...


@single_blas_thread()
def predict(
    diagnosis: DiagnosisResult | DriveEstimate | DriveDiagnosis | str | Path,
    run: Recording,
    *,
    raw: bool = False,
    drive: Stated | None = None,
) -> Prediction | PositionPrediction:
    """The torque along a run's motion by the corrected model; the run's torque is not read.

    Of a robot that measures no torque, the position: the closed loop is simulated on the run's command.

    Args:
        diagnosis: a result, or the folder that ``testbench diagnose`` or ``export`` has written.
        run: whose motion it is.
        raw: at all frequencies, not in each joint's band alone.
        drive: as of ``identify``, where this run states no gains and has others than those identified.

    Raises:
        InputError: the folder holds no diagnosis, or the motion is not one that its robot can make.
    """
    from diagnosis.correction.corrected_model import corrected_model
    from diagnosis.correction.prediction import predict_along, read_diagnosed

    from ..drives.document import is_drives

    if isinstance(diagnosis, DiagnosisResult):
        model = corrected_model(diagnosis.details)
    elif not isinstance(diagnosis, str | Path):
        return predict_position(diagnosis, run, drive)
    elif is_drives(Path(diagnosis)):
        return predict_position(Path(diagnosis), run, drive)
    else:
        model = read_diagnosed(Path(diagnosis))
    return Prediction(run, *predict_along(model, run, Path("run"), raw))
