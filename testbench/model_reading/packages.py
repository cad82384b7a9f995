"""Files that a URDF names, found as ROS finds them and beside the file."""

import os
from collections.abc import Iterator, Mapping
from pathlib import Path

from identification.errors import InputError

from ..files import is_file

# Prefixes of a file in a package, in ROS and in Gazebo.
IN_PACKAGE = ("package://", "model://")


def parse_packages(texts: tuple[str, ...]) -> dict[str, Path]:
    """Folders of packages by name, from ``name=path``. Raises InputError for another text, or no folder."""
    found = {}
    for text in texts:
        name, _, place = text.partition("=")
        if not name or not place:
            raise InputError("testbench", "--package", "name=path of a package's folder", repr(text))
        if not Path(place).is_dir():
            raise InputError("testbench", f"--package {name}", "an existing folder", place)
        found[name] = Path(place).resolve()
    return found


def found_file(name: str, urdf: Path, meshdir: str, packages: Mapping[str, Path]) -> Path | None:
    """The file that a URDF names, or None.

    ``package://NAME/rest`` is looked for in the folder given for NAME, in ROS_PACKAGE_PATH and
    AMENT_PREFIX_PATH, then beside the file and all folders above it. Other names start from the
    file's folder, or from meshdir.
    """
    for place in _places(name, urdf.resolve().parent, meshdir, packages):
        if is_file(place):
            return place
    return None


def _places(name: str, folder: Path, meshdir: str, packages: Mapping[str, Path]) -> Iterator[Path]:
    rest = name.removeprefix("file://")
    for prefix in IN_PACKAGE:
        if name.startswith(prefix):
            package, _, rest = name.removeprefix(prefix).partition("/")
            for root in _roots(package, folder, packages):
                yield root / rest
    yield folder / rest
    # MuJoCo's way: everything in one folder, whatever the path.
    yield folder / meshdir / Path(rest).name
    yield folder / meshdir / rest


def _roots(package: str, folder: Path, packages: Mapping[str, Path]) -> Iterator[Path]:
    """Folders that may be the package's, the likeliest first."""
    if package in packages:
        yield packages[package]
    for entry in filter(None, os.environ.get("ROS_PACKAGE_PATH", "").split(os.pathsep)):
        yield Path(entry) / package
        if Path(entry).name == package:
            yield Path(entry)
    for entry in filter(None, os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)):
        yield Path(entry) / "share" / package
    for parent in (folder, *folder.parents):
        if parent.name == package:
            yield parent
        yield parent / package
