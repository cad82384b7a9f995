"""Torque error of a corrected MJCF along the logs, by MuJoCo's own inverse dynamics of that file."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from testbench.robot import Robot
from testbench.torque_lag import TorqueLag

from ..data.run import Run
from ..decision.findings import Diagnosis
from .corrected_model import Corrected, corrected_model
from .prediction import as_predicted, torque_along

Array = NDArray[np.float64]

# s, the longest step by which the states of MuJoCo's friction are followed: its bristles are stiff.
STATE_STEP = 2e-4
UNFELT = mujoco.mjtDisableBit.mjDSBL_CONTACT | mujoco.mjtDisableBit.mjDSBL_LIMIT


@dataclass(frozen=True)
class FileError:
    """RMS torque error a joint along all runs, (n,) N·m (N): of the samples that count, in each joint's band.

    given: of the model as given. laws: of what the diagnosis found, as far as it is kept. file: of the MJCF.
    """

    given: Array
    laws: Array
    file: Array


def file_error(diagnosis: Diagnosis, path: Path) -> FileError:
    """The error of the MJCF at ``path`` along the runs of a diagnosis, beside that of its laws."""
    model, prepared = corrected_model(diagnosis), diagnosis.prepared
    mjcf = mujoco.MjModel.from_xml_path(str(path))
    torque = MujocoTorque(mjcf, diagnosis.robot)
    squares = np.zeros((3, prepared.joints))
    for run in prepared.runs:
        of_file = TorqueLag(model.final_timing).put_on(
            torque.along(run.logged.q, run.logged.dq, run.logged.ddq, run.logged.sample_rate),
            run.logged.sample_rate,
        )
        for stage, each in enumerate((*_of_laws(model, run), of_file)):
            squares[stage] += np.sum(np.where(run.used, run.left_by(each), 0.0) ** 2, axis=0)
    counts = np.sum([run.used.sum(axis=0) for run in prepared.runs], axis=0)
    return FileError(*np.sqrt(squares / np.maximum(counts, 1)))


def _of_laws(model: Corrected, run: Run) -> tuple[Array, Array]:
    """Torque (N, n) along a run by the model as given, and by what is kept of the diagnosis's laws."""
    logged = as_predicted(model, replace(run.logged, carried=None, beside=None))
    given, parameters, effects = torque_along(model, logged)
    known = replace(logged, parameters=model.nominal).predicted
    return given, model.kept.of_torque(known, parameters, effects)[1]


class MujocoTorque:
    """The torque that a compiled MJCF needs at a robot's joints, as its motors count it.

    Joints that the robot has not got, as those of a gearbox that gives way, are held at zero. Contacts and
    joint limits are left out; friction is MuJoCo's own.
    """

    def __init__(self, mjcf: Any, robot: Robot):
        self.chain = robot.chain
        joints = [mjcf.joint(name) for name in robot.chain.tree.joint_names]
        self.mjcf = mjcf
        self.mjcf.opt.disableflags |= int(UNFELT)
        self.qpos = np.array([joint.qposadr[0] for joint in joints])
        self.dofs = np.array([joint.dofadr[0] for joint in joints])
        # A motor that the file has and the model has not is one of an effect, whose control is torque.
        self.gains = _gains(mjcf, robot.joint_names) / _gains(robot.model, robot.joint_names)

    def along(self, q: Array, dq: Array, ddq: Array, rate: float) -> Array:
        """Torque (N, n) N·m along a motion sampled at ``rate``, Hz."""
        data = mujoco.MjData(self.mjcf)
        steps = int(np.ceil(1 / (rate * STATE_STEP))) if self.mjcf.na else 0
        self.mjcf.opt.timestep = 1 / (rate * max(steps, 1))
        motion = self._placed(q, dq, ddq)
        out = np.empty((len(q), self.mjcf.nv))
        for sample, placed in enumerate(zip(*motion, strict=True)):
            data.qpos, data.qvel, data.qacc = placed
            mujoco.mj_inverse(self.mjcf, data)
            mujoco.mj_fwdActuation(self.mjcf, data)
            np.subtract(data.qfrc_inverse, data.qfrc_actuator, out=out[sample])
            for _ in range(steps):
                mujoco.mj_step(self.mjcf, data)
                data.qpos, data.qvel, data.qacc = placed
        return self.chain.at_joints(out[:, self.dofs]) / self.gains

    def _placed(self, q: Array, dq: Array, ddq: Array) -> tuple[Array, Array, Array]:
        """Positions (N, nq), velocities and accelerations (N, nv) of the whole MJCF along a motion."""
        qpos = np.tile(self.mjcf.qpos0, (len(q), 1))
        qvel, qacc = np.zeros((2, len(q), self.mjcf.nv))
        qpos[:, self.qpos] = self.chain.link_positions(q)
        qvel[:, self.dofs], qacc[:, self.dofs] = map(self.chain.link_motions, (dq, ddq))
        return qpos, qvel, qacc


def _gains(model: Any, names: tuple[str, ...]) -> Array:
    """Torque (n,) of each joint's motor at unit control; 1 where there is none."""
    gains = dict.fromkeys(names, 1.0)
    for index in range(model.nu):
        if model.actuator_trntype[index] != mujoco.mjtTrn.mjTRN_JOINT:
            continue
        name = model.joint(model.actuator_trnid[index, 0]).name
        is_motor = model.actuator_biastype[index] == mujoco.mjtBias.mjBIAS_NONE
        if is_motor and gains.get(name) == 1.0:
            gains[name] = float(model.actuator_gainprm[index, 0] * model.actuator_gear[index, 0])
    return np.array(list(gains.values()))
