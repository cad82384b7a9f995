"""Open a recorded session in the Rerun viewer."""

import os
import subprocess
import sys
from pathlib import Path

from identification.errors import InputError

SESSION = "session.rrd"


def view(directory: str | Path) -> int:
    """Show DIR/session.rrd until the viewer is closed; the viewer's exit status.

    Raises InputError when the directory holds no session or there is no display to show it on.
    """
    session = Path(directory) / SESSION
    if not session.is_file():
        raise InputError(
            directory, SESSION, "a directory that a run has written a session to", "no such file"
        )
    if sys.platform.startswith("linux") and not (
        os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    ):
        raise InputError(
            "view", "DISPLAY", f"a graphical display (or open {session} in Rerun on another machine)", "none"
        )
    # The viewer also listens for recordings; nobody outside this machine should send it any.
    return subprocess.call([sys.executable, "-m", "rerun_cli", "--bind", "127.0.0.1", str(session)])
