"""A finding: something that a log has and that its reader should know before anything is fitted."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

from identification.errors import InputError


class Severity(StrEnum):
    """Severity of a finding: it makes every answer meaningless, or some of them doubtful, or neither."""

    STOP = "stop"
    WARN = "warn"
    NOTE = "note"


@dataclass(frozen=True)
class Finding:
    """One finding of a check.

    code: for machines, such as torque_sign. sentence: plain, with its figures and what to do. joints: names
    of those that it concerns; empty for the whole log. run: the run that has it; empty for all of them.
    field: the channel, as robot-log spells it. expected: what it should be, of findings that stop.
    bars_names: beside it no effect is named. bars_joints: none that acts on its joints is.
    """

    severity: Severity
    code: str
    sentence: str
    joints: tuple[str, ...] = ()
    run: str = ""
    field: str = "log"
    expected: str = ""
    bars_names: bool = False
    bars_joints: bool = False

    def error(self, source: str | Path) -> InputError:
        """The refusal of a log, ``source``, that has this."""
        return InputError(source, self.field, self.expected, self.sentence)


def barring(findings: Sequence[Finding]) -> Finding | None:
    """The first finding beside which no effect is named; None where there is none."""
    return next((each for each in findings if each.bars_names), None)


def barred_joints(findings: Sequence[Finding]) -> frozenset[str]:
    """The names of the joints at which no effect is named."""
    return frozenset(name for each in findings if each.bars_joints for name in each.joints)
