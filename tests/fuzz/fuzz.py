"""Damaged inputs, read: each is read or refused in one line, soon, and leaves nothing anywhere."""

import subprocess
import sys
import time
import traceback
from collections import Counter
from pathlib import Path

import numpy as np

from identification.errors import InputError

from .damage import damaged
from .inputs import Input, inputs

# s that no input may take.
LONGEST = 20.0
COMMANDS = {
    "run.h5": "identify --model arm.xml run.h5 --out out",
    "model.xml": "identify --model model.xml good.h5 --out out",
    "motion.json": "simulate --model arm.xml --trajectory motion.json --out out.h5",
    "diagnosis.json": "predict good.h5 --diagnosis . --out out.h5",
}


def read_damaged(folder: Path, seed: int, runs: int) -> tuple[Counter[str], list[str]]:
    """How many inputs were read and how many refused, and what broke the promise, a text each."""
    kinds, counts, broken = inputs(folder), Counter[str](), []
    for index in range(runs):
        kind = kinds[index % len(kinds)]
        content = damaged(kind.content, np.random.default_rng((seed, index)))
        (folder / kind.name).write_bytes(content)
        before, began = _listing(folder), time.monotonic()
        said = _said(kind, folder / kind.name)
        seconds = time.monotonic() - began
        counts[f"{kind.name} {'read' if said == '' else 'refused'}"] += 1
        if said is None or seconds > LONGEST or _listing(folder) != before:
            why = traceback.format_exc(limit=-3) if said is None else f"{seconds:.1f} s"
            broken.append(f"{kind.name}, seed {seed}, run {index}: {why}")
    return counts, broken


def _said(kind: Input, path: Path) -> str | None:
    """The line of a refusal, nothing where the file was read, None where neither is so."""
    try:
        kind.read(path)
    except InputError as error:
        line = str(error)
        return line if line.isprintable() else None
    # Whatever else is raised is what is looked for.
    except Exception:
        traceback.print_exc(limit=-3)
        return None
    return ""


def run_damaged(folder: Path, seed: int, runs: int) -> list[str]:
    """What broke the promise among commands that were given damaged inputs."""
    kinds = {kind.name: kind for kind in inputs(folder) if kind.name in COMMANDS}
    (folder / "good.h5").write_bytes(kinds["run.h5"].content)
    broken = []
    for index in range(runs):
        name = list(kinds)[index % len(kinds)]
        for other in kinds.values():
            (folder / other.name).write_bytes(other.content)
        content = damaged(kinds[name].content, np.random.default_rng((seed, 10**6 + index)))
        (folder / name).write_bytes(content)
        command = [sys.executable, "-c", "from testbench.cli import main; main()", *COMMANDS[name].split()]
        done = subprocess.run(command, cwd=folder, capture_output=True, timeout=300, check=False)
        strange = set(_listing(folder)) - {
            "arm.xml",
            "good.h5",
            "out",
            "out.h5",
            *(kind.name for kind in inputs(folder)),
        }
        is_line = done.returncode == 2 and done.stderr.count(b"\n") == 1
        if not (done.returncode == 0 or is_line) or strange:
            broken.append(
                f"{name}, seed {seed}, command {index}: {done.returncode} {done.stderr[-600:]!r} {strange}"
            )
    return broken


def _listing(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())
