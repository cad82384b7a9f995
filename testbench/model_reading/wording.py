"""Names in sentences."""

from collections.abc import Sequence
from typing import Any

# Names that a line lists.
LISTED = 6


def listed(names: Sequence[str]) -> str:
    """The first names, and how many more there are."""
    more = len(names) - LISTED
    return ", ".join(names[:LISTED]) + (f" and {more} more" if more > 0 else "")


def joint_label(model: Any, joint: int) -> str:
    """A joint's name, or the one that a nameless one is called by."""
    return model.joint(joint).name or f"joint_{joint + 1}"
