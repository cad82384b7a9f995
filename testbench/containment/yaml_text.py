"""YAML of strangers: bounded, every key once, every number finite, dates as the text that they are."""

import math
from collections.abc import Hashable
from pathlib import Path
from typing import Any

import yaml

from identification.errors import InputError

# Bytes of a file; levels of nesting; values, each alias counted where it stands; digits of a number.
LONGEST, DEEPEST, MOST_VALUES, MOST_DIGITS = 1 << 18, 30, 20_000, 30


class _Loader(yaml.SafeLoader):
    """YAML itself would take the last of two equal keys, and say nothing."""

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
        self._depth = getattr(self, "_depth", 0) + 1
        if self._depth > DEEPEST:
            raise ValueError(f"over {DEEPEST} levels of nesting")
        node = super().compose_node(parent, index)
        self._depth -= 1
        return node

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


# Dates stay the text that was written: no field here is one, and not every one exists.
_Loader.yaml_implicit_resolvers = {
    first: [(tag, pattern) for tag, pattern in resolvers if tag != "tag:yaml.org,2002:timestamp"]
    for first, resolvers in yaml.SafeLoader.yaml_implicit_resolvers.items()
}


def read_bounded_yaml(path: Path, field: str) -> Any:
    """What a YAML file holds. Raises InputError for anything else."""
    size = path.stat().st_size
    if size > LONGEST:
        raise InputError(path, field, f"at most {LONGEST >> 10} KiB of YAML", f"{size} bytes")
    loader = None
    try:
        loader = _Loader(path.read_text(encoding="utf-8"))
        node = loader.get_single_node()
        if node is None:
            return None
        _require_few(node, {})
        value = loader.construct_document(node)
        _require_plain(value)
    except InputError as error:
        raise error.located(path) from None
    # Besides its own errors PyYAML raises those of int, float, bytes and of dates.
    except (
        yaml.YAMLError,
        ValueError,
        TypeError,
        AttributeError,
        KeyError,
        IndexError,
        RecursionError,
    ) as error:
        raise InputError(path, field, "YAML", " ".join(str(error).split()) or type(error).__name__) from None
    finally:
        if loader is not None:
            loader.dispose()
    return value


def _require_few(node: yaml.Node, sizes: dict[int, int]) -> int:
    """How many values a node holds, every alias counted where it stands. Raises ValueError beyond the limit.

    sizes: by node, of those that are known; 0 of those that are being counted, which cannot hold themselves.
    """
    known = sizes.get(id(node))
    if known is not None:
        if known == 0:
            raise ValueError("a value that holds itself")
        return known
    sizes[id(node)] = 0
    parts: list[yaml.Node] = []
    if isinstance(node, yaml.MappingNode):
        parts = [part for pair in node.value for part in pair]
    elif isinstance(node, yaml.SequenceNode):
        parts = node.value
    total = 1
    for part in parts:
        total += _require_few(part, sizes)
        if total > MOST_VALUES:
            raise ValueError(f"over {MOST_VALUES} values")
    sizes[id(node)] = total
    return total


def _require_plain(value: Any, field: str = "") -> None:
    """Raise InputError unless every value is text, a finite number of few digits, or null, and a key text."""
    if isinstance(value, float) and not math.isfinite(value):
        raise InputError("YAML", field, "a finite number", value)
    if isinstance(value, int) and abs(value) >= 10**MOST_DIGITS:
        raise InputError("YAML", field, f"at most {MOST_DIGITS} digits", "more")
    if (
        isinstance(value, str)
        and not value.isprintable()
        and any(ord(c) < 32 and c not in "\n\t" for c in value)
    ):
        raise InputError("YAML", field, "printable characters", repr(value)[:80])
    if value is not None and not isinstance(value, bool | int | float | str | list | dict):
        raise InputError("YAML", field, "a number or a text", type(value).__name__)
    if isinstance(value, dict | list):
        for key, part in value.items() if isinstance(value, dict) else enumerate(value):
            if isinstance(value, dict):
                _require_plain(key, f"{field} key")
            _require_plain(part, f"{field}.{key}" if field else str(key))
