"""The job behind ``loop``: simulate, diagnose, run what the diagnosis proposes, until nothing stays open."""

import shutil
from pathlib import Path
from typing import Any

from diagnosis.correction.correction_document import DOCUMENT
from diagnosis.experiment.discriminating_motion import FILE
from diagnosis.job import diagnose_logs
from identification.errors import InputError
from testbench.excitation_file import read_trajectory, write_excitation
from testbench.files import read_json, require_writable, write_json
from testbench.log import write_log
from testbench.progress import steps

from ..document_shapes import require_diagnosis
from .outcome import Outcome, Round, loop_document, outcome, read_round
from .page import write_page
from .scenario import LoopScenario, load_loop_scenario
from .summary import print_summary
from .withheld import Withheld, first_motions, other_motion, recorded, withheld

NOMINAL, BEGUN, RESULT, PAGE = "nominal.xml", "scenario.json", "loop.json", "report.html"
WRITTEN = (NOMINAL, BEGUN, RESULT, PAGE, "round_1")


def close_loop(scenario_file: Path, out: Path, seed: int | None = None, jobs: int | None = None) -> Outcome:
    """Run the rounds of a scenario that are left, until nothing stays open, and print ten lines.

    A round with a diagnosis is not run again. seed: instead of the scenario's. jobs: threads. Leaves
    nominal.xml, round_1/ and so on with logs and diagnosis, loop.json and report.html. Raises InputError.
    """
    scenario = load_loop_scenario(scenario_file, seed)
    require_writable(out / RESULT)
    _require_same(scenario, out / BEGUN)
    robot = withheld(scenario, scenario_file, out / NOMINAL)
    write_json(_follows_from(scenario), out / BEGUN)
    rounds: list[Round] = []
    while len(rounds) < scenario.rounds and (not rounds or rounds[-1].proposes):
        rounds.append(_round(robot, out, len(rounds) + 1, jobs))
    injections = robot.options.effects[: len(scenario.effects)]
    found = outcome(scenario, robot.robot, injections, rounds)
    write_json(loop_document(found), out / RESULT)
    motions = [read_trajectory(_motions(out, each.number)[0])[1] for each in rounds]
    write_page(found, robot.nominal, motions, out / PAGE)
    print_summary(found)
    return found


def _round(robot: Withheld, out: Path, number: int, jobs: int | None) -> Round:
    """Simulate a round's motions and diagnose all runs so far, unless that is done."""
    folder = _folder(out, number)
    if not (folder / DOCUMENT).is_file():
        folder.mkdir(parents=True, exist_ok=True)
        if number == 1:
            for index, excitation in enumerate(first_motions(robot), start=1):
                write_excitation(excitation, folder / f"motion_{index}.json")
        elif robot.scenario.follow == "proposed":
            shutil.copyfile(_folder(out, number - 1) / FILE, folder / "motion_1.json")
        else:
            write_excitation(other_motion(robot, number), folder / "motion_1.json")
        trajectories = [read_trajectory(path)[1] for path in _motions(out, number)]
        with steps() as progress, progress.step(f"round {number}: simulate"):
            recordings = recorded(robot, trajectories, number, jobs)
        # Runs are numbered through all rounds.
        first = len(_logs(out, number - 1)) + 1
        for index, recording in enumerate(recordings, start=first):
            write_log(recording, folder / f"run_{index}.h5")
        names = recordings[0].joint_names
        seed = robot.scenario.seed
        diagnose_logs(out / NOMINAL, _logs(out, number), folder, seed=seed, jobs=jobs, joint_names=names)
    document = read_json(folder / DOCUMENT)
    require_diagnosis(document, folder / DOCUMENT)
    return read_round(number, document)


def _folder(out: Path, number: int) -> Path:
    return out / f"round_{number}"


def _motions(out: Path, number: int) -> list[Path]:
    """The files of the motions that a round runs."""
    return sorted(_folder(out, number).glob("motion_*.json"), key=_order)


def _logs(out: Path, number: int) -> list[Path]:
    """The logs of all rounds up to this one."""
    paths = [path for each in range(1, number + 1) for path in _folder(out, each).glob("run_*.h5")]
    return sorted(paths, key=_order)


def _order(path: Path) -> tuple[int, str]:
    return len(path.name), path.name


def _require_same(scenario: LoopScenario, path: Path) -> None:
    """Raise InputError where the rounds of a folder followed from another scenario."""
    if path.is_file() and read_json(path) != _follows_from(scenario):
        raise InputError(path, "scenario", "the scenario and seed that the folder was begun with", "another")


def _follows_from(scenario: LoopScenario) -> dict[str, Any]:
    """Settings that determine the rounds, without their number, so that more may be asked for later."""
    return scenario.model_dump(mode="json", exclude={"rounds"}) | {"model": scenario.model.name}
