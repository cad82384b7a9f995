"""Sentences that the command line prints, as records of Python's logging."""

import logging
from collections.abc import Iterable

LOGGER = logging.getLogger("testbench")


def note(sentences: Iterable[str]) -> None:
    """Log each sentence as a warning, which Python shows on stderr unless configured otherwise."""
    for sentence in sentences:
        LOGGER.warning(sentence)
