"""One case of a comparison: what is run, under which key its result is kept, and the result."""

import hashlib
import importlib
import json
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from identification.errors import InputError

QUESTIONS = ("criteria", "estimators", "differentiation", "trajectories")

# Figures of one case by name; what is unknown is None.
Row = dict[str, float | int | str | None]


def require_question(question: str) -> None:
    """Raise InputError with the valid ones unless there is such a question."""
    if question not in QUESTIONS:
        raise InputError("compare", "question", "what to compare", repr(question), QUESTIONS)


@dataclass(frozen=True)
class Case:
    """A case that any process can run: strings and JSON types only.

    question: the module that runs it. choice, level, seed: where it stands in the grid. settings: all else
    that its result follows from. files: paths by name, of which only the content counts.
    """

    question: str
    choice: str
    level: str
    seed: int
    settings: dict[str, Any]
    files: dict[str, str]

    @cached_property
    def key(self) -> str:
        """A hash of everything that the result follows from."""
        contents = {
            name: hashlib.sha256(Path(path).read_bytes()).hexdigest() for name, path in self.files.items()
        }
        hashed = [self.question, self.choice, self.level, self.seed, self.settings, contents]
        return hashlib.sha256(json.dumps(hashed, sort_keys=True).encode()).hexdigest()[:20]


def run_case(case: Case) -> Row:
    """The figures of a case; ``note`` says why there are none where the choice cannot do it."""
    row: Row = {"choice": case.choice, "level": case.level, "seed": case.seed, "note": None}
    module = importlib.import_module(f"{__package__}.{case.question}")
    try:
        return row | module.run(case)
    except InputError as error:
        return row | {"note": str(error)}
