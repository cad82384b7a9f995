"""Effects written into MJCF: every model loads and runs, and native forms do what the callback does."""

from pathlib import Path

import mujoco
import numpy as np
import pytest

from identification.errors import InputError
from testbench.effects import effect, effects, injection, parse_injection
from testbench.effects.base import Injection, Scope
from testbench.effects.mjcf_form import write_effects
from testbench.log import Recording
from testbench.robot import Robot, load_robot
from testbench.simulation import ControllerOptions, SimulationOptions, sample_reference, simulate
from testbench.simulation.controller import feedforward, velocity_pole

RATE, STEP_SIZE = 1000.0, 2e-4
OPTIONS = ControllerOptions()

ARM = """
<mujoco model="arm">
  <compiler angle="{angle}"/>
  <option timestep="0.0002"/>
  <custom><numeric name="velocity_limit" data="4 4 4"/></custom>
  <worldbody>
  <body name="column" pos="0 0 0.3"><inertial pos="0 0.05 0.1" mass="6" diaginertia="0.1 0.1 0.08"/>
    <joint name="turn" axis="0 0 1" range="-{range} {range}" armature="0.6" damping="4"
           actuatorfrcrange="-120 120"/>
    <body name="upper" pos="0.1 0 0.2"><inertial pos="0.2 0 0.05" mass="4" diaginertia="0.02 0.09 0.09"/>
      <joint name="lift" axis="0 1 0" range="-{range} {range}" armature="0.5" damping="3" {friction}
             actuatorfrcrange="-120 120"/>
      <body name="fore" pos="0.4 0 0"><inertial pos="0.15 0.03 0.02" mass="2" diaginertia="0.01 0.03 0.03"/>
        <joint name="wrist" axis="0 1 0" range="-{range} {range}" armature="0.2" damping="1"
               actuatorfrcrange="-60 60"/>
      </body></body></body></worldbody>
  <actuator><motor joint="turn"/><motor joint="lift"/><motor joint="wrist"/></actuator></mujoco>
"""


def arm_of(folder: Path, friction: str = "", angle: str = "radian") -> Robot:
    path = folder / "arm.xml"
    path.write_text(ARM.format(angle=angle, range=3 if angle == "radian" else 172, friction=friction))
    return load_robot(path)


