"""The robot-log format, versions 1 and 1.1: one recorded run in one HDF5 file.

A log without measured torque is of version 1.1: it says what the drive did instead.
"""

from .read import read_here, read_log
from .recording import (
    CHANNELS,
    POSITION_SERVO,
    REQUIRED,
    Controller,
    Recording,
    check_joints,
    in_model_order,
    saying,
    with_channels,
)
from .rules import LARGEST, is_measurable
from .write import write_log

__all__ = [
    "CHANNELS",
    "LARGEST",
    "POSITION_SERVO",
    "REQUIRED",
    "Controller",
    "Recording",
    "check_joints",
    "in_model_order",
    "is_measurable",
    "read_here",
    "read_log",
    "saying",
    "with_channels",
    "write_log",
]
