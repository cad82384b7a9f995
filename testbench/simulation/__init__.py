"""The simulated robot: MuJoCo under a torque-level controller, with exact Coulomb friction and sensors."""

from .controller import ControllerOptions
from .options import SimulationOptions
from .reference import Reference, sample_reference
from .run import simulate
from .sensors import SensorOptions
from .steady import controller_gains, held_up
from .tracking import tracking

__all__ = [
    "ControllerOptions",
    "Reference",
    "SensorOptions",
    "SimulationOptions",
    "controller_gains",
    "held_up",
    "sample_reference",
    "simulate",
    "tracking",
]
