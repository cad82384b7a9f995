"""Documents of our own formats that a stranger may have made: whether they have the shape that is read."""

from pathlib import Path
from typing import Any

from pydantic import TypeAdapter, ValidationError

from identification.errors import InputError


def require_shape(path: object, shape: Any, document: Any, prefix: str = "") -> Any:
    """The document, unless it has not that shape. prefix: of the field's name. Raises InputError.

    shape: a type that pydantic validates, such as a TypedDict, of the fields that are read; others may stand
    beside them.
    """
    try:
        TypeAdapter(shape).validate_python(document, strict=True)
    except ValidationError as error:
        fault = error.errors(include_url=False)[0]
        # The parts of a union are named by their types, which nobody has written.
        field = ".".join(str(part) for part in fault["loc"])
        expected = fault["msg"].removeprefix("Input should be ").removeprefix("Value error, ")
        got = "nothing" if fault["type"] == "missing" else repr(fault["input"])[:80]
        expected = "a value" if fault["type"] == "missing" else expected
        raise InputError(path, f"{prefix}{field}" or "content", expected, got) from None
    return document


def inside(folder: Path, name: str, source: object, field: str) -> Path:
    """The file of that name below a folder. Raises InputError for a name that leads elsewhere."""
    path = folder / name
    if not name or not path.resolve().is_relative_to(folder.resolve()):
        raise InputError(source, field, f"a file below {folder}", repr(name)[:80])
    return path
