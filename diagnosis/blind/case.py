"""One case made: logs and nominal model for whoever diagnoses, hidden run and answer for whoever scores."""

import json
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.errors import InputError
from testbench.files import replacing
from testbench.log import write_log

from .draw import DrawnEffect, drawn_case
from .hidden import Moved, floor, moved
from .scenario import BlindScenario
from .simulated import SimulatedCase, simulated_case

CASES, SEALED = "cases", "sealed"
NOMINAL, HIDDEN, ANSWER = "nominal.xml", "hidden.h5", "answer.json"
# A drawn robot that cannot be driven is drawn again, so often.
ATTEMPTS = 10


@dataclass(frozen=True)
class Places:
    """Where a case's files are. given: nominal.xml and run_*.h5. sealed: hidden.h5 and answer.json."""

    given: Path
    sealed: Path

    @property
    def nominal(self) -> Path:
        """The nominal model."""
        return self.given / NOMINAL

    @property
    def logs(self) -> list[Path]:
        """The runs that are given, by number."""
        return sorted(self.given.glob("run_*.h5"), key=lambda path: (len(path.name), path.name))

    @property
    def hidden(self) -> Path:
        """The run that is never given."""
        return self.sealed / HIDDEN

    @property
    def answer(self) -> Path:
        """What acts in this case; written last."""
        return self.sealed / ANSWER


def places(out: Path, name: str) -> Places:
    """The places of the case of that name."""
    return Places(out / CASES / name, out / SEALED / name)


def make_case(scenario: BlindScenario, index: int, out: Path) -> dict[str, Any]:
    """Write case ``index`` below ``out`` unless it is there, and return its answer.

    The same scenario and index give the same files. Raises InputError where no robot can be driven.
    """
    for attempt in range(ATTEMPTS):
        drawing, simulating = np.random.SeedSequence((scenario.seed, index, attempt)).spawn(2)
        draw = drawn_case(scenario, index, drawing)
        place = places(out, draw.name)
        if place.answer.is_file():
            return read_json(place.answer)
        for folder in (place.given, place.sealed):
            folder.mkdir(parents=True, exist_ok=True)
        try:
            with tempfile.TemporaryDirectory() as scratch:
                made = simulated_case(scenario, draw, simulating, place.nominal, Path(scratch))
        except InputError as error:
            refused = error
            continue
        measured = moved(made)
        if any(
            float(np.max(_share(each, measured.torque))) < scenario.least_moved for each in measured.alone
        ):
            refused = InputError(
                draw.name, "effects", "effects that move the robot's torque", "none that does"
            )
            continue
        for number, recording in enumerate(made.given, start=1):
            write_log(recording, place.given / f"run_{number}.h5")
        write_log(made.hidden, place.hidden)
        settings = draw.told()
        answer = {
            "case": draw.name,
            "kind": draw.kind,
            "robot": scenario.robots[draw.robot].model.stem,
            "robot_error": scenario.robots[draw.robot].error,
            "joint_names": list(made.robot.joint_names),
            "effects": _effects(draw.effects, made, measured),
            "background": draw.background,
            "attempt": attempt,
            "settings": {
                name: settings[name] for name in settings if name not in ("name", "kind", "effects")
            },
            "effect_rms": measured.together.tolist(),
            "torque_rms": measured.torque.tolist(),
            "floor": floor(made).tolist(),
        }
        write_json(answer, place.answer)
        # As whoever comes later reads it.
        return read_json(place.answer)
    raise refused


def _effects(drawn: Sequence[DrawnEffect], made: SimulatedCase, measured: Moved) -> list[dict[str, Any]]:
    """What acts, by names. moved: largest over the joints of the torque moved, as a share of that needed."""
    names = made.robot.joint_names
    return [
        {
            "effect": injection.effect,
            "joint": None if injection.joint is None else names[injection.joint],
            "into": None if injection.into is None else names[injection.into],
            "law": None if each.law is None else injection.law,
            "severity": each.severity,
            "values": injection.values,
            "moved": float(np.max(_share(rms, measured.torque))),
        }
        for each, injection, rms in zip(drawn, made.injections, measured.alone, strict=True)
    ]


def _share(effect_rms: NDArray[np.float64], torque_rms: NDArray[np.float64]) -> NDArray[np.float64]:
    """Torque moved over torque needed, (n,)."""
    return effect_rms / np.maximum(torque_rms, np.finfo(float).tiny)


def read_json(path: Path) -> Any:
    """A JSON file's content. Raises InputError when it is none."""
    if not path.is_file():
        raise InputError(path, "file", "an existing JSON file", "no such file")
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except (json.JSONDecodeError, UnicodeDecodeError) as error:
        raise InputError(path, "content", "JSON", str(error)) from None


def write_json(document: Any, path: Path) -> None:
    """Write a JSON file, whole or not at all."""
    text = json.dumps(document, ensure_ascii=False, indent=1, allow_nan=False)
    with replacing(path) as temporary:
        temporary.write_text(text + "\n", encoding="utf-8")
