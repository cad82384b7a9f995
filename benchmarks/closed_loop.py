"""The motion that a diagnosis proposes, against a random one within its limits and another cautious one."""

import json
import os
import subprocess
import sys
from collections import Counter
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from ._report import Report

SCENARIOS = Path(__file__).parents[1] / "scenarios"
NAMES = ("loop_confused", "loop_unobservable")
FOLLOW = ("proposed", "random", "first")
SEEDS = range(1, 6)
RIGHT, FIRST, OPEN, WRONG, NOTHING, AT_ONCE = (
    "what acts, and nothing else",
    "what acts first, and another effect that does not act",
    "still open",
    "a wrong name",
    "nothing",
    "settled by the first round already",
)


def measure() -> Report:
    trials = list(product(NAMES, SEEDS, FOLLOW))
    with TemporaryDirectory() as folder, ThreadPoolExecutor(os.cpu_count()) as pool:
        said = list(pool.map(lambda trial: _said(Path(folder), *trial), trials))
    found = Counter((name, follow, answer) for (name, _, follow), answer in zip(trials, said, strict=True))
    rows = [
        (name, answer, *(str(found[name, follow, answer]) for follow in FOLLOW))
        for name, answer in product(NAMES, (RIGHT, FIRST, OPEN, WRONG, NOTHING, AT_ONCE))
        if any(found[name, follow, answer] for follow in FOLLOW)
    ]
    return Report(
        columns=("scenario", "the second round names", *FOLLOW),
        rows=tuple(rows),
        notes=(f"{len(SEEDS)} seeds: nominal model, background, noise and first motions differ.",),
    )


def _said(folder: Path, name: str, seed: int, follow: str) -> str:
    """What the second round of a loop says."""
    out = folder / f"{name}_{seed}_{follow}"
    scenario = folder / f"{out.name}.yaml"
    text = (SCENARIOS / f"{name}.yaml").read_text().replace("../models", str(SCENARIOS.parent / "models"))
    scenario.write_text(f"{text}rounds: 2\nfollow: {follow}\n")
    command = [Path(sys.executable).parent / "testbench", "loop", scenario, "--out", out]
    subprocess.run([*command, "--seed", str(seed)], check=True, capture_output=True)
    return _answer(json.loads((out / "loop.json").read_text()))


def _answer(loop: Mapping[str, Any]) -> str:
    last = loop["rounds"][-1]
    if len(loop["rounds"]) == 1:
        return AT_ONCE
    acts = [(each["effect"], each["joint"]) for each in loop["acts"]]
    named = [(each["effect"], each["joint"]) for each in last["effects"]]
    if not named:
        return NOTHING
    if last["confused"]:
        return OPEN
    if named == acts:
        return RIGHT
    return FIRST if named[0] in acts else WRONG
