"""Servos identified by ours, mujoco.sysid, PACE's way and BAM's program: held-out position error and time.

Needs the extra ``peers``, recordings in the folder SERVO_RECORDINGS, and for BAM a Python 3.12 with
better-actuator-models and optuna below 4.4 in BAM_PYTHON. Where SERVO_RESULTS names a folder, fits that are
there are not made again.
"""

import io
import os
import time
from collections.abc import Callable
from contextlib import redirect_stdout
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from identification.output_error.plant import limbs
from testbench.drives.identified import given_table, identify_drives, simulated

from . import _servo_bam as bam
from ._report import Goal, Report
from ._servo_case import FOLDER, Case, Rival, cases, mean_absolute, rms_of

RESULTS = "SERVO_RESULTS"
OURS, PUBLISHED = "ours", "published"
# Times as fast as the rivals that fit the same figures; share of the published model's error.
FASTER, HALF = 10.0, 0.5


def measure() -> Report:
    if FOLDER not in os.environ:
        return Report(("nothing measured",), (), notes=(f"{FOLDER} names no folder of recordings.",))
    with TemporaryDirectory() as made:
        folder = Path(os.environ.get(RESULTS, made))
        with redirect_stdout(io.StringIO()):
            competing = cases()
        found = [(case, _rivals(case, folder)) for case in competing]
    rows, goals, notes = [], [], []
    for case, rivals in found:
        ours = rivals[0]
        for each in rivals:
            rms = rms_of(case, each)
            rows.append(
                (
                    f"{case.name} {each.name}",
                    f"{1e3 * np.sqrt(np.mean(rms**2)):.2f}",
                    f"{1e3 * mean_absolute(case, each):.2f}",
                    f"{mean_absolute(case, each) / mean_absolute(case, ours):.2f}",
                    f"{each.seconds:.0f}",
                    f"{each.processor:.1f}",
                    f"{each.processor / ours.processor:.1f}" if each.processor else "-",
                )
            )
            notes.append(f"{case.name}, {each.name}: {each.how}.")
        goals += _goals(case, rivals)
    columns = (
        "", "RMS mrad", "mean absolute mrad", "times ours", "s", "processor s", "times ours",
    )  # fmt: skip
    return Report(columns, tuple(rows), tuple(goals), tuple(notes))


def _goals(case: Case, rivals: list[Rival]) -> list[Goal]:
    """Ours against each rival, and on the legs against the model as published."""
    ours, *others = rivals
    pooled = {each.name: float(np.sqrt(np.mean(rms_of(case, each) ** 2))) for each in rivals}
    of_bam = [mean_absolute(case, each) for each in others if each.name.startswith("BAM")]
    out = []
    for each in others:
        if each.name == PUBLISHED:
            share = rms_of(case, ours) / rms_of(case, each)
            ratio, above = pooled[OURS] / pooled[each.name], float(np.sum(share > HALF))
            out.append(Goal(f"{case.name}: of the published", ratio, HALF, at_least=False))
            out.append(Goal(f"{case.name}: joints above half", above, 0, at_least=False))
        elif not each.name.startswith("BAM"):
            ratio = pooled[OURS] / pooled[each.name]
            out.append(Goal(f"{case.name}: RMS over that of {each.name}", ratio, 1.0, at_least=False))
            speed = each.processor / ours.processor
            out.append(Goal(f"{case.name}: times as fast as {each.name}", speed, FASTER))
    if of_bam:
        ratio = mean_absolute(case, ours) / min(of_bam)
        out.append(Goal(f"{case.name}: mean absolute over BAM's best", ratio, 1.0, at_least=False))
    return out


def _rivals(case: Case, folder: Path) -> list[Rival]:
    """Ours, the model as published, and all that others make of the case."""
    out = [_ours(case), _published(case)]
    for module, name in (("_servo_sysid", "mujoco.sysid"), ("_servo_pace", "PACE's way")):
        out.append(_kept(folder / f"{case.name}{module}", name, lambda m=module: _simulating(case, m)))
    if case.name == "xl330" and bam.is_there():
        for model in bam.MODELS:
            name = f"BAM {model.upper()}"
            out.append(_kept(folder / f"{case.name}_{model}", name, lambda m=model: _bam(case, m, folder)))
    return out


def _ours(case: Case) -> Rival:
    # Once before for the kernels, which are compiled once an installation.
    identify_drives(case.robot, [case.servo], case.fitted[:1], case.effects)
    clock, processor = time.perf_counter(), time.process_time()
    found = identify_drives(case.robot, [case.servo] * len(case.fitted), case.fitted, case.effects)
    took = time.perf_counter() - clock, time.process_time() - processor
    predicted = [simulated(found.limbs, found.identified, run).position for run in case.judged]
    return Rival(OURS, predicted, *took, "all figures of testbench identify, by its defaults")


def _published(case: Case) -> Rival:
    parts, table = limbs(case.robot.chain), given_table(case.robot, case.servo)
    predicted = [simulated(parts, table, run).position for run in case.judged]
    return Rival(PUBLISHED, predicted, 0.0, 0.0, "the model and the servos as stated")


def _simulating(case: Case, module: str) -> tuple[list[np.ndarray], float, float, str]:
    # Its packages are those of the extra.
    way = import_module(f"{__package__}.{module}")
    clock, processor = time.perf_counter(), time.process_time()
    with redirect_stdout(io.StringIO()):
        found, how = way.fitted(case)
    took = time.perf_counter() - clock, time.process_time() - processor
    return [way.predicted(case, found, run) for run in case.judged], *took, how


def _bam(case: Case, model: str, folder: Path) -> tuple[list[np.ndarray], float, float, str]:
    clock, before = time.perf_counter(), os.times()
    found, how = bam.fitted(case, model, folder / "bam")
    took, after = time.perf_counter() - clock, os.times()
    processor = sum(after[2:4]) - sum(before[2:4])
    return bam.predicted(case, found, folder / "bam"), took, processor, how


def _kept(path: Path, name: str, work: Callable[[], tuple[list[np.ndarray], float, float, str]]) -> Rival:
    """A rival's outcome, from its file where there is one."""
    path = path.with_suffix(".npz")
    if not path.exists():
        path.parent.mkdir(parents=True, exist_ok=True)
        predicted, seconds, processor, how = work()
        np.savez(path, *predicted, seconds=seconds, processor=processor, how=how)
    with np.load(path, allow_pickle=False) as kept:
        predicted = [kept[f"arr_{run}"] for run in range(len(kept.files) - 3)]
        return Rival(name, predicted, float(kept["seconds"]), float(kept["processor"]), str(kept["how"]))
