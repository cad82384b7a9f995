"""How a run is simulated."""

from dataclasses import dataclass, field

import numpy as np

from identification.errors import InputError

from ..effects.base import Injection
from .controller import ControllerOptions
from .sensors import SensorOptions

# s; below it the steps of a minute take an hour.
SHORTEST_STEP = 1e-6


@dataclass(frozen=True)
class SimulationOptions:
    """How a run is simulated. Raises InputError unless the physics step divides the control period.

    physics_timestep: s. effects: what the robot has that its model does not say. loops_a_sample: periods of
    the controller that the log has one sample of.
    """

    controller: ControllerOptions = field(default_factory=ControllerOptions)
    sensors: SensorOptions = field(default_factory=SensorOptions)
    physics_timestep: float = 1e-4
    effects: tuple[Injection, ...] = ()
    loops_a_sample: int = 1

    def __post_init__(self) -> None:
        step, period = self.physics_timestep, 1 / self.controller.rate
        if not (np.isfinite(step) and step > 0) or abs(self.substeps * step - period) > 1e-6 * period:
            expected = f"a positive step that divides the control period of {period:g} s"
            raise InputError("simulation", "physics_timestep", expected, step)
        if step < SHORTEST_STEP:
            raise InputError("simulation", "physics_timestep", f"at least {SHORTEST_STEP:g} s", step)

    @property
    def logged_rate(self) -> float:
        """Samples a second of the log, Hz."""
        return self.controller.rate / self.loops_a_sample

    @property
    def substeps(self) -> int:
        """Physics steps a control period."""
        return max(round(1 / (self.controller.rate * self.physics_timestep)), 1)
