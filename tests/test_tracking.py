"""A simulated loop is stable over the arm's range, or it is refused and leaves no log."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from identification.errors import InputError
from identification.inverse_dynamics import inverse_dynamics
from testbench.cli import main
from testbench.jobs.simulate import torque_noise
from testbench.log import read_log
from testbench.robot import Robot
from testbench.simulation import (
    ControllerOptions,
    Reference,
    SensorOptions,
    SimulationOptions,
    controller_gains,
    held_up,
    sample_reference,
    simulate,
    tracking,
)
from testbench.simulation.gains import LATENESS, inertia_over_range, sag
from testbench.simulation.steady import SAG, resolved

from .one_line import complaint
from .simulated_arm import ARM, ARM_MOTION, RATE, Sines, robot_from

LINK = '<inertial pos="0 0 {length}" mass="{mass}" diaginertia="{across} {across} {along}"/>'


def light_arm(armature: float, free: str = "", slim: float = 1.0) -> str:
    """Seven light links whose axes alternate, upright at zero: joints 1, 3, 5 and 7 are one line there.

    slim: inertia about it, of that across.
    """
    body, end = "", ""
    for joint in range(7):
        mass = 1.4 / (1 + 0.4 * joint)
        inertial = LINK.format(length=0.09, mass=mass, across=0.004 * mass, along=slim * 0.004 * mass)
        axis, limits = ("0 0 1", free) if joint % 2 == 0 else ("0 1 0", 'range="-2.3 2.3"')
        body += (
            f'<body pos="0 0 {0.18 if joint else 0.1}">{inertial}'
            f'<joint name="j{joint + 1}" axis="{axis}" {limits} '
            f'armature="{armature}" damping="0.2" frictionloss="0.1" actuatorfrcrange="-40 40"/>'
        )
        end += "</body>"
    return f'<mujoco model="light"><compiler angle="radian"/><worldbody>{body}{end}</worldbody></mujoco>'


LIGHT_MOTION = sample_reference(
    Sines((0.8, -0.5, 0.7, 0.6, -0.8, 0.5, 0.9), (1, 2, 1, 2, 3, 1, 2), 4.0), RATE
)
NOISY = SimulationOptions(sensors=SensorOptions(encoder_bits=17, torque_noise=0.01), physics_timestep=2e-4)


@pytest.fixture(scope="module")
def light(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    return robot_from(light_arm(0.0), tmp_path_factory.mktemp("light"))


def crossover(robot: Robot, options: SimulationOptions) -> float:
    """The fastest velocity loop in any pose, rad/s."""
    kd = controller_gains(options, robot).kd
    limits = robot.limits
    inertia = inertia_over_range(robot.chain, robot.parameters, limits.lower, limits.upper)
    return max(np.linalg.eigvals(np.linalg.solve(each, np.diag(kd))).real.max() for each in inertia)


def test_an_arm_without_rotors_follows_its_reference(light: Robot) -> None:
    (recording,) = simulate(light, [LIGHT_MOTION], NOISY)
    followed = tracking(recording, light.limits.torque)
    followed.require_followed("light")
    assert followed.share.max() < 0.05
    assert not followed.warnings()


@pytest.mark.parametrize("rate", [250.0, 1000.0])
def test_bandwidth_gives_way_to_the_rate_and_says_so(light: Robot, rate: float) -> None:
    options = SimulationOptions(ControllerOptions(rate=rate, bandwidth=20), physics_timestep=2e-4)
    late = 1 / (2 * np.pi * options.controller.cutoff) + 1 / rate + options.physics_timestep
    assert crossover(light, options) <= LATENESS / late
    lines = controller_gains(options, light).reduced(20, light.joint_names)
    assert lines[0].startswith("j1: bandwidth")
    assert "instead of 20 Hz" in lines[0]


def test_a_heavy_joint_has_the_bandwidth_asked_for(tmp_path: Path) -> None:
    arm = robot_from(ARM, tmp_path)
    options = SimulationOptions(ControllerOptions(bandwidth=3, damping_ratio=0.7))
    found = controller_gains(options, arm)
    assert not found.reduced(3, arm.joint_names)
    np.testing.assert_allclose(found.bandwidth, 3, rtol=1e-9)
    typical = np.sqrt(found.smallest * found.largest)
    np.testing.assert_allclose(found.kp, (6 * np.pi) ** 2 * typical)
    np.testing.assert_allclose(found.kd, 2 * 0.7 * 6 * np.pi * typical)


def light_tip(damping: float) -> str:
    """A heavy link, and one of 10 g behind a damped joint."""
    return (
        '<mujoco model="light"><compiler angle="radian"/><worldbody><body>'
        '<inertial pos="0 0 .3" mass="1" diaginertia=".01 .01 .001"/>'
        '<joint name="lift" axis="0 1 0" range="-2 2" actuatorfrcrange="-20 20"/>'
        '<body pos="0 0 .6"><joint name="nod" axis="0 1 0" range="-2 2" actuatorfrcrange="-20 20" '
        f'damping="{damping}"/><inertial pos="0 0 .03" mass="0.01" diaginertia="1e-6 1e-6 1e-6"/>'
        "</body></body></worldbody></mujoco>"
    )


NODS = Sines((0.5, -0.4), (1, 2), 2.0)


def test_a_loop_that_gravity_overcomes_is_made_faster_and_the_log_keeps_its_rate(light: Robot) -> None:
    options, line = held_up(replace(NOISY, controller=ControllerOptions(bandwidth=1.0)), light)
    limits, found = light.limits, controller_gains(options, light)
    share, _ = sag(found.kp, light.chain, light.parameters, limits.lower, limits.upper)
    assert share <= SAG
    assert line.startswith(f"loop at {options.controller.rate:g} Hz")
    assert options.logged_rate == RATE
    reference = sample_reference(
        Sines((0.8, -0.5, 0.7, 0.6, -0.8, 0.5, 0.9), (1, 2, 1, 2, 3, 1, 2), 4.0), options.controller.rate
    )
    (recording,) = simulate(light, [reference], options)
    assert recording.sample_rate == RATE
    assert tracking(recording, limits.torque).share.max() < 0.05


def test_a_log_slower_than_its_loop_has_the_mean_torque_of_its_own_period(tmp_path: Path) -> None:
    arm = robot_from(ARM, tmp_path)
    ideal = SimulationOptions(ControllerOptions(rate=4 * RATE), physics_timestep=0.25 / RATE)
    fast, slow = (simulate(arm, [ARM_MOTION], replace(ideal, loops_a_sample=every))[0] for every in (1, 4))
    np.testing.assert_array_equal(slow.position, fast.position[::4])
    # A window of four held values, centred on the sample.
    held = fast.torque_command
    windows = np.stack([held[4 * k - 2 : 4 * k + 2].mean(axis=0) for k in range(1, len(slow.time) - 1)])
    np.testing.assert_allclose(slow.torque[1:-1], windows, rtol=1e-12)


def test_damping_that_stops_a_light_link_within_a_step_is_resolved(tmp_path: Path) -> None:
    # 0.05 N·m·s/rad on 1e-5 kg·m²: 200 µs.
    damped = robot_from(light_tip(0.05), tmp_path)
    options = SimulationOptions(physics_timestep=2e-4)
    fine = resolved(options, damped)
    assert 1e-5 < fine.options.physics_timestep < 1e-4
    assert fine.options.substeps * fine.options.physics_timestep == pytest.approx(1e-3)
    assert not fine.implicit.any()
    (recording,) = simulate(damped, [sample_reference(NODS, 1000)], options)
    assert tracking(recording, damped.limits.torque).share.max() < 0.05


@pytest.mark.parametrize("damping", [0.5, 5.0])
def test_damping_that_stops_a_light_link_at_once_is_stepped_implicitly(
    damping: float, tmp_path: Path
) -> None:
    # 20 and 2 µs on 1e-5 kg·m².
    damped = robot_from(light_tip(damping), tmp_path)
    options = SimulationOptions(physics_timestep=2e-4)
    fine = resolved(options, damped)
    step = fine.options.physics_timestep
    assert step == pytest.approx(1e-5)
    smallest = controller_gains(fine.options, damped).smallest[1]
    share = max(0.5, 1 - smallest / (damping * step))
    np.testing.assert_allclose(fine.implicit, [0, share * step * damping], rtol=1e-9)
    (recording,) = simulate(damped, [sample_reference(NODS, 1000)], options)
    assert tracking(recording, damped.limits.torque).share.max() < 0.05
    # The torque of the run is that of the model along the very motion, but for what half a step is late by.
    truth = recording.truth
    motion = truth["position"], truth["velocity"], truth["acceleration"]
    expected = inverse_dynamics(damped.chain, damped.parameters, *motion)
    late = step * damping * np.abs(truth["acceleration"][:, 1]).max()
    error = np.abs(truth["torque"] - expected)[100:]
    assert error[:, 1].max() < late + 1e-4
    assert error[:, 0].max() < 1e-3 * np.abs(expected[:, 0]).max()
    # The loop is as stiff as its damping asks for.
    kp, w = controller_gains(fine.options, damped).kp[1], 2 * np.pi * 6
    assert kp == pytest.approx(damping * w / 2)


FOLDED_BESIDE_PENDULUM = """
<mujoco><compiler angle="radian"/><worldbody>
  <body><joint name="turn" axis="0 0 1" range="-3 3"/>
    <inertial pos="0 0 0" mass=".01" diaginertia="1e-5 1e-5 1e-5"/>
    <body pos=".3 0 0"><joint name="fold" axis="0 0 1" range="-3 3"/>
      <inertial pos=".3 0 0" mass="1" diaginertia="1e-4 1e-4 1e-4"/></body></body>
  <body><joint name="swing" axis="0 1 0" range="-1 1"/>
    <inertial pos=".2 0 0" mass="1" diaginertia="1e-6 1e-6 1e-6"/></body>
