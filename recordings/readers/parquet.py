"""Parquet tables, among them those of LeRobot with ``meta/info.json`` beside."""

from pathlib import Path
from typing import Any

import numpy as np

from identification.errors import InputError
from testbench.files import read_json

from ..table import Channel, Numbers, Stream, Table, as_columns
from . import Format

FORMAT = Format("parquet", "Parquet (.parquet, LeRobot)", (".parquet",))
MAGIC = b"PAR1"
INFO = Path("meta") / "info.json"
EPISODE = "episode_index"
# A LeRobot data file lies so many folders below the data set's.
DEPTH = 3


def recognises(path: Path, head: bytes) -> bool:
    """Whether a file opens as Parquet."""
    return head.startswith(MAGIC)


def read(path: Path) -> list[Table]:
    """The runs of a file, one an episode. Raises InputError."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    info = _info(path)
    features = info.get("features", {})
    try:
        with pq.ParquetFile(path) as file:
            table = file.read([field.name for field in file.schema_arrow if _holds_numbers(pa, field.type)])
            others = [field for field in file.schema_arrow if not _holds_numbers(pa, field.type)]
    except (pa.ArrowException, OSError) as error:
        raise InputError(path, "log", "a Parquet file", str(error).splitlines()[0]) from None
    left_out = [f"{field.name}: {field.type}" for field in others]
    channels, lengths = [], table.num_rows
    for name in table.column_names:
        values = _values(pa, table[name])
        if values is None:
            left_out.append(f"{name}: lists of differing lengths")
        else:
            channels.append(Channel(name, values, _labels(features.get(name, {}), values.shape[1])))
    if lengths < 2 or not channels:
        raise InputError(
            path, "log", "rows of numbers", f"{lengths} rows, columns {', '.join(left_out) or 'none'}"
        )
    robot = str(info.get("robot_type") or "")
    return [
        Table(
            path,
            FORMAT.name,
            (Stream("", tuple(_part(channel, rows) for channel in channels)),),
            robot=robot,
            episode=episode,
            left_out=tuple(left_out),
        )
        for episode, rows in _episodes(channels)
    ]


def _part(channel: Channel, rows: slice | Numbers) -> Channel:
    return Channel(channel.name, channel.values[rows], channel.labels, channel.unit, channel.quantity)


def _episodes(channels: list[Channel]) -> list[tuple[int | None, Any]]:
    """Number and rows of each episode; all rows and no number where the file states none."""
    index = next((channel.values[:, 0] for channel in channels if channel.name == EPISODE), None)
    if index is None:
        return [(None, slice(None))]
    return [(int(episode), np.flatnonzero(index == episode)) for episode in np.unique(index)]


def _holds_numbers(pa: Any, type_: Any) -> bool:
    """Whether a column holds numbers, time stamps, or lists of numbers."""
    if pa.types.is_list(type_) or pa.types.is_large_list(type_) or pa.types.is_fixed_size_list(type_):
        return _holds_numbers(pa, type_.value_type) and not pa.types.is_nested(type_.value_type)
    kinds = (pa.types.is_integer, pa.types.is_floating, pa.types.is_boolean, pa.types.is_timestamp)
    return any(kind(type_) for kind in kinds)


def _values(pa: Any, column: Any) -> Numbers | None:
    """A column as (N, k) numbers, or None where its lists differ in length."""
    if pa.types.is_timestamp(column.type):
        return as_columns(column.cast(pa.timestamp("ns")).cast(pa.int64()).to_numpy())
    if not pa.types.is_nested(column.type):
        return as_columns(column.to_numpy())
    rows = column.combine_chunks()
    widths = np.unique(rows.value_lengths().drop_null().to_numpy(zero_copy_only=False))
    if len(widths) != 1 or not widths[0] or rows.null_count:
        return None
    return as_columns(rows.flatten().to_numpy(zero_copy_only=False).reshape(len(rows), int(widths[0])))


def _info(path: Path) -> dict[str, Any]:
    """The data set's description that lies above a file, or nothing. Raises InputError for no JSON."""
    for folder in list(path.absolute().parents)[:DEPTH]:
        if (folder / INFO).is_file():
            content = read_json(folder / INFO)
            return content if isinstance(content, dict) else {}
    return {}


def _labels(feature: Any, count: int) -> tuple[str, ...]:
    """Names of a feature's values as LeRobot's versions have them, none where they are not so many."""
    names = feature.get("names") if isinstance(feature, dict) else None
    while isinstance(names, dict) and len(names) == 1:
        names = next(iter(names.values()))
    if isinstance(names, dict):
        # Names by place, as {"x": 0, "y": 1}.
        names = list(names)
    if not isinstance(names, list) or len(names) != count or count == 1:
        return ()
    return tuple(str(name) for name in names)
