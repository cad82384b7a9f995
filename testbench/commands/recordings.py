"""From recordings in any format to robot-logs."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from identification.errors import InputError

from .options import AS_LOGGED, Chosen, Map


def import_recordings(
    files: Annotated[
        list[Path],
        Parameter(help="CSV, Parquet, npz, JSON, ROS bags, robot-logs", consume_multiple=True, negative=()),
    ],
    /,
    *,
    out: Annotated[Path, Parameter(help="robot-log HDF5 to write; a folder for several runs")],
    model: Annotated[
        Path | None, Parameter(help="MJCF or URDF whose joints, ranges and limits the guess goes by")
    ] = None,
    map: Map = None,
    chosen: Chosen = AS_LOGGED,
) -> None:
    """Convert recordings to robot-logs; without a map, guess one, show it and write it beside."""
    from recordings.importing import import_files

    if model is None and chosen != AS_LOGGED:
        raise InputError("testbench", "--model", "the model that --joints are of", "none")
    import_files(files, model, map, out, chosen.choice())
