"""Torque by MuJoCo's own inverse dynamics, which the project's is held against."""

import mujoco
import numpy as np


def mujoco_torques(model: mujoco.MjModel, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray) -> np.ndarray:
    """mj_inverse, (N, n) N·m, without constraints: friction loss is left to exact Coulomb friction."""
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    data, out = mujoco.MjData(model), np.empty_like(q)
    for sample in range(len(q)):
        data.qpos[:], data.qvel[:], data.qacc[:] = q[sample], dq[sample], ddq[sample]
        mujoco.mj_inverse(model, data)
        out[sample] = data.qfrc_inverse
    return out
