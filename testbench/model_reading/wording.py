"""Lists of names in sentences."""

from collections.abc import Sequence

# Names that a line lists.
LISTED = 6


def listed(names: Sequence[str]) -> str:
    """The first names, and how many more there are."""
    more = len(names) - LISTED
    return ", ".join(names[:LISTED]) + (f" and {more} more" if more > 0 else "")
