"""The models and scenarios of the wheel, found where the user's folder has none of that name."""

import shutil
import tempfile
from pathlib import Path

from identification.errors import InputError

from .files import is_file

# In a checkout the folders in it are links to those at the top.
DATA = Path(__file__).parent / "data"
FOLDERS = ("models", "scenarios")


def shipped(path: str | Path) -> Path:
    """The path as it is; of one that is not there but begins with ``models/`` or ``scenarios/``, ours."""
    path = Path(path)
    ours = DATA / path
    is_ours = not path.is_absolute() and ".." not in path.parts and is_file(ours)
    return ours if is_ours and not path.exists() else path


def copy_shipped(out: Path) -> None:
    """Copy both folders into ``out`` and say so. Raises InputError where it has one of them."""
    for name in FOLDERS:
        if (out / name).exists():
            raise InputError(out, "out", f"a folder without {' and '.join(FOLDERS)}", f"one with {name}")
    out.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=".shipped", dir=out) as folder:
        for name in FOLDERS:
            shutil.copytree(DATA / name, Path(folder) / name)
        for name in FOLDERS:
            (Path(folder) / name).rename(out / name)
    for name in FOLDERS:
        print(f"{out / name}: {', '.join(sorted(each.name for each in (out / name).iterdir()))}")
