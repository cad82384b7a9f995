"""The readable diagnosis: one page, ten lines for the terminal, and a session for Rerun."""

from .page import write_report
from .session import write_session
from .summary import print_summary

__all__ = ["print_summary", "write_report", "write_session"]
