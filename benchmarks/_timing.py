"""Fair timing of rival ways to do one thing, on a machine that may be busy."""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Timings:
    """Wall-clock seconds by name, one value a round, all rivals in every round."""

    seconds: Mapping[str, np.ndarray]

    def median(self, name: str) -> float:
        """Median over the rounds, s."""
        return float(np.median(self.seconds[name]))

    def speedup(self, rival: str, ours: str) -> float:
        """How many times faster ``ours`` is: the median of the rounds' own ratios, so that load cancels."""
        return float(np.median(self.seconds[rival] / self.seconds[ours]))


def alternate(rivals: Mapping[str, Callable[[], object]], rounds: int) -> Timings:
    """Time every rival once a round, after one call of each that does not count.

    The order turns from round to round, so that none always follows the same other.
    """
    for work in rivals.values():
        work()
    names = list(rivals)
    seconds: dict[str, list[float]] = {name: [] for name in names}
    for turn in range(rounds):
        for name in np.roll(names, turn):
            start = time.perf_counter()
            rivals[name]()
            seconds[name].append(time.perf_counter() - start)
    return Timings({name: np.array(values) for name, values in seconds.items()})
