"""The terminal: names out of files are text there, never markup, and what it cannot take ends no command."""

from rich.console import Console

# Columns where output is no terminal.
WIDTH = 110


def console(stderr: bool = False) -> Console:
    """A console that shows brackets and colons as they are; styles are given by ``Text``."""
    made = Console(stderr=stderr, markup=False, emoji=False)
    if not made.is_terminal:
        made.width = WIDTH
    return made