@pytest.fixture(scope="module")
def arm(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    """Without Coulomb friction, which MuJoCo makes soft and the callback exact."""
    return arm_of(tmp_path_factory.mktemp("arm"))


class Swing:
    """Every joint on two sines, at rest at both ends; 2 s."""

    joints, duration, highest_frequency = 3, 2.0, 1.5

    def evaluate(self, time):
        out = np.zeros((3, len(time), 3))
        for joint, (slow, fast) in enumerate(((0.9, 0.10), (0.7, -0.12), (1.1, 0.15))):
            for size, cycles in ((slow, 1), (fast, 3)):
                w = np.pi * cycles
                out[0, :, joint] += size * (1 - np.cos(w * time))
                out[1, :, joint] += size * w * np.sin(w * time)
                out[2, :, joint] += size * w**2 * np.cos(w * time)
        return out[0], out[1], out[2]


REFERENCE = sample_reference(Swing(), RATE)


def somewhere(robot: Robot, name: str, **values: float) -> Injection:
    """A typical injection, at the second joint where it has one."""
    scope = effect(name).DESCRIPTION.scope
    joint = None if scope is Scope.ROBOT else 2
    return injection(robot, name, joint, values, into=3 if scope is Scope.PAIR else None)


def callback_runs(robot: Robot, injections: list[Injection | None]) -> list[Recording]:
    options = [
        SimulationOptions(OPTIONS, physics_timestep=STEP_SIZE, effects=() if each is None else (each,))
        for each in injections
    ]
    return list(simulate(robot, [REFERENCE] * len(options), options, nominal=robot))


def native_torque(
    robot: Robot, path: Path, run: Recording, push: tuple[str, float, float] | None = None
) -> np.ndarray:
    """Commands (N, n) of the same controller on a model that plain MuJoCo steps, started as ``run`` does.

    push: an actuator whose control follows the contact's profile between two instants.
    """
    model = mujoco.MjModel.from_xml_path(str(path))
    model.opt.timestep = STEP_SIZE
    data = mujoco.MjData(model)
    names = robot.joint_names
    position = [int(model.joint(name).qposadr[0]) for name in names]
    motors = [motor(model, model.joint(name).id) for name in names]
    limits = robot.limits
    assert run.controller is not None
    kp, kd = run.controller.kp, run.controller.kd
    forward = feedforward(robot.chain, robot.parameters, REFERENCE, OPTIONS.coulomb_smoothing)
    pole, rate = velocity_pole(OPTIONS), np.zeros(len(names))
    data.qpos[position] = run.position[0]
    for joint in range(model.njnt):
        # The joint of a link beside its motor's turns by the windup.
        beside = model.jnt_bodyid[[model.joint(name).id for name in names]] == model.jnt_bodyid[joint]
        if model.joint(joint).name not in names and beside.any():
            windup = run.truth["link_position"] - run.truth["position"]
            data.qpos[model.jnt_qposadr[joint]] = windup[0, np.argmax(beside)]
    last, out = data.qpos[position].copy(), []
    for k in range(REFERENCE.samples):
        q = data.qpos[position]
        rate = pole * rate + (1 - pole) * (q - last) * RATE
        last = q.copy()
        torque = forward[k] + kp * (REFERENCE.position[k] - q) + kd * (REFERENCE.velocity[k] - rate)
        torque = np.clip(torque, -limits.torque, limits.torque)
        data.ctrl[motors] = torque
        if k == 0:
            start_at(model, data, motors, torque)
        if push is not None:
            inside = min(k / RATE - push[1], push[2] - k / RATE)
            data.ctrl[model.actuator(push[0]).id] = 0.5 - 0.5 * np.cos(np.pi * np.clip(inside / 0.1, 0, 1))
        mujoco.mj_step(model, data, nstep=round(1 / (RATE * STEP_SIZE)))
        out.append(torque)
    return np.array(out)


def motor(model: mujoco.MjModel, joint: int) -> int:
    """The actuator that takes a joint's torque as control."""
    on_joint = (model.actuator_trntype == mujoco.mjtTrn.mjTRN_JOINT) & (model.actuator_trnid[:, 0] == joint)
    return int(np.flatnonzero(on_joint & (model.actuator_biastype == mujoco.mjtBias.mjBIAS_NONE))[0])


def start_at(model: mujoco.MjModel, data: mujoco.MjData, motors: list[int], torque: np.ndarray) -> None:
    """Let filters and delays start at the holding torque."""
    for index, value in zip(motors, torque, strict=True):
        samples = int(model.actuator_history[index, 0])
        if samples:
            mujoco.mj_initCtrlHistory(model, data, index, None, np.full(samples, value))
        if model.actuator_actadr[index] >= 0:
            data.act[model.actuator_actadr[index]] = value


@pytest.mark.parametrize("model", ["tx90.xml", "rail_arm.xml"])
def test_every_effect_is_written_into_a_model_that_loads_and_runs(models, tmp_path, model):
    robot = load_robot(models / model)
    write_effects(robot, [], tmp_path / "plain.xml")
    for name in effects():
        out = tmp_path / f"{name}.xml"
        sentences = write_effects(robot, [somewhere(robot, name)], out)
        assert all(sentence.startswith(name) for sentence in sentences)
        written = mujoco.MjModel.from_xml_path(str(out))
        data = mujoco.MjData(written)
        mujoco.mj_step(written, data, nstep=200)
        assert np.isfinite(data.qpos).all(), name
        assert not data.warning.number.any(), name
        changed = out.read_text() != (tmp_path / "plain.xml").read_text()
        assert changed == (name not in NO_FORM)
        assert changed or sentences, f"{name}: neither in the model nor said to be missing"


# Effects that MJCF has no field for.
NO_FORM = ("encoder_eccentricity", "load_dependent_friction", "thermal_friction_drift")

# Effect, parameters and the largest difference of its torque from the callback's, as a share of its size.
NATIVE = (
    ("torque_gain_error", {"relative": 0.1}, 0.01),
    ("torque_delay", {"delay": 0.004}, 0.03),
    ("actuator_lag", {"time_constant": 0.005}, 0.05),
    ("torque_saturation", {"limit": 12.0}, 0.01),
    ("encoder_offset", {"offset": 0.03}, 0.01),
    ("base_tilt", {"roll": 0.05, "pitch": -0.03}, 0.01),
    ("external_contact", {"torque": 8.0, "start": 0.6, "duration": 0.5}, 0.01),
    ("payload", {"mass": 1.5, "first_moment_x": 0.3, "first_moment_y": 0.0, "first_moment_z": 0.03}, 0.01),
    ("nonlinear_viscous_friction", {"coefficient": 1.5, "exponent": 2.0}, 0.01),
    ("asymmetric_friction", {"offset": 1.0, "viscous_difference": 0.0}, 0.01),
    ("cable_spring", {"stiffness": 4.0, "rest": 0.3}, 0.01),
    ("gravity_spring", {"stiffness": 6.0, "phase": 0.5}, 0.01),
    ("transmission_ripple", {"amplitude": 2.0, "cycles": 12.0, "phase": 0.4}, 0.01),
    ("joint_coupling", {"viscous": 0.5, "coulomb": 0.0}, 0.01),
    ("joint_elasticity", {"stiffness": 1500.0, "damping": 3.0}, 0.03),
)


def test_a_hardening_cable_is_a_polynomial_spring(arm, tmp_path):
    cable = parse_injection(arm, "cable_spring:lift:law=hardening,stiffness=4,rest=0.3,doubling=0.5")
    assert write_effects(arm, [cable], tmp_path / "hose.xml") == ()
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "hose.xml"))
    data = mujoco.MjData(model)
    for q in (-0.5, 0.1, 0.9):
        data.qpos[1] = q
        mujoco.mj_forward(model, data)
        assert data.qfrc_spring[1] == pytest.approx(-4 * (q - 0.3) * (1 + ((q - 0.3) / 0.5) ** 2))


