"""A drawn robot: its nominal model, its runs as robot-logs, and its true faults."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from testbench.log import Recording, write_log

Kind = Literal["healthy", "single", "pair", "unknown"]


@dataclass(frozen=True)
class Fault:
    """One thing that is wrong with a robot.

    effect: of the catalogue, or "unknown" for a law outside of it. joint, into: names; None where it has
    none.
    law: name of the law, for people. share: RMS of the torque that it moves over that of its joint.
    """

    effect: str
    joint: str | None
    into: str | None
    law: str
    share: float


@dataclass(frozen=True)
class Case:
    """A drawn robot.

    plant: its name. model: nominal MJCF. runs: 2 to 4. faults: the answer, empty if healthy.
    """

    plant: str
    seed: int
    kind: Kind
    model: str
    runs: tuple[Recording, ...]
    faults: tuple[Fault, ...]

    def write(self, folder: Path) -> tuple[Path, tuple[Path, ...]]:
        """Write model.xml and run_1.h5, run_2.h5 ... to an existing folder; returns their paths."""
        model = folder / "model.xml"
        model.write_text(self.model, encoding="utf-8")
        logs = tuple(folder / f"run_{index}.h5" for index in range(1, len(self.runs) + 1))
        for recording, log in zip(self.runs, logs, strict=True):
            write_log(recording, log)
        return model, logs
