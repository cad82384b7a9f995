"""One case made: logs and nominal model for whoever diagnoses, hidden run and answer for whoever scores."""

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.errors import InputError
from testbench.files import read_json, write_json
from testbench.log import write_log

from .draw import DrawnEffect, case_names, drawn_case
from .hidden import Moved, floor, moved
from .scenario import BlindScenario
from .simulated import PlannedCase, ideal_runs, planned_case, simulated_case

CASES, SEALED = "cases", "sealed"
NOMINAL, HIDDEN, ANSWER = "nominal.xml", "hidden.h5", "answer.json"
# A case whose robot cannot be driven, or whose effects move too little, is drawn again, so often.
ATTEMPTS = 40
# Why an effect that was drawn does not act.
LITTLE, BESIDE, NOT_DRIVEN = "moves too little", "beside one that moves too little", "cannot be driven"


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
        """File with the true effects of this case; written last."""
        return self.sealed / ANSWER


def places(out: Path, name: str) -> Places:
    """The places of the case of that name."""
    return Places(out / CASES / name, out / SEALED / name)


def make_case(scenario: BlindScenario, index: int, out: Path) -> dict[str, Any]:
    """Write case ``index`` below ``out`` unless it is there, and return its answer.

    The same scenario and index give the same files. Raises InputError where no robot can be driven.
    """
    place = places(out, case_names(index + 1)[-1])
    if place.answer.is_file():
        return read_json(place.answer)
    for folder in (place.given, place.sealed):
        folder.mkdir(parents=True, exist_ok=True)
    rejected: list[dict[str, Any]] = []
    for attempt in range(ATTEMPTS):
        drawing, simulating = np.random.SeedSequence((scenario.seed, index, attempt)).spawn(2)
        draw = drawn_case(scenario, index, drawing)
        try:
            with tempfile.TemporaryDirectory() as scratch:
                plan = planned_case(scenario, draw, simulating, place.nominal, Path(scratch))
            measured = moved(plan.robot, ideal_runs(plan))
            least = [_largest_share(each, measured.torque) for each in measured.alone]
            # What is drawn again needs no logs.
            little = any(share < scenario.least_moved for share in least)
            made = None if little else simulated_case(plan)
        except InputError as error:
            rejected += [_rejected(each, attempt, NOT_DRIVEN) for each in draw.effects]
            refused = error
            continue
        if made is None:
            for each, share in zip(draw.effects, least, strict=True):
                rejected.append(_rejected(each, attempt, LITTLE if share < scenario.least_moved else BESIDE))
            refused = InputError(
                draw.name, "effects", "effects that move the robot's torque", "none that does"
            )
            continue
        for number, recording in enumerate(made.given, start=1):
            write_log(recording, place.given / f"run_{number}.h5")
        write_log(made.hidden, place.hidden)
        settings = draw.answer()
        answer = {
            "case": draw.name,
            "kind": draw.kind,
            "robot": scenario.robots[draw.robot].model.stem,
            "robot_error": scenario.robots[draw.robot].error,
            "joint_names": list(plan.robot.joint_names),
            "effects": _effects(draw.effects, plan, measured),
            "background": draw.background,
            "attempt": attempt,
            "rejected": rejected,
            "settings": {
                name: settings[name] for name in settings if name not in ("name", "kind", "effects")
            },
            "effect_rms": measured.together.tolist(),
            "torque_rms": measured.torque.tolist(),
            "floor": floor(plan.nominal, made.twin).tolist(),
        }
        write_json(answer, place.answer)
        # As whoever comes later reads it.
        return read_json(place.answer)
    raise refused


def _rejected(drawn: DrawnEffect, attempt: int, why: str) -> dict[str, Any]:
    """An effect that was drawn and does not act."""
    return {"effect": drawn.effect, "severity": drawn.severity, "attempt": attempt, "why": why}


def _effects(drawn: Sequence[DrawnEffect], plan: PlannedCase, measured: Moved) -> list[dict[str, Any]]:
    """True effects by name. moved: largest over the joints of the torque moved, as a share of that needed."""
    names = plan.robot.joint_names
    return [
        {
            "effect": injection.effect,
            "joint": None if injection.joint is None else names[injection.joint],
            "into": None if injection.into is None else names[injection.into],
            "law": None if each.law is None else injection.law,
            "severity": each.severity,
            "values": injection.values,
            "moved": _largest_share(rms, measured.torque),
        }
        for each, injection, rms in zip(drawn, plan.injections, measured.alone, strict=True)
    ]


def _largest_share(effect_rms: NDArray[np.float64], torque_rms: NDArray[np.float64]) -> float:
    """Torque moved over torque needed, the largest over the joints; (n,) each."""
    return float(np.max(effect_rms / np.maximum(torque_rms, np.finfo(float).tiny)))
