"""A robot with position servos in MuJoCo, as the rivals that simulate with it have it."""

import mujoco
import numpy as np
from numpy.typing import NDArray

from identification.output_error.servo_run import ServoRun
from testbench.drives.stated import Servo
from testbench.robot import Robot

Array = NDArray[np.float64]

STATE = mujoco.mjtState.mjSTATE_FULLPHYSICS


def servo_spec(robot: Robot, servo: Servo, kp: Array, kd: Array, step: float) -> mujoco.MjSpec:
    """The robot with one position servo and one position sensor a joint; no contacts.

    kp, kd: (n,) N·m/rad and N·m·s/rad of a run. step: s.
    """
    spec = robot.spec()
    for element in (*spec.actuators, *spec.sensors, *spec.keys, *spec.geoms, *spec.meshes):
        spec.delete(element)
    spec.option.timestep = step
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT | mujoco.mjtDisableBit.mjDSBL_LIMIT
    for joint, name in enumerate(robot.joint_names):
        actuator = spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        actuator.set_to_position(kp=kp[joint], kv=kd[joint])
        actuator.ctrllimited = False
        # As stated, for those who scale them.
        actuator.userdata = [kp[joint], kd[joint]]
        if np.isfinite(servo.limit[joint]):
            actuator.forcelimited, actuator.forcerange = True, [-servo.limit[joint], servo.limit[joint]]
        spec.add_sensor(
            name=f"{name}_position",
            type=mujoco.mjtSensor.mjSENS_JOINTPOS,
            objtype=mujoco.mjtObj.mjOBJ_JOINT,
            objname=name,
        )
    return spec


def initial_state(model: mujoco.MjModel, position: Array, velocity: Array) -> Array:
    """The state that a rollout starts from, of joints (n,) in the model's order."""
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = position, velocity
    state = np.empty(mujoco.mj_stateSize(model, STATE))
    mujoco.mj_getState(model, data, state, STATE)
    return state


def held_command(run: ServoRun, substeps: int, delay: float = 0.0) -> Array:
    """The command (substeps (N - 1), n) of each step of a simulation, held from sample to sample."""
    time = np.arange(substeps * (len(run.command) - 1)) / (substeps * run.rate) - delay
    return run.command[np.clip(np.floor(time * run.rate + 1e-6).astype(int), 0, None)]


def start_of(run: ServoRun) -> tuple[Array, Array]:
    """Position and velocity (n,) at which a run is simulated from."""
    position, velocity = run.smoothed
    return position[0], velocity[0]
