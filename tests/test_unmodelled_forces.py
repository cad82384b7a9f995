"""Forces of a model that the program does not model are reported when it is loaded, not ignored."""

import mujoco
import numpy as np
import pytest

from identification.errors import InputError
from testbench.effects import parse_injection
from testbench.effects.mjcf_form import write_effects
from testbench.robot import load_robot
from testbench.unmodelled_forces import unmodelled_forces

from .small_arm import ARM, small_arm


def _with(elements: str = "", shoulder: str = "", lower: str = "", option: str = "") -> str:
    text = ARM.replace('<joint name="shoulder"', f'<joint name="shoulder" {shoulder}')
    text = text.replace('<body name="lower"', f'<body name="lower" {lower}')
    return text.replace("<worldbody>", f"{option}<worldbody>").replace("</mujoco>", f"{elements}</mujoco>")


def _tendon(attributes: str) -> str:
    joints = '<joint joint="shoulder" coef="1"/><joint joint="elbow" coef="1"/>'
    return f'<tendon><fixed name="t" {attributes}>{joints}</fixed></tendon>'


def _actuator(element: str) -> str:
    return f"<actuator>{element}</actuator>"


DCMOTOR = 'dcmotor name="a" joint="elbow" resistance="1" motorconst=".1"'
SPRING = '<general name="a" joint="elbow" gainprm="0" biastype="affine" biasprm="0 -5 0"/>'
FORCES = {
    "springyield 0.2 of joint shoulder": _with(shoulder='stiffness="20" springyield=".2"'),
    "damping 3 2 of joint shoulder": _with().replace('damping="3"', 'damping="3 2"'),
    "gravcomp 0.5 of body lower": _with(lower='gravcomp=".5"'),
    "stiffness 4 of tendon t": _with(_tendon('stiffness="4"')),
    "damping 2 of tendon t": _with(_tendon('damping="2"')),
    "option density 1.2": _with(option='<option density="1.2"/>'),
    "option viscosity 0.1": _with(option='<option viscosity=".1"/>'),
    "equality weld w": _with('<equality><weld name="w" body1="lower"/></equality>'),
    "armature 0.2 of actuator a": _with(_actuator('<motor name="a" joint="elbow" armature=".2"/>')),
    "damping 3 of actuator a": _with(_actuator('<motor name="a" joint="elbow" damping="3"/>')),
    "cogging 0.4 of actuator a": _with(_actuator(f'<{DCMOTOR} cogging=".4 6 0"/>')),
    "LuGre friction of actuator a": _with(_actuator(f'<{DCMOTOR} lugre="900 1 2 3 .1"/>')),
    "back-EMF of actuator a, which has no input": _with(_actuator(f'<{DCMOTOR} input="none"/>')),
    "bias 0 -5 of actuator a, which has no gain": _with(_actuator(SPRING)),
}
HARMLESS = {
    "zero values": _with(_tendon("")),
    "springs that are known": _with(shoulder='stiffness="20 0 7" springref=".3"'),
    "an inactive equality": _with('<equality><weld body1="lower" active="false"/></equality>'),
    "wind in a vacuum": _with(option='<option wind="1 0 0"/>'),
    "compensated gravity where there is none": _with(
        lower='gravcomp="1"', option='<option><flag gravity="disable"/></option>'
    ),
    "drives": _with(
        _actuator(
            '<motor joint="elbow"/><position joint="elbow" kp="50" kv="2"/><velocity joint="elbow"/>'
            f"<{DCMOTOR}/>"
        )
    ),
    "contacts switched off": _with(option='<option><flag contact="disable"/></option>'),
}


@pytest.mark.parametrize("force", FORCES)
def test_a_force_that_nothing_reckons_with_is_reported_with_its_value_and_element(force):
    assert unmodelled_forces(mujoco.MjModel.from_xml_string(FORCES[force])) == (force,)


@pytest.mark.parametrize("model", HARMLESS)
def test_what_exerts_no_force_is_let_pass(model):
    assert unmodelled_forces(mujoco.MjModel.from_xml_string(HARMLESS[model])) == ()


def test_a_model_with_such_a_force_is_refused_in_one_line(tmp_path):
    with pytest.raises(InputError) as refused:
        small_arm(tmp_path, FORCES["gravcomp 0.5 of body lower"])
    assert str(refused.value) == (
        f"{tmp_path / 'arm.xml'}: forces: expected rigid bodies with joint springs, armature, damping, "
        "frictionloss and gravity, got gravcomp 0.5 of body lower; take it out of the model, "
        "simulate has --effect"
    )


def test_a_simulator_with_effects_is_a_model_without_them_and_says_so(tmp_path):
    arm = small_arm(tmp_path)
    spring = parse_injection(arm, "gravity_spring:shoulder:stiffness=2,phase=0.3")
    write_effects(arm, [spring], tmp_path / "corrected.xml")
    again = load_robot(tmp_path / "corrected.xml")
    np.testing.assert_allclose(again.parameters, arm.parameters, atol=1e-12)
    spring_left_out = "its cogging 2 of actuator shoulder_spring act in MuJoCo and are left out here"
    assert again.notes == (f"a corrected simulator: {spring_left_out}",)


def test_joints_that_share_a_drive_in_a_simulator_are_no_gripper(tmp_path):
    arm = small_arm(tmp_path)
    coupling = parse_injection(arm, "joint_coupling:shoulder:into=elbow,viscous=1,coulomb=2")
    write_effects(arm, [coupling], tmp_path / "corrected.xml")
    again = load_robot(tmp_path / "corrected.xml")
    assert again.joint_names == arm.joint_names
    assert "frictionloss 2 of tendon shoulder_elbow_coupling" in again.notes[0]


def test_a_simulator_whose_effects_are_no_forces_is_a_model(tmp_path):
    arm = small_arm(tmp_path)
    write_effects(arm, [parse_injection(arm, "base_tilt::roll=0.1,pitch=0")], tmp_path / "corrected.xml")
    assert load_robot(tmp_path / "corrected.xml").joints == 2


def test_disabled_gravity_is_zero(tmp_path):
    option = '<option gravity="0 0 -9.81"><flag gravity="disable"/></option>'
    assert not small_arm(tmp_path, _with(option=option)).chain.gravity.any()
