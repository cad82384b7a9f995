"""The motion that a diagnosis proposes, against a random one within its limits and another cautious one."""

import io
from collections import Counter
from contextlib import redirect_stdout
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory

from studies.loop.job import close_loop
from studies.loop.outcome import Outcome
from testbench.processes import process_pool

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
    with TemporaryDirectory() as folder, process_pool() as pool:
        said = list(pool.map(_said, [Path(folder)] * len(trials), *zip(*trials, strict=True)))
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
    with redirect_stdout(io.StringIO()):
        return _answer(close_loop(scenario, out, seed, jobs=1))


def _answer(found: Outcome) -> str:
    last = found.rounds[-1]
    if len(found.rounds) == 1:
        return AT_ONCE
    if not last.named:
        return NOTHING
    if last.confused:
        return OPEN
    if found.is_right:
        return RIGHT
    return FIRST if last.named[0] in found.acts else WRONG
