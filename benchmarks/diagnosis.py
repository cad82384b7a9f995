"""``testbench diagnose`` as a whole process: four runs of 12 s of a TX-90 at 1 kHz, two cores."""

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from studies.blind.case import make_case, places
from studies.blind.draw import case_names, kinds_of
from studies.blind.scenario import load_blind_scenario

from ._arms import MODEL, ROOT
from ._report import Goal, Report

SCENARIO = f"""
name: diagnosis_benchmark
seed: 4711
cases: {{single: 6, pair: 4, triple: 0, none: 2, unknown: 0}}
robots: [{{model: {MODEL}}}]
background: {{share: 0.5, smallest: 0.5, largest: 1.0}}
nominal: {{smallest: 0.3, largest: 1.2, links_alone: 0.2}}
least_moved: 0.01
runs: {{fewest: 4, most: 4, shortest: 11.999 s, longest: 12 s, sample_rates: [1000]}}
"""
MEDIAN, WORST, GIBIBYTES = 4.0, 8.0, 1.2
COMMAND = "from testbench.cli import main; main()"


def measure() -> Report:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "scenario.yaml").write_text(SCENARIO)
        scenario = load_blind_scenario(folder / "scenario.yaml")
        rows, figures = [], []
        for index, case in enumerate(case_names(len(kinds_of(scenario)))):
            answer, place = make_case(scenario, index, folder), places(folder, case)
            acts = ", ".join(each["effect"] for each in answer["effects"]) or "nothing"
            seconds, gibibytes = _diagnosed(place.nominal, place.logs, folder / "results" / case)
            figures.append((seconds, gibibytes))
            rows.append((acts, "yes" if answer["background"] else "no", f"{seconds:.1f}", f"{gibibytes:.2f}"))
    each, most = np.array(figures).T
    return Report(
        columns=("acts", "imperfect joints", "s", "GiB"),
        rows=tuple(rows),
        goals=(
            Goal("s of the case in the middle", float(np.median(each)), MEDIAN, at_least=False),
            Goal("s of the slowest", float(each.max()), WORST, at_least=False),
            Goal("GiB of the largest", float(most.max()), GIBIBYTES, at_least=False),
        ),
        notes=("Each case is a process of its own: imports, all figures and files, kernels from the cache.",),
    )


def _diagnosed(model: Path, logs: list[Path], out: Path) -> tuple[float, float]:
    """Seconds and GiB of one diagnosis, at its largest."""
    command = [sys.executable, "-c", COMMAND, "diagnose", "--model", model, *logs, "--out", out]
    start = time.perf_counter()
    process = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    seconds = time.perf_counter() - start
    if status:
        raise RuntimeError(f"the diagnosis of {model.parent.name} failed")
    # Linux counts kibibytes, macOS bytes.
    return seconds, usage.ru_maxrss * (1 if sys.platform == "darwin" else 1024) / 2**30
