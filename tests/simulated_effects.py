"""What tests of effects in the simulated robot share: the robots, and a run with effects."""

from testbench.effects import effects, injection
from testbench.effects.base import Injection, Scope
from testbench.log import Recording
from testbench.robot import Robot
from testbench.simulation import Reference, SimulationOptions, sample_reference, simulate

from .simulated_arm import TURN_AND_LIFT, Sines

ARM = f"""{TURN_AND_LIFT}
        <joint name="bend" axis="0 1 0" armature="0.1" damping="1" frictionloss="1"
             actuatorfrcrange="-60 60"/>
      </body></body></body></worldbody>
  <custom><numeric name="velocity_limit" data="4 4 4"/></custom></mujoco>
"""
WHEEL = """
<mujoco model="wheel"><worldbody><body><inertial pos="0 0 0" mass="1" diaginertia="1 1 0.4"/>
  <joint name="hinge" axis="0 0 1" armature="0.2" damping="1.5" frictionloss="2" actuatorfrcrange="-60 60"/>
</body></worldbody><custom><numeric name="velocity_limit" data="8"/></custom></mujoco>
"""
RATE = 1000.0
MOTION = sample_reference(Sines((0.5, 0.3, 0.4), (1, 2, 3)), RATE)


def placed(robot: Robot, name: str, law: str | None = None, **values: float) -> Injection:
    """The effect on the second joint (and the third), or on the only one."""
    scope = effects()[name].DESCRIPTION.scope
    joint = None if scope is Scope.ROBOT else min(2, robot.joints)
    return injection(robot, name, joint, values, law, 3 if scope is Scope.PAIR else None)


def run(robot: Robot, *injections: Injection, step: float = 2e-4, motion: Reference = MOTION) -> Recording:
    return simulate(robot, [motion], SimulationOptions(physics_timestep=step, effects=injections), threads=1)[
        0
    ]
