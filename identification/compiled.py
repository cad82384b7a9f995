"""numba, with a folder to keep compiled kernels in where neither the program's nor the user's is writable."""

import os
import stat
import sys
import tempfile
from pathlib import Path

import numba
from numba import njit

__all__ = ["njit"]


def _keep_kernels() -> None:
    """Set numba's cache to a folder for temporary files where it would find no other, and would fail."""
    if numba.config.CACHE_DIR:
        return
    home = Path(os.environ.get("XDG_CACHE_HOME") or Path(os.environ.get("HOME", "/")) / ".cache")
    if sys.platform in ("win32", "darwin") or any(map(_takes_files, (Path(__file__).parent, home))):
        return
    numba.config.CACHE_DIR = str(
        _own_folder(Path(tempfile.gettempdir()) / f"testbench-kernels-{os.getuid()}")
    )


def _takes_files(folder: Path) -> bool:
    """Whether files can be written in a folder, or where it would be made."""
    try:
        there = next(each for each in (folder, *folder.absolute().parents) if each.exists())
        tempfile.TemporaryFile(dir=there).close()
    except OSError:
        return False
    return True


def _own_folder(folder: Path) -> Path:
    """The folder, if it is this user's alone: whoever writes there has his code run; otherwise a new one."""
    try:
        folder.mkdir(mode=0o700, exist_ok=True)
        found = folder.lstat()
        if stat.S_ISDIR(found.st_mode) and found.st_uid == os.getuid() and not found.st_mode & 0o077:
            return folder
    except OSError:
        pass
    return Path(tempfile.mkdtemp(prefix="testbench-kernels-"))


# numba looks for the folder when a kernel is declared.
_keep_kernels()
