"""A motion in closed form as a log without noise."""

import numpy as np

from identification.inverse_dynamics import inverse_dynamics
from testbench.effects.logged import Logged, body_in_link
from testbench.robot import Robot


def exactly(
    arm: Robot, time: np.ndarray, cutoff: float, motion: tuple[np.ndarray, np.ndarray, np.ndarray]
) -> Logged:
    """q, dq, ddq (N, n) at these instants (N,), tracked perfectly, with the torque that the model needs."""
    q, dq, ddq = motion
    rotation, origin = body_in_link(arm, arm.joints - 1)
    return Logged(
        chain=arm.chain,
        parameters=arm.parameters,
        nominal=arm.parameters,
        limits=arm.limits,
        time=time,
        sample_rate=1 / (time[1] - time[0]),
        cutoff=cutoff,
        q=q,
        dq=dq,
        ddq=ddq,
        tau=inverse_dynamics(arm.chain, arm.parameters, q, dq, ddq),
        reference_position=q,
        reference_velocity=dq,
        reference_acceleration=ddq,
        body_rotation=rotation,
        body_origin=origin,
    )
