"""JSON of strangers: bounded, every key once, every number finite."""

import json
import math
from pathlib import Path
from typing import Any

from identification.errors import InputError

# Bytes of a file, brackets within brackets, digits of a whole number.
LONGEST, DEEPEST, MOST_DIGITS = 1 << 26, 60, 40


def read_bounded_json(path: Path, field: str = "content") -> Any:
    """What a JSON file holds. Raises InputError for anything else."""
    size = path.stat().st_size
    if size > LONGEST:
        raise InputError(path, field, f"at most {LONGEST >> 20} MiB", f"{size} bytes")
    try:
        text = path.read_text(encoding="utf-8")
        value = json.loads(
            text,
            object_pairs_hook=_once,
            parse_constant=_no_number,
            parse_int=_whole,
            parse_float=_finite,
        )
        if not _is_shallow(value, DEEPEST):
            raise RecursionError
        # Halves of a pair of surrogates are no text, and cannot be written as any.
        json.dumps(value, ensure_ascii=False).encode("utf-8")
    except RecursionError:
        raise InputError(path, field, f"at most {DEEPEST} nested lists and objects", "more") from None
    except (ValueError, OSError) as error:
        raise InputError(path, field, "JSON", str(error)) from None
    return value


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    made = dict(pairs)
    if len(made) < len(pairs):
        keys = [key for key, _ in pairs]
        twice = next(key for key in keys if keys.count(key) > 1)
        raise ValueError(f"the key {twice!r} twice")
    return made


def _no_number(name: str) -> float:
    raise ValueError(f"{name}, which is no number of JSON")


def _whole(digits: str) -> int:
    if len(digits) > MOST_DIGITS:
        raise ValueError(f"a whole number of {len(digits)} digits")
    return int(digits)


def _finite(digits: str) -> float:
    value = float(digits)
    if not math.isfinite(value):
        raise ValueError(f"the number {digits[:MOST_DIGITS]}, which is beyond double precision")
    return value


def _is_shallow(value: Any, levels: int) -> bool:
    """Whether lists and objects are nested at most so deep."""
    if not isinstance(value, list | dict):
        return True
    parts = value.values() if isinstance(value, dict) else value
    return levels > 0 and all(_is_shallow(part, levels - 1) for part in parts)
