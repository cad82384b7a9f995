"""One diagnosis of a kept case, with every rule traced or with one neutralised, in a process of its own."""

import json
import multiprocessing
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from identification.errors import InputError
from testbench.blas import keep_blas_single
from testbench.files import read_json, write_json
from testbench.robot import load_robot
from testbench.runs import read_runs

from ..plants import draw
from .rules import install
from .traced import TRACE

ANSWER = "case.json"


def draw_case(plant: str, seed: int, folder: Path) -> None:
    """Leave a robot's model, logs and faults in a folder, the faults last."""
    folder.mkdir(parents=True, exist_ok=True)
    case = draw(plant, seed)
    case.write(folder)
    faults = [asdict(each) for each in case.faults]
    write_json({"plant": plant, "seed": seed, "kind": case.kind, "faults": faults}, folder / ANSWER)


def trace(case: Path) -> dict[str, Any]:
    """The answer of a kept case, as ``judged`` has it, and the rules that matter to it."""
    return _diagnosed(case, None) | {"matter": sorted(TRACE.matter)}


def neutralised(case: Path, rule: str) -> dict[str, Any]:
    """The answer of a kept case without a rule, as ``judged`` has it; one that crashes is an answer too."""
    return _diagnosed(case, rule)


def _diagnosed(case: Path, rule: str | None) -> dict[str, Any]:
    # Only now, so that the rules are as they are wanted.
    install(rule)
    from diagnosis.diagnose import diagnose
    from diagnosis.report.document import diagnosis_document

    from ..plants_study.study import REFUSED, judged

    known = read_json(case / ANSWER)
    robot = load_robot(case / "model.xml")
    logs = sorted(case.glob("run_*.h5"))
    runs = {log.stem: each for log, each in zip(logs, read_runs(logs, robot), strict=True)}
    began = time.process_time()
    try:
        said = diagnosis_document(diagnose(robot, runs))
    except InputError as error:
        said = {"verdict": REFUSED, "effects": [], "why": str(error)}
    except Exception as error:
        if rule is None:
            raise
        said = {"verdict": "crash", "effects": [], "why": f"{type(error).__name__}: {error}"}
    row = judged({key: known[key] for key in ("plant", "seed", "kind")}, known["faults"], said)
    return row | {"seconds": time.process_time() - began}


def apart(work: Callable[..., dict[str, Any]], place: Path, *inputs: Any) -> None:
    """Do some work in a process of its own, forked from this one, and leave the result at ``place``.

    This one must not have threads, and must not have imported ``diagnosis``. Raises RuntimeError where the
    process fails.
    """
    process = multiprocessing.get_context("fork").Process(target=_leave, args=(work, place, *inputs))
    process.start()
    process.join()
    if process.exitcode != 0:
        raise RuntimeError(f"{place.name}: process ended with {process.exitcode}")


def _leave(work: Callable[..., dict[str, Any]], place: Path, *inputs: Any) -> None:
    keep_blas_single()
    place.parent.mkdir(parents=True, exist_ok=True)
    write_json(work(*inputs), place)


def file_of(rule: str) -> str:
    """The name of a rule's folder."""
    return rule.replace(" = ", "__").replace("()", "empty")


def answer_of(row: Mapping[str, Any]) -> str:
    """Verdict and names of an answer, to see whether it is another."""
    named = sorted((each["effect"], each["joint"] or "", each["into"] or "") for each in row["named"])
    return json.dumps([row["verdict"], named])
