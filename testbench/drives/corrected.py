"""The identified robot with its servos as MJCF: control is the commanded position."""

from pathlib import Path
from xml.etree import ElementTree

import mujoco
import numpy as np

from identification.errors import InputError
from identification.output_error.plant import BACK_EMF, DELAY, KD_SCALE, KP_SCALE, LIMIT, STALL
from identification.parameters import OFFSET, PER_JOINT, VISCOUS

from ..files import replacing
from ..model_file import write_model
from .identified import IdentifiedDrives

# s, longest: MuJoCo's delays are whole steps, and its implicit damping is of first order.
STEP = 5e-4


def write_corrected(found: IdentifiedDrives, path: Path) -> None:
    """Write the model with its identified parameters and position servos, for plain MuJoCo.

    The file is whole or not there. Each joint has one actuator: kp (ctrl delayed - q) - kd dq - offset,
    within the drive's limit; the delay is MuJoCo's own. Of a servo that sets a voltage, the limit is the
    lower one of current and full voltage, and back EMF is damping of the joint. Raises InputError for what
    MuJoCo refuses.
    """
    table, servo = found.identified.copy(), found.servo
    table[:, VISCOUS] += table[:, BACK_EMF]
    table[:, LIMIT] = np.minimum(table[:, LIMIT], table[:, KP_SCALE] * table[:, STALL])
    write_model(found.robot, table[:, :PER_JOINT].ravel(), path)
    root = ElementTree.parse(path).getroot()
    for old in root.findall("actuator") + root.findall("keyframe"):
        root.remove(old)
    option = root.find("option")
    if option is None:
        option = ElementTree.SubElement(root, "option")
    option.set("integrator", "implicitfast")
    step = min(STEP, float(option.get("timestep", "0.002")))
    option.set("timestep", repr(step))
    actuators = ElementTree.SubElement(root, "actuator")
    for joint, name in enumerate(found.robot.joint_names):
        kp, kd = table[joint, KP_SCALE] * servo.kp[joint], table[joint, KD_SCALE] * servo.kd[joint]
        element = ElementTree.SubElement(actuators, "general")
        fields = {
            "name": name,
            "joint": name,
            "biastype": "affine",
            "gainprm": _text(kp),
            "biasprm": _text(-table[joint, OFFSET], -kp, -kd),
        }
        if np.isfinite(table[joint, LIMIT]):
            fields["forcerange"] = _text(-table[joint, LIMIT], table[joint, LIMIT])
        if table[joint, DELAY] >= step / 2:
            fields["delay"] = _text(table[joint, DELAY])
            fields["nsample"] = str(int(np.ceil(table[joint, DELAY] / step)) + 1)
        for key, value in fields.items():
            element.set(key, value)
    ElementTree.indent(root)
    with replacing(path) as temporary:
        ElementTree.ElementTree(root).write(temporary, encoding="utf-8")
        try:
            mujoco.MjModel.from_xml_path(str(temporary))
        except (ValueError, mujoco.FatalError) as error:
            raise InputError(path, "model", "servos that MuJoCo accepts", str(error)) from None


def _text(*values: float) -> str:
    return " ".join(repr(float(value)) for value in values)
