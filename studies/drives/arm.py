"""A small arm of three servos, with a leg of two drives the robots of the study of names."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .leg import KD, KP, LEG

Array = NDArray[np.float64]

ARM = """<mujoco model="arm">
  <compiler angle="radian"/>
  <default><joint damping=".03" frictionloss=".06" armature=".006" actuatorfrcrange="-4 4"/></default>
  <worldbody>
    <body name="base" pos="0 0 .1">
      <inertial pos="0 0 .03" mass=".15" diaginertia="1e-4 1e-4 1e-4"/>
      <joint name="pan" axis="0 0 1" range="-2 2"/>
      <body name="upper" pos="0 0 .06">
        <inertial pos=".07 0 .005" mass=".16" diaginertia="6e-5 4e-4 4e-4"/>
        <joint name="lift" axis="0 1 0" range="-2 2"/>
        <body name="fore" pos=".14 0 0">
          <inertial pos=".08 .004 0" mass=".2" diaginertia="8e-5 6e-4 6e-4"/>
          <joint name="elbow" axis="0 1 0" range="-2 2"/>
        </body>
      </body>
    </body>
  </worldbody>
</mujoco>
"""


@dataclass(frozen=True)
class Kind:
    """A robot of the study: its model, its servos' gains (n,), the middle of its motion, its encoders' side.

    encoder_after: 1 where encoders see the link, 0 where they see the motor.
    """

    name: str
    xml: str
    kp: Array
    kd: Array
    centre: Array
    encoder_after: float

    def written(self, folder: Path) -> Path:
        """The model in a folder."""
        path = folder / f"{self.name}.xml"
        path.write_text(self.xml)
        return path


KINDS = (
    Kind(
        "leg",
        LEG.replace('damping=".1"', 'damping=".1" frictionloss=".15"'),
        KP,
        KD,
        np.array([0.1, -0.4]),
        0.0,
    ),
    Kind("arm", ARM, np.full(3, 8.0), np.full(3, 0.4), np.array([0.0, -0.5, 0.6]), 1.0),
)
