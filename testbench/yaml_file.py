"""YAML files as plain fields, each said once."""

from collections.abc import Hashable
from pathlib import Path
from typing import Any

import yaml

from identification.errors import InputError

from .files import require_file


class _Loader(yaml.SafeLoader):
    """YAML itself would take the last of two equal keys, and say nothing."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Hashable, Any]:
        seen = set()
        for key, _ in node.value:
            # A key that is a list, or a mapping, is refused as one that cannot be hashed.
            if not isinstance(key, yaml.ScalarNode):
                continue
            if key.value in seen:
                got = f"it again in line {key.start_mark.line + 1}"
                raise InputError("YAML", key.value, "every key once", got)
            seen.add(key.value)
        return super().construct_mapping(node, deep)


def read_fields(path: Path, what: str = "scenario") -> dict[str, Any]:
    """The fields of a YAML file, none of which is true or false. what: the file is, for complaints.

    Raises InputError for anything but a mapping, for a key that is said twice, and for true and false: they
    would count as 1 and 0.
    """
    require_file(path, what, "an existing YAML file")
    try:
        content = yaml.load(path.read_text(encoding="utf-8"), _Loader)
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise InputError(path, what, "YAML", " ".join(str(error).split())) from None
    except InputError as error:
        raise error.located(path) from None
    if not isinstance(content, dict):
        raise InputError(path, what, "a mapping of fields", type(content).__name__)
    _refuse_booleans(path, "", content)
    return content


def _refuse_booleans(path: Path, field: str, value: Any) -> None:
    if isinstance(value, bool):
        raise InputError(path, field, "a number or a text", str(value).lower())
    if isinstance(value, dict | list):
        for key, part in value.items() if isinstance(value, dict) else enumerate(value):
            _refuse_booleans(path, f"{field}.{key}" if field else str(key), part)
