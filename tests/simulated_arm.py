"""What tests of the simulated robot share: small robots from text, a smooth motion, equal recordings."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from testbench.log import Recording
from testbench.robot import Robot, load_robot
from testbench.simulation import sample_reference

TURN_AND_LIFT = """
<mujoco model="arm"><worldbody>
  <body pos="0 0 0.3"><inertial pos="0 0.05 0.1" mass="6" diaginertia="0.1 0.1 0.08"/>
    <joint name="turn" axis="0 0 1" armature="0.3" damping="4" frictionloss="3" actuatorfrcrange="-120 120"/>
    <body pos="0.1 0 0.2"><inertial pos="0.2 0 0" mass="4" diaginertia="0.02 0.09 0.09"/>
      <joint name="lift" axis="0 1 0" armature="0.2" damping="3" frictionloss="2"
             actuatorfrcrange="-120 120"/>
      <body pos="0.4 0 0"><inertial pos="0.15 0 0.02" mass="2" diaginertia="0.01 0.03 0.03"/>
"""
ARM = f"""{TURN_AND_LIFT}
        <joint name="reach" type="slide" axis="1 0 0" armature="1" damping="20" frictionloss="9"
               actuatorfrcrange="-200 200"/>
      </body></body></body></worldbody>
  <actuator><position joint="lift" kp="1000"/></actuator></mujoco>
"""
RATE = 1000.0


@dataclass(frozen=True)
class Sines:
    """q = amplitude (1 - cos(2 pi k t / T)): at rest at both ends."""

    amplitude: tuple[float, ...]
    cycles: tuple[int, ...]
    duration: float = 2.0

    @property
    def joints(self) -> int:
        return len(self.amplitude)

    def evaluate(self, time: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        a, w = np.array(self.amplitude), 2 * np.pi * np.array(self.cycles) / self.duration
        angle = np.outer(time, w)
        return a * (1 - np.cos(angle)), a * w * np.sin(angle), a * w**2 * np.cos(angle)


ARM_MOTION = sample_reference(Sines((0.5, 0.3, 0.1), (1, 2, 3)), RATE)


def robot_from(xml: str, folder: Path) -> Robot:
    path = folder / "robot.xml"
    path.write_text(xml)
    return load_robot(path)


def arrays(recording: Recording) -> dict[str, np.ndarray]:
    found = {name: value for name, value in vars(recording).items() if isinstance(value, np.ndarray)}
    return found | {f"truth {name}": value for name, value in recording.truth.items()}


def same(one: Recording, other: Recording) -> bool:
    a, b = arrays(one), arrays(other)
    return a.keys() == b.keys() and all(np.array_equal(a[name], b[name]) for name in a)
