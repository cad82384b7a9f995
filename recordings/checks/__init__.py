"""Checks that an experienced engineer makes of a log first: one check a file, found by import.

A check's file has ``STAGE`` and ``check``. Checks of a later stage need logs in which those of earlier stages
found nothing that makes every answer meaningless: they are left out otherwise.
"""

import importlib
import pkgutil
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Protocol, cast

from testbench.log import Recording
from testbench.robot import Robot

from .finding import Finding, Severity
from .subject import Subject

__all__ = ["Finding", "Severity", "checks", "require_sound", "run_checks"]


class Check(Protocol):
    """Interface of a check's file. STAGE: 0 samples, 1 signals, 2 conventions, 3 what is identifiable."""

    STAGE: int

    def check(self, subject: Subject) -> list[Finding]:
        """Findings of the check, the most important first."""
        ...


@cache
def checks() -> Mapping[str, Check]:
    """Every check by name, by stage and in alphabetical order."""
    names = sorted(module.name for module in pkgutil.iter_modules(__path__))
    modules = {name: importlib.import_module(f".{name}", __name__) for name in names}
    found = {name: cast(Check, module) for name, module in modules.items() if hasattr(module, "STAGE")}
    return dict(sorted(found.items(), key=lambda each: each[1].STAGE))


def run_checks(robot: Robot, recordings: Mapping[str, Recording]) -> tuple[Finding, ...]:
    """Findings of all checks in these runs, the most severe first. recordings: by name."""
    subject, found = Subject(robot, recordings), list[Finding]()
    stage = 0
    for each in checks().values():
        if stage < each.STAGE and any(finding.severity is Severity.STOP for finding in found):
            break
        stage = each.STAGE
        found += each.check(subject)
    order = list(Severity)
    return tuple(sorted(found, key=lambda finding: order.index(finding.severity)))


def require_sound(
    robot: Robot, recordings: Mapping[str, Recording], paths: Sequence[Path]
) -> tuple[Finding, ...]:
    """Findings of all checks. Raises InputError, naming the file, where one makes every answer meaningless.

    paths: the files of the recordings, in their order.
    """
    found = run_checks(robot, recordings)
    stops = [each for each in found if each.severity is Severity.STOP]
    if stops:
        files = dict(zip(recordings, paths, strict=True))
        of_run = [each for each in stops if each.run == stops[0].run]
        sentence = "; ".join(dict.fromkeys(each.sentence for each in of_run))
        source = files.get(stops[0].run, ", ".join(map(str, paths)))
        raise replace(stops[0], sentence=sentence).error(source)
    return found
