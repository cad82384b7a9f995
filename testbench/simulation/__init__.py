"""The simulated robot: MuJoCo under a torque-level controller, with exact Coulomb friction and sensors."""

from .controller import ControllerOptions
from .reference import Reference, sample_reference
from .run import SimulationOptions, simulate
from .sensors import SensorOptions

__all__ = [
    "ControllerOptions",
    "Reference",
    "SensorOptions",
    "SimulationOptions",
    "sample_reference",
    "simulate",
]
