"""The arm of these tests."""

# Two hinges and a slide, small enough that a run takes a moment.
ARM = """
<mujoco model="small_arm">
  <compiler angle="radian"/>
  <custom>
    <numeric name="velocity_limit" data="3 3 1"/>
    <numeric name="acceleration_limit" data="15 15 6"/>
  </custom>
  <worldbody>
    <body name="turret" pos="0 0 .2">
      <inertial pos=".02 0 .1" mass="6" diaginertia=".05 .05 .04"/>
      <joint name="turn" axis="0 0 1" range="-3 3" armature=".1" damping="4" frictionloss="3"/>
      <geom name="shell" type="box" size=".08 .1 .15" rgba=".9 .6 .1 1" contype="0" conaffinity="0"/>
      <body name="arm" pos="0 0 .3" quat=".7071068 .7071068 0 0">
        <inertial pos=".2 0 .02" mass="4" diaginertia=".02 .06 .06"/>
        <joint name="lift" axis="0 0 1" range="-2 2" armature=".08" damping="3" frictionloss="4"/>
        <body name="ram" pos=".4 0 0" quat=".7071068 0 .7071068 0">
          <inertial pos="0 .01 .1" mass="2" diaginertia=".01 .01 .002"/>
          <joint name="reach" type="slide" axis="0 0 1" range="0 .4"
                 armature="2" damping="20" frictionloss="6"/>
        </body>
      </body>
    </body>
  </worldbody>
  <actuator>
    <motor name="drive_turn" joint="turn" ctrlrange="-80 80"/>
    <motor name="drive_lift" joint="lift" ctrlrange="-80 80"/>
    <motor name="drive_reach" joint="reach" ctrlrange="-150 150"/>
  </actuator>
</mujoco>
"""
LIFT = 1