@pytest.fixture(scope="module")
def simulated(arm) -> dict[str, Recording]:
    runs = callback_runs(arm, [None, *(somewhere(arm, name, **values) for name, values, _ in NATIVE)])
    return dict(zip(["healthy", *(name for name, _, _ in NATIVE)], runs, strict=True))


@pytest.mark.parametrize(("name", "values", "tolerance"), NATIVE, ids=[case[0] for case in NATIVE])
def test_the_native_form_does_what_the_callback_does(arm, simulated, tmp_path, name, values, tolerance):
    healthy, run = simulated["healthy"], simulated[name]
    write_effects(arm, [somewhere(arm, name, **values)], tmp_path / "effect.xml")
    push = ("contact_2", 0.6, 1.1) if name == "external_contact" else None
    native = native_torque(arm, tmp_path / "effect.xml", run, push)
    size = rms(run.torque_command - healthy.torque_command)
    assert size > 0.1
    assert rms(native_torque(arm, arm.path, healthy) - healthy.torque_command) < 0.02
    assert rms(native - run.torque_command) < tolerance * size + 0.015


def rms(x: np.ndarray) -> float:
    return float(np.sqrt(np.mean(x**2)))


# Native forms on joints with friction, and where one contact only resembles another


@pytest.mark.parametrize("law", ["dahl", "lugre"])
def test_native_bristles_do_what_the_callbacks_do(tmp_path, law):
    robot = arm_of(tmp_path, 'frictionloss="2.5"')
    bristles = injection(robot, "presliding_hysteresis", "lift", {"stiffness": 800.0}, law)
    assert parted(robot, bristles, tmp_path / "effect.xml") < 0.05


