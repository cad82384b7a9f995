"""Identify a robot's dynamics from its logs, and see why simulator and robot disagree.

The functions below do what the commands of the same names do. Types are loaded when they are asked for.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from identification.errors import InputError

from .api.diagnosis import DiagnosisResult, Prediction, diagnose, predict
from .api.drives import DriveDiagnosis, DriveEstimate, PositionPrediction
from .api.export import export
from .api.identification import identify
from .api.logs import check, load_robot, read_logs
from .api.motion import Motion, excite, simulate

if TYPE_CHECKING:
    from .drives.stated import StatedDrive
    from .log import Recording
    from .results import IdentificationResult
    from .robot import Robot

__all__ = [
    "DiagnosisResult",
    "DriveDiagnosis",
    "DriveEstimate",
    "IdentificationResult",
    "InputError",
    "Motion",
    "PositionPrediction",
    "Prediction",
    "Recording",
    "Robot",
    "StatedDrive",
    "check",
    "diagnose",
    "excite",
    "export",
    "identify",
    "load_robot",
    "predict",
    "read_logs",
    "simulate",
]

# Types whose modules load numpy, h5py or MuJoCo.
_LOADED_LATE = {
    "IdentificationResult": "results",
    "Recording": "log",
    "Robot": "robot",
    "StatedDrive": "drives.stated",
}


def __getattr__(name: str) -> Any:
    if name not in _LOADED_LATE:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f".{_LOADED_LATE[name]}", __name__), name)
