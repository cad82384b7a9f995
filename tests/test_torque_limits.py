"""The torque that a model lets each joint have."""

import numpy as np
import pytest

from .small_arm import ARM, small_arm

FREE = ARM.replace('actuatorfrcrange="-80 80"', "").replace('actuatorfrcrange="-30 30"', "")


@pytest.mark.parametrize(
    ("actuator", "limit"),
    [
        ('<motor joint="shoulder" gear="10" ctrlrange="-3 3"/>', 30.0),
        ('<general joint="shoulder" gainprm="5" ctrlrange="-3 4"/>', 15.0),
        ('<motor joint="shoulder" ctrlrange="-90 90" forcerange="-70 70"/>', 70.0),
        # What a servo is asked for is an angle or a speed.
        ('<position joint="shoulder" kp="100" ctrlrange="-3 3" forcerange="-50 50"/>', 50.0),
        ('<velocity joint="shoulder" kv="10" ctrlrange="-1 1" forcerange="-50 50"/>', 50.0),
        ('<position joint="shoulder" kp="100" ctrlrange="-3 3"/>', np.inf),
    ],
)
def test_the_limit_of_a_joints_torque_is_that_of_its_actuator(tmp_path, actuator, limit):
    arm = small_arm(tmp_path, FREE.replace("</mujoco>", f"<actuator>{actuator}</actuator></mujoco>"))
    assert arm.limits.torque.tolist() == [limit, np.inf]
