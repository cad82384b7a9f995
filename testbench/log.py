"""The robot-log format, version 1: one recorded run in one HDF5 file."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Controller:
    """What drove the robot. kind: pd, pd_with_model_feedforward or unknown. rate: Hz.

    kp, kd: (n,) N·m/rad and N·m·s/rad, or None. coulomb_smoothing: rad/s, of the feedforward, or None.
    """

    kind: str
    rate: float
    kp: Array | None = None
    kd: Array | None = None
    coulomb_smoothing: float | None = None


@dataclass(frozen=True)
class Recording:
    """One run as a robot-log holds it. N samples, n joints; SI units at the joint.

    time: (N,) s. position: (N, n) rad (m). torque: (N, n) N·m (N).
    velocity, torque_command, temperature: (N, n) or None; rad/s, N·m, degC.
    reference_position, reference_velocity, reference_acceleration: (N, n) or None.
    controller: or None. truth: what only a simulation knows, never read by identification.
    source: what made the log. provenance: scenario, seed, versions; JSON-able.
    """

    robot: str
    joint_names: tuple[str, ...]
    sample_rate: float
    source: str
    time: Array
    position: Array
    torque: Array
    velocity: Array | None = None
    torque_command: Array | None = None
    temperature: Array | None = None
    reference_position: Array | None = None
    reference_velocity: Array | None = None
    reference_acceleration: Array | None = None
    controller: Controller | None = None
    truth: dict[str, Array] = field(default_factory=dict)
    provenance: dict[str, Any] = field(default_factory=dict)
