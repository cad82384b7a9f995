"""One model through the command line: excite, simulate, identify, diagnose; how far it came, and why."""

import signal
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from dataclasses import dataclass, replace
from io import StringIO
from pathlib import Path
from typing import Any

from testbench.cli import main
from testbench.files import read_json

# Hz, harmonics and iterations of the designs, few for the sake of time, and seeds of two of them: one motion
# cannot be judged by itself.
BASE_FREQUENCY, HARMONICS, ITERATIONS, DESIGNS = 0.15, 3, 20, (0, 1)
# The effect that a robot has when it is not healthy: one that any drive can bear.
EFFECT = "torque_gain_error:1"
# Processor seconds that a command may take.
PATIENCE = 400.0
# Names of this probability or more are reported.
STATED = 0.5
COMMANDS = ("excite", "simulate", "identify", "diagnose")


@dataclass(frozen=True)
class Outcome:
    """Result of excitation, simulation and diagnosis with one model.

    model: its path below the folder. joints: how many moved, 0 before excite is done. notes: what was said
    of the model's file. stopped: the command that failed, "" where none did. reason: its line. speed: the
    largest peak as a share of a rated or assumed speed. healthy, affected: names given without an effect,
    and with EFFECT.
    """

    model: str
    joints: int = 0
    notes: tuple[str, ...] = ()
    stopped: str = ""
    reason: str = ""
    speed: float = 0.0
    healthy: tuple[str, ...] = ()
    affected: tuple[str, ...] = ()

    @property
    def works(self) -> bool:
        """Whether every command did, no design was too fast, and the healthy robot got no name."""
        return not self.stopped and self.speed <= 1.0 and not self.healthy


class _StoppedError(Exception):
    """A command that failed: its name and its line."""


def judge(model: Path, name: str, folder: Path, options: tuple[str, ...] = ()) -> Outcome:
    """Result of all commands on a model. folder: for the files. options: of commands that read the model."""
    folder.mkdir(parents=True, exist_ok=True)
    outcome = Outcome(name)
    try:
        for seed in DESIGNS:
            motion = folder / f"motion_{seed}.json"
            said = _run(
                folder, "excite", "--model", model, *options, "--out", motion, "--starts", "1",
                "--base-frequency", BASE_FREQUENCY, "--harmonics", HARMONICS, "--iterations", ITERATIONS,
                "--seed", seed,
            )  # fmt: skip
            document = read_json(motion)
            outcome = replace(
                outcome,
                joints=len(document["joint_names"]),
                notes=tuple(line for line in said.splitlines() if line.startswith(f"{model.name}: ")),
                speed=max(outcome.speed, _speed(document)),
            )
        healthy = _logs(model, folder, "healthy", options)
        _run(
            folder, "identify", healthy[0], "--validate", healthy[1], "--model", model, *options,
            "--out", folder / "identified",
        )  # fmt: skip
        outcome = replace(outcome, healthy=_names(model, healthy, folder / "healthy", options))
        if not outcome.works:
            return outcome
        affected = _logs(model, folder, "affected", (*options, "--effect", EFFECT))
        outcome = replace(outcome, affected=_names(model, affected, folder / "affected", options))
    except _StoppedError as error:
        stopped, reason = error.args
        return replace(outcome, stopped=stopped, reason=reason.replace(str(model), model.name))
    return outcome


def _logs(model: Path, folder: Path, name: str, options: tuple[str, ...]) -> list[Path]:
    logs = []
    for seed in DESIGNS:
        logs.append(folder / f"{name}_{seed}.h5")
        _run(
            folder, "simulate", "--model", model, *options, "--trajectory", folder / f"motion_{seed}.json",
            "--out", logs[-1], "--periods", 1, "--seed", seed,
        )  # fmt: skip
    return logs


def _names(model: Path, logs: list[Path], out: Path, options: tuple[str, ...]) -> tuple[str, ...]:
    """Effects that a diagnosis of these logs reports, with their joints."""
    _run(out.parent, "diagnose", *logs, "--model", model, *options, "--out", out)
    document = read_json(out / "diagnosis.json")
    return tuple(
        f"{each['effect']} {each.get('joint') or ''}".strip()
        for each in document["effects"]
        if each["probability"] >= STATED
    )


def _speed(document: dict[str, Any]) -> float:
    """The largest peak over its limit: what is left to the limit is in the document."""
    pairs = zip(document["peaks"]["velocity"], document["margins"]["velocity"], strict=True)
    return max(peak / (peak + left) for peak, left in pairs)


def _run(folder: Path, command: str, *arguments: object) -> str:
    """Output of a command. Raises _StoppedError with the last line of its error output."""
    out, complaint = StringIO(), StringIO()
    try:
        with redirect_stdout(out), redirect_stderr(complaint), _patience(command):
            main([command, *map(str, arguments)])
    except SystemExit as end:
        if end.code:
            lines = [line for line in complaint.getvalue().splitlines() if line.strip()]
            reason = lines[-1] if lines else f"exit status {end.code}"
            raise _StoppedError(command, reason.replace(f"{folder}/", "")) from None
    except _StoppedError:
        raise
    # A fault of ours, which is a result as well.
    except Exception as error:
        raise _StoppedError(command, f"{type(error).__name__}: {error}") from error
    return out.getvalue()


@contextmanager
def _patience(command: str) -> Iterator[None]:
    """Raise _StoppedError in what is within after PATIENCE of the processor's time."""

    def stop(*_: object) -> None:
        raise _StoppedError(command, f"over {PATIENCE:g} s of the processor")

    before = signal.signal(signal.SIGPROF, stop)
    signal.setitimer(signal.ITIMER_PROF, PATIENCE)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, before)
