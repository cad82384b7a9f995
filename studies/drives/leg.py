"""A leg of two joints on a stand, whose position servos log commanded and measured position alone."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from identification.output_error.plant import plant_table
from identification.output_error.servo_loop import Window, simulate
from identification.parameters import ARMATURE, COULOMB, VISCOUS
from testbench.log import Controller, Recording
from testbench.robot import load_robot

Array = NDArray[np.float64]

LEG = """<mujoco model="leg">
  <compiler angle="radian"/>
  <worldbody>
    <body name="thigh" pos="0 0 1">
      <inertial pos=".01 0 -.09" mass="1.1" diaginertia=".006 .006 .001"/>
      <joint name="hip" axis="0 1 0" range="-1.5 1.5" armature=".01" damping=".1"
             actuatorfrcrange="-25 25"/>
      <body name="shank" pos="0 0 -.2">
        <inertial pos="0 0 -.1" mass=".35" diaginertia=".0025 .0025 .0002"/>
        <joint name="knee" axis="0 1 0" range="-2.5 2.5" armature=".01" damping=".1"
               actuatorfrcrange="-25 25"/>
      </body>
    </body>
  </worldbody>
</mujoco>
"""
KP, KD = np.array([20.0, 20.0]), np.array([1.0, 1.0])
# What the model does not say.
TRUTH = {"armature": (0.03, 0.02), "viscous": (0.2, 0.15), "coulomb": (0.3, 0.2), "delay": (0.012, 0.017)}
COUNT = 2 * np.pi / 2**12


def written(folder: Path) -> Path:
    """The leg's model in a folder."""
    path = folder / "leg.xml"
    path.write_text(LEG)
    return path


def command(rate: float, duration: float, seed: int) -> Array:
    """Sums of sines of .2 to 4 Hz, (N, 2) rad."""
    rng = np.random.default_rng(seed)
    time = np.arange(round(duration * rate)) / rate
    waves = np.zeros((len(time), 2))
    for frequency in (0.2, 0.45, 0.9, 1.7, 2.6, 4.0):
        phase = rng.uniform(0, 2 * np.pi, 2)
        waves += 0.35 / (1 + frequency) * np.sin(2 * np.pi * frequency * time[:, None] + phase)
    return waves + np.array([0.1, -0.4])


def table(model: Path) -> Array:
    """The plant as it truly is."""
    robot = load_robot(model)
    parameters = robot.parameters.copy().reshape(2, -1)
    for name, column in (("armature", ARMATURE), ("viscous", VISCOUS), ("coulomb", COULOMB)):
        parameters[:, column] = TRUTH[name]
    return plant_table(parameters.ravel(), np.array(TRUTH["delay"]), robot.limits.torque)


def recorded(
    model: Path, rate: float = 100.0, duration: float = 10.0, seed: int = 0, plant: Array | None = None
) -> Recording:
    """A run of the true leg, or of another plant, as it logs: 12-bit positions, no torque."""
    robot, follow = load_robot(model), command(rate, duration, seed)
    window = Window(follow, KP, KD, 0, len(follow), follow[0], np.zeros(2))
    own = table(model) if plant is None else plant
    # Steps far finer than those of the fit.
    ((run,),) = simulate(robot.chain, own[None], [window], rate, step=2e-4)
    return Recording(
        robot="leg",
        joint_names=("hip", "knee"),
        sample_rate=rate,
        source="simulation",
        time=np.arange(len(follow)) / rate,
        position=np.round(run.position / COUNT) * COUNT,
        torque=np.full_like(follow, np.nan),
        reference_position=follow,
        controller=Controller("position_servo", rate, KP, KD),
    )
