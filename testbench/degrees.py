"""Positions in degrees, where the model's ranges leave no doubt of it."""

from dataclasses import replace
from typing import Any

import numpy as np

from .log import Recording, saying
from .robot import Robot

# Share of samples that may be anything: spoiled ones are mended later.
SPOILED = 0.01
# Of a range's width: a zero may lie elsewhere by so much.
BEYOND = 0.5
# Velocities are in degrees too where they are so many times, or by, the steps of the positions as logged.
ALIKE = 1.5


def in_radians(recording: Recording, robot: Robot) -> Recording:
    """The recording with its hinges in radians, where only degrees fit the model's ranges; else as it is.

    They do where some hinge is logged farther out of its range than the range is wide, and none would be so
    in degrees.
    """
    hinges = ~np.asarray(robot.chain.is_slide, bool)
    lower, upper = robot.limits.lower, robot.limits.upper
    ranged = hinges & np.isfinite(upper - lower)
    width = upper - lower

    def beyond(position: np.ndarray) -> np.ndarray:
        farthest = np.full(len(width), -np.inf)
        out = np.maximum(lower - position, position - upper)[:, ranged]
        farthest[ranged] = np.quantile(out, 1 - SPOILED, axis=0)
        return farthest

    is_out = beyond(recording.position) > width
    factor = np.where(hinges, np.pi / 180, 1.0)
    if not is_out.any() or np.any(beyond(recording.position * factor) > BEYOND * width):
        return recording
    changed: dict[str, Any] = {"position": recording.position * factor}
    if recording.reference_position is not None:
        changed["reference_position"] = recording.reference_position * factor
    steps = np.abs(np.gradient(recording.position, recording.time, axis=0)).mean()
    for field in ("velocity", "reference_velocity"):
        values = getattr(recording, field)
        if values is not None and 1 / ALIKE < np.abs(values).mean() / max(steps, 1e-300) < ALIKE:
            changed[field] = values * factor
            if field == "reference_velocity" and recording.reference_acceleration is not None:
                changed["reference_acceleration"] = recording.reference_acceleration * factor
    named = robot.joint_names[int(np.argmax(is_out))]
    largest = float(np.abs(recording.position[:, int(np.argmax(is_out))]).max())
    sentence = f"positions are in degrees ({named} reaches {largest:.4g}): read as radians"
    return replace(saying(recording, sentence), **changed)
