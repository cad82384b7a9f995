"""``testbench run`` of the default scenario by stage, with cold and with warm kernel caches."""

import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from ._arms import ROOT
from ._report import Goal, Report

SCENARIO = ROOT / "scenarios" / "tx90.yaml"
WARM_RUNS = 2


def measure() -> Report:
    with tempfile.TemporaryDirectory() as folder:
        runs = [_run(Path(folder)) for _ in range(1 + WARM_RUNS)]
    cold, warm = runs[0], min(runs[1:], key=lambda run: run["whole process"])
    rows = tuple(
        (stage, f"{cold[stage]:.1f}", f"{warm[stage]:.1f}", f"{cold[stage] / max(warm[stage], 1e-3):.1f}")
        for stage in warm
    )
    return Report(
        columns=("stage", "cold, s", "warm, s", "cold / warm"),
        rows=rows,
        goals=(
            Goal("s with cold kernel caches", cold["whole process"], 60, at_least=False),
            Goal("s with warm kernel caches", warm["whole process"], 20, at_least=False),
        ),
        notes=("Each run is a process of its own; warm is the better of two.",),
    )


def _run(folder: Path) -> dict[str, float]:
    """Seconds of each stage and of the whole process; the kernel cache lies in ``folder``."""
    environment = os.environ | {"NUMBA_CACHE_DIR": str(folder / "kernels")}
    command = [sys.executable, "-m", "benchmarks._stages", str(SCENARIO), str(folder / "results")]
    start = time.perf_counter()
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False)
    whole = time.perf_counter() - start
    if done.returncode:
        raise RuntimeError(f"{' '.join(command)} failed:\n{done.stderr}")
    return json.loads(done.stdout) | {"whole process": whole}
