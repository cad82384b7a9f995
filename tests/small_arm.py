"""A two-joint arm with limits that is designed for, simulated and identified in a second."""

from pathlib import Path

from testbench.robot import Robot, load_robot

_LOWER = """      <body name="lower" pos=".3 0 0">
        <inertial pos=".1 .01 0" mass="2" fullinertia=".004 .012 .014 .0003 .0002 .0001"/>
        <joint name="elbow" axis="0 0 1" range="-2 2" armature=".05" damping="1" frictionloss="1"
               actuatorfrcrange="-30 30"/>
      </body>
"""


def _arm(name: str, velocity: str, acceleration: str, lower: str) -> str:
    return f"""
<mujoco model="{name}">
  <compiler angle="radian"/>
  <custom>
    <numeric name="velocity_limit" data="{velocity}"/>
    <numeric name="acceleration_limit" data="{acceleration}"/>
  </custom>
  <worldbody>
    <body name="upper" pos="0 0 .5">
      <inertial pos=".15 0 .02" mass="4" fullinertia=".02 .06 .07 .002 .001 -.001"/>
      <joint name="shoulder" axis="0 1 0" range="-2 2" armature=".1" damping="3" frictionloss="2"
             actuatorfrcrange="-80 80"/>
{lower}    </body>
  </worldbody>
</mujoco>
"""


ARM = _arm("small_arm", "4 4", "30 40", _LOWER)
# A test bench: its first joint alone.
PENDULUM = _arm("pendulum", "4", "30", "")

# Axes that are all upright: no joint feels how high anything is.
SCARA = """
<mujoco model="scara">
  <compiler angle="radian"/>
  <custom>
    <numeric name="velocity_limit" data="5 6 1"/>
    <numeric name="acceleration_limit" data="30 40 10"/>
  </custom>
  <worldbody>
    <body name="inner" pos="0 0 .3">
      <inertial pos=".16 0 .05" mass="9" diaginertia=".03 .15 .16"/>
      <joint name="turn" axis="0 0 1" range="-2 2" armature=".6" damping="2" frictionloss="5"
             actuatorfrcrange="-160 160"/>
      <body name="outer" pos=".32 0 0">
        <inertial pos=".1 0 .05" mass="5" diaginertia=".03 .1 .1"/>
        <joint name="fold" axis="0 0 1" range="-2.4 2.4" armature=".3" damping="1" frictionloss="2"
               actuatorfrcrange="-70 70"/>
        <body name="quill" pos=".27 0 0">
          <inertial pos="0 .005 -.05" mass="1.5" diaginertia=".015 .015 .001"/>
          <joint name="lift" type="slide" axis="0 0 1" range="-.2 0" armature="3" damping="28"
                 frictionloss="8" actuatorfrcrange="-300 300"/>
        </body>
      </body>
    </body>
  </worldbody>
</mujoco>
"""

SCENARIO = """
name: small
model: arm.xml
seed: 3
excitation: {harmonics: 4, base_frequency: 0.25 Hz, starts: 1}
simulation: {periods: 1}
validation: {runs: 1, harmonics: 4, base_frequency: 0.25 Hz}
"""


def small_arm(folder: Path, xml: str = ARM) -> Robot:
    """The arm, from a file in this folder."""
    path = folder / "arm.xml"
    path.write_text(xml)
    return load_robot(path)
