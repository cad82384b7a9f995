"""What an experienced engineer looks at first in a log: one check a file, found by import.

A check's file has ``STAGE`` and ``check``. Checks of a later stage need logs in which those of earlier stages
found nothing that makes every answer meaningless: they are left out otherwise.
"""

import importlib
import pkgutil
from collections.abc import Mapping
from functools import cache
from typing import Protocol, cast

from testbench.log import Recording
from testbench.robot import Robot

from .finding import Finding, Severity
from .subject import Subject

__all__ = ["Finding", "Severity", "checks", "run_checks"]


class Check(Protocol):
    """What a check's file offers. STAGE: 0 samples, 1 signals, 2 conventions, 3 what the runs can tell."""

    STAGE: int

    def check(self, subject: Subject) -> list[Finding]:
        """What it finds, in the order of its weight."""
        ...


@cache
def checks() -> Mapping[str, Check]:
    """Every check by name, by stage and in alphabetical order."""
    names = sorted(module.name for module in pkgutil.iter_modules(__path__))
    modules = {name: importlib.import_module(f".{name}", __name__) for name in names}
    found = {name: cast(Check, module) for name, module in modules.items() if hasattr(module, "STAGE")}
    return dict(sorted(found.items(), key=lambda each: each[1].STAGE))


def run_checks(robot: Robot, recordings: Mapping[str, Recording]) -> tuple[Finding, ...]:
    """What the checks find in these runs, by name; the gravest first."""
    subject, found = Subject(robot, recordings), list[Finding]()
    stage = 0
    for each in checks().values():
        if each.STAGE > stage and any(finding.severity is Severity.STOP for finding in found):
            break
        stage = each.STAGE
        found += each.check(subject)
    order = list(Severity)
    return tuple(sorted(found, key=lambda finding: order.index(finding.severity)))
