"""Joints that the model has alike share what the runs say of them, and stay apart where they differ."""

from pathlib import Path

import numpy as np

from identification.output_error.servo_run import ServoRun
from identification.parameters import COULOMB
from studies.drives.leg import KD, KP, LEG, TRUTH, recorded, table, written
from testbench.drives.identified import identify_drives
from testbench.drives.stated import Servo
from testbench.robot import load_robot

RATE = 50.0


def test_two_legs_share_what_is_one_and_keep_apart_what_is_not(tmp_path: Path) -> None:
    body = LEG[LEG.index("    <body") : LEG.index("  </worldbody>")]
    other = body
    for name in ("thigh", "shank", "hip", "knee"):
        other = other.replace(f'"{name}"', f'"other_{name}"')
    model = written(tmp_path)
    both = tmp_path / "both.xml"
    both.write_text(LEG.replace(body, body + other))
    plant = table(model)
    plant[1, COULOMB] = 3 * TRUTH["coulomb"][1]
    logs = [
        recorded(model, rate=RATE, duration=8.0, seed=seed, plant=own)
        for seed, own in ((1, None), (2, plant))
    ]
    position = np.hstack([log.position for log in logs])
    commanded = np.hstack([log.reference_position for log in logs if log.reference_position is not None])
    robot, full = load_robot(both), np.ones(4)
    gains = np.tile(KP, 2), np.tile(KD, 2)
    servo = Servo(*gains, 0.1 * full, 0 * full, 0.05 * full, robot.limits.torque, 0 * full)
    found = identify_drives(robot, [servo], [ServoRun("run", position, commanded, RATE, *gains)])
    tied = {(each.name, each.joints[0]): each.is_one for each in found.tied}
    assert not tied["coulomb", "knee"]
    assert tied["coulomb", "hip"]
    assert tied["armature", "hip"]
    values = {(each.name, each.joint): each for each in found.figures}
    assert values["coulomb", "other_knee"].value > 2 * values["coulomb", "knee"].value
    for name in ("armature", "coulomb"):
        for joint in ("hip", "other_hip"):
            each = values[name, joint]
            assert abs(each.value - TRUTH[name][0]) < 3 * each.std
    # Two legs know it better than one, and no better than twice.
    for own, alone in zip(found.fits, found.separate, strict=True):
        place = own.unknowns.at("armature")[0]
        assert 0.5 * alone.std[place] < own.std[place] < alone.std[place]
