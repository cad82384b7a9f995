"""The simulated robot: MuJoCo under a torque-level controller, with exact Coulomb friction and sensors."""

from .controller import ControllerOptions
from .reference import Reference, sample_reference
from .run import SimulationOptions, controller_gains, simulate
from .sensors import SensorOptions
from .tracking import tracking

__all__ = [
    "ControllerOptions",
    "Reference",
    "SensorOptions",
    "SimulationOptions",
    "controller_gains",
    "sample_reference",
    "simulate",
    "tracking",
]