def test_native_backlash_lands_about_as_the_callback_does(arm, tmp_path):
    # The vertical joint, whose load changes sign.
    play = injection(arm, "backlash", "turn", {"gap": 0.006})
    assert parted(arm, play, tmp_path / "effect.xml") < 0.15


def parted(robot: Robot, injected: Injection, path: Path) -> float:
    """RMS difference of the native form's torque from the callback's, as a share of the effect's size."""
    healthy, run = callback_runs(robot, [None, injected])
    write_effects(robot, [injected], path)
    return rms(native_torque(robot, path, run) - run.torque_command) / rms(
        run.torque_command - healthy.torque_command
    )


# Bristles of MuJoCo's own against closed forms


def dragged(path: Path, joint: int, speed: float, seconds: float) -> np.ndarray:
    """Passive torque (N,) on a joint that is dragged at constant speed from rest."""
    model = mujoco.MjModel.from_xml_path(str(path))
    data, out = mujoco.MjData(model), []
    for step in range(int(seconds / STEP_SIZE)):
        data.qpos[joint], data.qvel[:] = speed * step * STEP_SIZE, 0
        data.qvel[joint] = speed
        mujoco.mj_forward(model, data)
        out.append(data.qfrc_actuator[joint])
        data.act += STEP_SIZE * data.act_dot
    return np.array(out)


@pytest.mark.parametrize("speed", [0.05, 0.2, -0.6])
def test_native_stribeck_friction_slides_on_the_curve(tmp_path, speed):
    robot = arm_of(tmp_path, 'frictionloss="2.5"')
    values = {"extra": 1.5, "velocity": 0.2, "exponent": 2.0}
    sentences = write_effects(robot, [somewhere(robot, "stribeck_friction", **values)], tmp_path / "out.xml")
    curve = -np.sign(speed) * (2.5 + 1.5 * np.exp(-((speed / 0.2) ** 2)))
    assert sentences == ()
    assert dragged(tmp_path / "out.xml", 1, speed, 1.0)[-1] == pytest.approx(curve, rel=1e-3)


def test_native_bristles_bend_as_dahls(tmp_path):
    robot = arm_of(tmp_path, 'frictionloss="2.5"')
    write_effects(robot, [somewhere(robot, "presliding_hysteresis", stiffness=800.0)], tmp_path / "out.xml")
    speed = 0.004
    torque = dragged(tmp_path / "out.xml", 1, speed, 3.0)
    displacement = speed * STEP_SIZE * np.arange(len(torque))
    np.testing.assert_allclose(torque, -2.5 * (1 - np.exp(-800 * displacement / 2.5)), atol=0.01)


def test_native_backlash_lets_the_link_move_by_the_gap(tmp_path):
    """The motor is held; the link falls from one end of the gap to the other when it is pulled over."""
    robot = arm_of(tmp_path)
    write_effects(robot, [somewhere(robot, "backlash", gap=0.02)], tmp_path / "out.xml")
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "out.xml"))
    data, ends = mujoco.MjData(model), []
    model.opt.gravity[:] = 0
    model.dof_armature[model.joint("lift").dofadr] = 1e9
    play = next(j for j in range(model.njnt) if model.joint(j).name not in robot.joint_names)
    for pull in (2.0, -2.0):
        data.qfrc_applied[model.jnt_dofadr[play]] = pull
        mujoco.mj_step(model, data, nstep=5000)
        ends.append(data.qpos[model.jnt_qposadr[play]])
    assert ends[0] - ends[1] == pytest.approx(0.02, rel=0.05)


# What a file may bring along


def test_an_offset_is_the_same_in_a_file_of_degrees(tmp_path):
    (tmp_path / "degree").mkdir()
    models = []
    for robot in (arm_of(tmp_path), arm_of(tmp_path / "degree", angle="degree")):
        out = robot.path.with_name("out.xml")
        write_effects(robot, [somewhere(robot, "encoder_offset", offset=0.04)], out)
        models.append(mujoco.MjModel.from_xml_path(str(out)))
    for model in models:
        np.testing.assert_allclose(model.qpos0, [0, 0.04, 0], atol=1e-12)
    np.testing.assert_allclose(models[0].jnt_range[1], [-2.96, 3.04], atol=1e-12)
    np.testing.assert_allclose(models[1].jnt_range[1], np.deg2rad([-172, 172]) + 0.04, atol=1e-12)


