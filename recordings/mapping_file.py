"""A mapping as YAML that one corrects: short lists in one line, and the reason of every guess beside it."""

from collections.abc import Mapping as Map
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import yaml

from testbench.files import write_text

from .mapping import ChannelSection, Mapping
from .table import Table

SUFFIX = ".map.yaml"
# A folder's own mapping, for every recording in it.
OF_FOLDER = "recordings.map.yaml"
WIDTH = 110


def map_beside(path: Path) -> Path | None:
    """The mapping file that lies beside a recording: its own, or its folder's; None where there is none."""
    for beside in (own_map(path), path.parent / OF_FOLDER):
        if beside.is_file():
            return beside
    return None


def own_map(path: Path) -> Path:
    """Where the mapping of a recording, or of a log made of it, lies."""
    return path.with_name(path.stem + SUFFIX)


def write_mapping(
    mapping: Mapping, reasons: Map[str, str], left_out: Sequence[str], table: Table, path: Path
) -> None:
    """Write a guessed mapping with its reasons, whole or not at all. Raises InputError."""
    text = as_yaml(mapping, reasons, left_out, table)
    write_text(text, path)


def as_yaml(mapping: Mapping, reasons: Map[str, str], left_out: Sequence[str], table: Table) -> str:
    """A mapping's text, with what may be added to it, and why each part was guessed."""
    lines = [
        f"# How {table.path.name} is read. Guessed: correct what is wrong, and use it for all runs like it.",
        "# A value is sign x (value - zero) x unit. Numbers are for all joints, or a list of one each.",
        "# Instead of a unit: scale, what one is in SI. side: motor, with gear_ratio, if measured there.",
        "# More: torque_constant (N·m at the motor for 1 A), drive, controller; see docs/import.md.",
        *_entry("format", mapping.format),
        *_entry("format_version", mapping.format_version),
        *_entry("time", mapping.time.model_dump(exclude_none=True), reasons.get("time", "")),
        *_entry("joints", list(mapping.joints)),
        "channels:",
    ]
    for quantity, channel in mapping.channels.items():
        lines += [
            f"  {line}" for line in _entry(quantity, _changed(channel), reasons.get(quantity, ""), deep=True)
        ]
    if left_out:
        lines.append("# Left out:")
        lines += [f"#   {_one_line(each)}" for each in left_out]
    return "\n".join(lines) + "\n"


def _changed(channel: ChannelSection) -> dict[str, Any]:
    """A channel's fields that are not as by default, tuples as lists."""
    dumped = channel.model_dump(mode="json", exclude_defaults=True)
    return {name: dumped[name] for name in ChannelSection.model_fields if name in dumped}


def _entry(key: str, value: Any, reason: str = "", deep: bool = False) -> list[str]:
    """Lines of one key; of a section a line a field where it is deep."""
    comment = [f"# {_one_line(reason)}"] if reason else []
    if deep:
        return [
            *comment,
            f"{key}:",
            *(f"  {line}" for name, each in value.items() for line in _entry(name, each)),
        ]
    flow = yaml.safe_dump(value, default_flow_style=True, allow_unicode=True, width=WIDTH, sort_keys=False)
    # A value that is no collection is a document of its own, which YAML ends.
    first, *rest = flow.removesuffix("...\n").rstrip("\n").split("\n")
    return [*comment, f"{key}: {first}", *rest]


def _one_line(text: str) -> str:
    return " ".join(text.split())
