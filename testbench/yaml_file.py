"""YAML files as plain fields, each said once."""

from pathlib import Path
from typing import Any

from identification.errors import InputError

from .containment.yaml_text import read_bounded_yaml
from .files import require_file


def read_fields(path: Path, what: str = "scenario", flags: tuple[str, ...] = ()) -> dict[str, Any]:
    """The fields of a YAML file, of which ``flags`` alone may be true or false.

    what: the file is, for complaints.

    Raises InputError for anything but a mapping, for a key that is said twice, and for true and false: they
    would count as 1 and 0.
    """
    require_file(path, what, "an existing YAML file")
    content = read_bounded_yaml(path, what)
    if not isinstance(content, dict):
        raise InputError(path, what, "a mapping of fields", type(content).__name__)
    _refuse_booleans(path, "", {key: value for key, value in content.items() if key not in flags})
    return content


def _refuse_booleans(path: Path, field: str, value: Any) -> None:
    if isinstance(value, bool):
        raise InputError(path, field, "a number or a text", str(value).lower())
    if isinstance(value, dict | list):
        for key, part in value.items() if isinstance(value, dict) else enumerate(value):
            _refuse_booleans(path, f"{field}.{key}" if field else str(key), part)
