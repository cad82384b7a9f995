"""Names of a model's joints."""

from typing import Any


def joint_label(model: Any, joint: int) -> str:
    """A joint's name in a compiled ``mujoco.MjModel``, or the one that a nameless one is called by."""
    return model.joint(joint).name or f"joint_{joint + 1}"