def test_keyframes_follow_an_offset_and_meshes_are_found_from_another_folder(tmp_path):
    corners = np.array([[0, 0, 0], [0.1, 0, 0], [0, 0.1, 0], [0, 0, 0.1]])
    (tmp_path / "parts").mkdir()
    (tmp_path / "out").mkdir()
    faces = ["f 1 3 2", "f 1 2 4", "f 1 4 3", "f 2 3 4"]
    lines = [f"v {x} {y} {z}" for x, y, z in corners] + faces
    (tmp_path / "parts" / "fin.obj").write_text("\n".join(lines))
    xml = ARM.format(angle="radian", range=3, friction="")
    xml = xml.replace('<compiler angle="radian"/>', '<compiler angle="radian" meshdir="parts"/>')
    xml = xml.replace("<worldbody>", '<asset><mesh name="fin" file="fin.obj"/></asset><worldbody>')
    xml = xml.replace('<body name="upper"', '<geom type="mesh" mesh="fin" mass="0"/><body name="upper"', 1)
    xml = xml.replace("</mujoco>", '<keyframe><key qpos="0.1 0.2 0.3"/></keyframe></mujoco>')
    (tmp_path / "meshed.xml").write_text(xml)
    robot = load_robot(tmp_path / "meshed.xml")
    out = tmp_path / "out" / "effect.xml"
    write_effects(robot, [somewhere(robot, "encoder_offset", offset=0.04)], out)
    assert str(tmp_path) not in out.read_text()
    np.testing.assert_allclose(mujoco.MjModel.from_xml_path(str(out)).key_qpos[0], [0.1, 0.24, 0.3])


def test_a_model_that_needs_no_files_is_written_without_a_folder(tmp_path):
    texture = '<asset><texture type="2d" builtin="flat" name="grey" width="4" height="4"/></asset>'
    (tmp_path / "in").mkdir()
    (tmp_path / "in" / "arm.xml").write_text(
        ARM.format(angle="radian", range=3, friction="").replace("<worldbody>", f"{texture}<worldbody>")
    )
    robot = load_robot(tmp_path / "in" / "arm.xml")
    write_effects(robot, [somewhere(robot, "encoder_offset", offset=0.04)], tmp_path / "out.xml")
    assert "dir=" not in (tmp_path / "out.xml").read_text()


def test_effects_are_written_together_and_numbers_in_full(arm, tmp_path):
    texts = ("torque_gain_error:lift:relative=0.0123456789", "torque_delay::delay=0.0031", "payload")
    out = tmp_path / "out.xml"
    write_effects(arm, [parse_injection(arm, text) for text in texts], out)
    model = mujoco.MjModel.from_xml_path(str(out))
    assert model.actuator_gainprm[1, 0] == 1.0123456789
    np.testing.assert_array_equal(model.actuator_delay, 0.0031)
    assert model.nbody == arm.model.nbody + 1


def test_a_robot_without_motors_gets_the_one_that_an_effect_needs(tmp_path):
    xml = ARM.format(angle="radian", range=3, friction="")
    (tmp_path / "bare.xml").write_text(xml[: xml.index("<actuator>")] + "</mujoco>")
    robot = load_robot(tmp_path / "bare.xml")
    write_effects(robot, [somewhere(robot, "torque_saturation", limit=20.0)], tmp_path / "out.xml")
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "out.xml"))
    np.testing.assert_array_equal(model.actuator_forcerange, [[-20, 20]])
    np.testing.assert_array_equal(model.actuator_ctrlrange, [[-120, 120]])


def test_an_unknown_effect_is_one_line(arm, tmp_path):
    with pytest.raises(InputError, match="valid: actuator_lag"):
        write_effects(arm, [Injection("nope", 1)], tmp_path / "out.xml")
    assert not (tmp_path / "out.xml").exists()
