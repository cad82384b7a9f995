"""What the figures were measured on."""

import os
import platform
from importlib.metadata import version

PACKAGES = ("mujoco", "pin", "numba", "numpy", "scipy")


def machine() -> dict[str, str]:
    """Cores, the load that others put on them just now, and the versions that decide speed."""
    load = os.getloadavg()[0]
    host = {"cores": str(os.cpu_count()), "load": f"{load:.1f}", "python": platform.python_version()}
    return host | {name: version(name) for name in PACKAGES}
