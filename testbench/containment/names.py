"""Names out of files that become names of files and folders."""

from collections.abc import Iterable
from typing import Annotated

from pydantic import Field

from identification.errors import InputError

LONGEST = 100
# It neither hides nor leaves its folder, on any system.
PATTERN = r"^[A-Za-z0-9_][A-Za-z0-9_.-]*$"

FolderName = Annotated[str, Field(pattern=PATTERN, max_length=LONGEST)]


def require_free(names: Iterable[str], taken: Iterable[str], source: object, field: str) -> None:
    """Raise InputError where a name is one that our own files have, or two differ by case alone."""
    used = {name.casefold() for name in taken}
    own = sorted(used)
    for name in names:
        if name.casefold() in used:
            raise InputError(source, field, f"another name than {', '.join(own)}", repr(name))
        used.add(name.casefold())