</worldbody></mujoco>
"""


def test_a_joint_that_sags_gets_its_bandwidth_though_the_rate_bounds_another(tmp_path: Path) -> None:
    robot = robot_from(FOLDED_BESIDE_PENDULUM, tmp_path)
    options, _ = held_up(SimulationOptions(ControllerOptions(bandwidth=1.0)), robot)
    # Gravity's share is g sin q / (l w²), at the range's end 1.05 at 1 Hz and 0.46 at 1.5 Hz.
    assert (options.controller.rate, options.controller.bandwidth) == (1000, 1.5)
    found = controller_gains(options, robot)
    assert found.bandwidth[0] < 1.5
    share, _ = sag(found.kp, robot.chain, robot.parameters, robot.limits.lower, robot.limits.upper)
    assert share == pytest.approx(9.81 * np.sin(1) / (0.2 * (3 * np.pi) ** 2), rel=1e-2)


def test_links_too_light_for_any_loop_are_refused_by_name(tmp_path: Path) -> None:
    # Upright, nothing but their inertia about one line distinguishes the odd joints.
    rods = light_arm(0.0, slim=1e-6).replace('damping="0.2"', "")
    with pytest.raises(InputError, match="j[1357]: expected the rotors' inertia .armature."):
        held_up(SimulationOptions(), robot_from(rods, tmp_path))


# Runs are judged by what they did


def judged(robot: Robot, options: SimulationOptions, motion: Reference = LIGHT_MOTION) -> str:
    (recording,) = simulate(robot, [motion], options)
    followed = tracking(recording, robot.limits.torque)
    try:
        followed.require_followed("light")
    except InputError as error:
        return str(error)
    return "\n".join(followed.warnings())


def test_an_unstable_loop_is_refused(light: Robot) -> None:
    # Far beyond what a filter and a hold that are 3 ms late can stand.
    found = controller_gains(NOISY, light)
    said = judged(light, replace(NOISY, controller=ControllerOptions(kp=found.kp, kd=20 * found.kd)))
    assert "light: tracking: expected a loop that follows its reference" in said
    assert "times its peak speed" in said
    assert "\n" not in said


def test_a_loop_too_soft_to_follow_is_warned_of(light: Robot) -> None:
    soft = controller_gains(NOISY, light)
    options = replace(NOISY, controller=ControllerOptions("pd", kp=10 * soft.kp, kd=2 * soft.kd))
    said = judged(light, options)
    assert said.startswith("warning: j")
    assert "whose range is" in said


def test_torque_that_chatters_at_its_limit_is_refused_however_well_it_follows(light: Robot) -> None:
    (recording,) = simulate(light, [LIGHT_MOTION], NOISY)
    command = recording.torque_command.copy()
    command[::10, 4], command[1::10, 4] = 40.0, -40.0
    followed = tracking(replace(recording, torque_command=command), light.limits.torque)
    with pytest.raises(InputError, match="j5 strays .* with its torque at the limit 20% of the time"):
        followed.require_followed("light")


def test_torque_held_at_its_limit_while_the_robot_follows_is_no_runaway(light: Robot) -> None:
    (recording,) = simulate(light, [LIGHT_MOTION], NOISY)
    held = replace(recording, torque_command=np.full_like(recording.torque_command, 40.0))
    followed = tracking(held, light.limits.torque)
    assert followed.saturated.tolist() == [1.0] * 7
    assert followed.switching.max() == 0.0
    followed.require_followed("light")


@pytest.mark.parametrize(("size", "races"), [(0.01, False), (1.0, True)])
def test_a_motion_of_next_to_no_range_is_not_raced_by_a_sag(light: Robot, size: float, races: bool) -> None:
    """Off by a fifth of its range, or of what counts as one, and six times as fast."""
    (run,) = simulate(light, [LIGHT_MOTION], NOISY)
    position, speed = size * run.reference_position, size * run.reference_velocity
    off = 0.2 * np.maximum(np.ptp(position, axis=0), 0.1)
    sagged = replace(
        run,
        position=position + off,
        reference_position=position,
        reference_velocity=speed,
        truth={**run.truth, "velocity": 6 * speed},
    )
    followed = tracking(sagged, light.limits.torque)
    assert len(followed.warnings()) == 7
    if races:
        with pytest.raises(InputError, match="times its peak speed"):
            followed.require_followed("light")
    else:
        followed.require_followed("light")


def test_what_is_not_finite_has_run_away(light: Robot) -> None:
    (recording,) = simulate(light, [LIGHT_MOTION], NOISY)
    position = recording.position.copy()
    position[50, 2] = np.nan
    followed = tracking(replace(recording, position=position), light.limits.torque)
    with pytest.raises(InputError, match="j3 strays nan rad"):
        followed.require_followed("light")


# Servos of the model


def test_the_models_servos_drive_the_simulated_arm(tmp_path: Path) -> None:
    servos = (
        '<actuator><position joint="turn" kp="4000" kv="200"/>'
        '<position joint="lift" kp="900" kv="30" gear="2"/>'
        '<position joint="reach" kp="9000" kv="300"/></actuator>'
    )
    arm = robot_from(ARM.replace(ARM[ARM.index("<actuator>") : ARM.index("</mujoco>")], servos), tmp_path)
    options = SimulationOptions(ControllerOptions("model", velocity_cutoff=1e6))
    (recording,) = simulate(arm, [ARM_MOTION], options)
    controller = recording.controller
    assert controller is not None
    assert controller.kind == "position_servo"
    np.testing.assert_allclose(controller.kp, [4000, 3600, 9000])
    np.testing.assert_allclose(controller.kd, [200, 120, 300])
    velocity = np.diff(recording.position, axis=0, prepend=recording.position[:1]) * RATE
    command = controller.kp * (ARM_MOTION.position - recording.position) - controller.kd * velocity
    np.testing.assert_allclose(
        recording.torque_command, np.clip(command, -arm.limits.torque, arm.limits.torque)
    )


# From outside


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    robot_from(light_arm(0.05, 'range="-3 3"'), tmp_path)
    design = "excite --model robot.xml --starts 1 --harmonics 3 --base-frequency 0.25 --out T.json"
    main([*design.split(), "--limit-share", "0.3"])
    return tmp_path


def test_from_the_command_line(place: Path, capfd: pytest.CaptureFixture[str]) -> None:
    drive = "simulate --model robot.xml --trajectory T.json --periods 1"
    capfd.readouterr()
    main([*drive.split(), "--bandwidth", "2", "--out", "slow.h5"])
    assert "bandwidth" not in capfd.readouterr().out
    main([*drive.split(), "--out", "own.h5"])
    slow, own = read_log(place / "slow.h5").controller, read_log(place / "own.h5").controller
    assert slow is not None
    assert own is not None
    assert slow.kp is not None
    assert own.kp is not None
    assert (slow.kp < own.kp / 4).all()
    capfd.readouterr()
    said = complaint(f"{drive} --controller model --out none.h5", capfd)
    assert "a position actuator on every joint" in said
    said = complaint(f"{drive} --controller pd --bandwidth 0.05 --out none.h5", capfd)
    assert not (place / "none.h5").exists()


@pytest.mark.parametrize(("limit", "noise"), [(40, 0.4), (1e6, 0.01 * 9.81)])
def test_torque_noise_is_of_the_limit_where_that_is_a_rating(
    tmp_path: Path, limit: float, noise: float
) -> None:
    # 1 kg a metre out, nearly still.
    arm = (
        '<mujoco><worldbody><body><inertial pos="1 0 0" mass="1" diaginertia=".1 .1 .1"/>'
        f'<joint name="lift" axis="0 1 0" range="-1 1" actuatorfrcrange="-{limit} {limit}"/></body>'
        "</worldbody></mujoco>"
    )
    robot = robot_from(arm, tmp_path)
    share, line = torque_noise(robot, sample_reference(Sines((0.001,), (1,), 10.0), 100))
    assert (share * robot.limits.torque).item() == pytest.approx(noise, rel=0.01)
    assert ("are no ratings" in line) == (limit > 100)
