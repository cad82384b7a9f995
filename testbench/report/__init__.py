"""The readable page of one identification: what was found, how good it is, and the evidence."""

from .page import write_report

__all__ = ["write_report"]
