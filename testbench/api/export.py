"""Results as files, the same that the command line writes."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from identification.errors import InputError

from ..blas import single_blas_thread
from .diagnosis import DiagnosisResult, Prediction
from .drives import DriveDiagnosis, DriveEstimate, PositionPrediction
from .motion import Motion

if TYPE_CHECKING:
    from ..log import Recording
    from ..results import IdentificationResult

    OfTorque = IdentificationResult | DiagnosisResult | Prediction
    OfDrives = DriveEstimate | DriveDiagnosis | PositionPrediction
    Result = Motion | Recording | OfTorque | OfDrives


@single_blas_thread()
def export(result: Result, path: str | Path) -> None:
    """Write a result: whole, or not at all.

    | result | path | what is written |
    | --- | --- | --- |
    | `Motion` | `motion.json` | the trajectory, for `simulate` and for a robot's controller |
    | `Recording` | `run.h5` | a robot-log |
    | `Prediction` | `torque.h5` | a robot-log with the corrected model's torque |
    | `IdentificationResult` | `model.xml` | an MJCF with the nearest parameters of a robot that can exist |
    | | a folder | estimate.json and report.html |
    | `DiagnosisResult` | `corrected.xml` | an MJCF with the reported effects |
    | | a folder | diagnosis.json, corrected.xml, report.html, session.rrd, next_experiment.json |
    | `DriveEstimate` | `model.xml` | an MJCF with the identified parameters and position servos |
    | | a folder | estimate.json |
    | `DriveDiagnosis` | `corrected.xml` | likewise, with the stated effects as far as MJCF has them |
    | | a folder | diagnosis.json, estimate.json, corrected.xml, report.html |
    | `PositionPrediction` | `position.h5` | a robot-log with the identified loop's position and torque |

    Raises:
        InputError: the file cannot be written, or its name ends otherwise than the table says.
    """
    from ..files import require_writable
    from ..log import Recording, write_log

    path = Path(path)
    if isinstance(result, Motion):
        from ..excitation_file import write_excitation

        _require_suffix(path, ".json")
        write_excitation(result.excitation, path)
    elif isinstance(result, Recording):
        _require_suffix(path, ".h5")
        write_log(result, path)
    elif isinstance(result, Prediction):
        from diagnosis.correction.prediction import write_prediction

        _require_suffix(path, ".h5")
        write_prediction(result.recording, result.torque, result.band, path)
    elif isinstance(result, DriveEstimate | DriveDiagnosis | PositionPrediction):
        _export_drives(result, path)
    elif isinstance(result, DiagnosisResult):
        from diagnosis.correction.corrected_mjcf import write_corrected
        from diagnosis.job import write_results as write_diagnosis

        if path.suffix:
            _require_suffix(path, ".xml")
            require_writable(path, result.robot.path)
            write_corrected(result.details, path)
        else:
            write_diagnosis(result.details, result.recordings, path)
    else:
        from ..jobs.identify import write_identified_model, write_results

        if path.suffix:
            _require_suffix(path, ".xml")
            require_writable(path, result.robot.path)
            write_identified_model(result, path)
        else:
            write_results(result, path)


def _export_drives(result: OfDrives, path: Path) -> None:
    """Write a result of a robot that measures no torque."""
    from ..drives.corrected import write_corrected
    from ..files import require_writable

    if isinstance(result, PositionPrediction):
        from ..drives.job import as_recording
        from ..log import write_log

        _require_suffix(path, ".h5")
        write_log(as_recording(result.details, {}), path)
    elif path.suffix:
        _require_suffix(path, ".xml")
        require_writable(path, result.robot.path)
        write_corrected(result.details.found, path)
    elif isinstance(result, DriveEstimate):
        from ..drives.job import write_estimate

        write_estimate(result.details, path)
    else:
        from diagnosis.servos.job import write_results

        write_results(result.details, result.runs, path)


def _require_suffix(path: Path, suffix: str) -> None:
    if path.suffix != suffix:
        raise InputError(path, "path", f"a name that ends in {suffix}", repr(path.name))
