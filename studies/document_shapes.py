"""The shapes of this project's own documents, as far as they are read again."""

from pathlib import Path
from typing import Any

from typing_extensions import TypedDict

from identification.errors import InputError
from testbench.containment.names import FolderName
from testbench.containment.shape import require_shape
from testbench.effects import effects

Value = float | list[float | None] | None


class _Quantity(TypedDict):
    value: Value
    std: Value
    unit: str


class _Place(TypedDict):
    effect: str
    joint: str | None


class _Named(_Place):
    probability: float | None
    parameters: dict[str, str | _Quantity]
    confusable_with: list[str]


class _Candidate(_Place):
    probability: float | None


class _Experiment(TypedDict):
    why: str
    file: str | None
    separation: float | None
    separation_now: float | None


class DiagnosisDocument(TypedDict):
    """diagnosis.json, as a loop reads it."""

    verdict: str
    runs: list[str]
    effects: list[_Named]
    candidates: list[_Candidate]
    not_observable: list[_Place]
    gap: dict[str, Any]
    next_experiment: _Experiment | None


class Manifest(TypedDict):
    """manifest.json of sealed cases."""

    sha256: dict[str, str]


class _Acting(_Place):
    into: str | None
    law: str | None
    severity: float
    values: dict[str, Any]
    moved: float


class _Settings(TypedDict):
    controller: str
    rate: float
    motions: list[Any]
    channels: list[str]


class _Rejected(TypedDict):
    effect: str
    why: str


class Answer(TypedDict):
    """True effects of a blind case, as in its answer file."""

    case: FolderName
    kind: str
    robot: str
    robot_error: float
    background: Any
    attempt: int
    effects: list[_Acting]
    rejected: list[_Rejected]
    settings: _Settings
    floor: list[float]


class Answers(TypedDict):
    """The answers of sealed cases."""

    answers: list[Answer]


class _Hidden(TypedDict):
    parameters: list[float]
    effects: list[float]


class StudyResult(TypedDict):
    """The result of one case of a study."""

    answer: Answer
    diagnosis: dict[str, Any]
    hidden: _Hidden
    seconds: float


def require_diagnosis(document: Any, path: Path) -> None:
    """Raise InputError unless a document is a diagnosis.json of effects that the catalogue has."""
    require_shape(path, DiagnosisDocument, document)
    for each in (*document["effects"], *document["candidates"], *document["not_observable"]):
        if each["effect"] not in effects():
            raise InputError(
                path, "effects", "effects of the catalogue", repr(each["effect"])[:80], effects()
            )
