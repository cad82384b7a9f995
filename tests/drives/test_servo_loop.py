"""Position servos simulated: against MuJoCo, and where the answer is known without simulating."""

from pathlib import Path

import mujoco
import numpy as np

from identification.output_error.plant import (
    BACK_EMF,
    DEADBAND,
    DELAY,
    ENCODER_AFTER,
    FRICTION_CENTRE,
    FRICTION_SLOPE,
    GAP,
    INVERSE_RATE,
    LIMIT,
    STALL,
    limbs,
    plant_table,
)
from identification.output_error.servo_loop import Window, simulate
from identification.parameters import ARMATURE, COULOMB, VISCOUS
from studies.drives.leg import KD, KP, LEG, command, table, written
from testbench.robot import load_robot

RATE = 100.0


def test_without_coulomb_friction_it_moves_as_mujoco_does(tmp_path: Path) -> None:
    servos = "".join(f'<position joint="{name}" kp="20" kv="1"/>' for name in ("hip", "knee"))
    xml = LEG.replace("</mujoco>", f"<actuator>{servos}</actuator></mujoco>")
    model = mujoco.MjModel.from_xml_string(xml)
    model.opt.timestep, model.opt.integrator = 1e-3, mujoco.mjtIntegrator.mjINT_RK4
    data = mujoco.MjData(model)
    follow = command(RATE, 3.0, 1)
    data.qpos[:] = follow[0]
    expected = []
    for now in follow:
        expected.append(data.qpos.copy())
        data.ctrl[:] = now
        mujoco.mj_step(model, data, round(1 / (RATE * model.opt.timestep)))
    robot = load_robot(written(tmp_path))
    given = plant_table(robot.parameters, np.zeros(2), robot.limits.torque)
    window = Window(follow, KP, KD, 0, len(follow), follow[0], np.zeros(2))
    ((run,),) = simulate(robot.chain, given[None], [window], RATE)
    assert np.abs(run.position - np.array(expected)).max() < 1e-4


def test_a_joint_sticks_until_the_drive_overcomes_its_friction(tmp_path: Path) -> None:
    robot = load_robot(written(tmp_path))
    given = plant_table(robot.parameters, np.zeros(2), robot.limits.torque)
    # Hanging straight down but for the thigh's centre, which pulls with .1 N·m.
    given[:, COULOMB] = 0.5
    follow = np.zeros((100, 2))
    follow[50:, 0] = [0.01 * k for k in range(50)]
    window = Window(follow, KP, KD, 0, len(follow), np.zeros(2), np.zeros(2))
    ((run,),) = simulate(robot.chain, given[None], [window], RATE)
    # .39 N·m from the drive and .11 from gravity hold at sample 52, far more does not at the end.
    assert np.all(run.position[:52] == 0)
    assert run.position[-1, 0] > 0.2
    assert np.all(np.diff(run.position[50:, 0]) >= 0)


def test_a_delay_of_whole_samples_shifts_the_command(tmp_path: Path) -> None:
    robot = load_robot(written(tmp_path))
    late, prompt = table(robot.path), table(robot.path)
    late[:, DELAY], prompt[:, DELAY] = 0.03, 0.0
    follow = command(RATE, 3.0, 2)
    shifted = np.concatenate([np.repeat(follow[:1], 3, axis=0), follow[:-3]])
    runs = [
        simulate(robot.chain, own[None], [Window(commanded, KP, KD, 0, 300, follow[0], np.zeros(2))], RATE)
        for own, commanded in ((late, follow), (prompt, shifted))
    ]
    np.testing.assert_allclose(runs[0][0][0].position, runs[1][0][0].position, atol=1e-9)


def test_candidates_do_not_depend_on_threads_or_on_each_other(tmp_path: Path) -> None:
    robot = load_robot(written(tmp_path))
    tables = np.stack([table(robot.path) * scale for scale in (1.0, 1.01, 1.02)])
    follow = command(RATE, 2.0, 3)
    window = Window(follow, KP, KD, 20, 180, follow[20], np.zeros(2))
    together = simulate(robot.chain, tables, [window, window], RATE, threads=2)
    (single,) = simulate(robot.chain, tables[1:2], [window], RATE, threads=1)
    assert np.array_equal(together[1][1].position, single[0].position)
    assert np.isfinite(single[0].position).all()


def test_a_candidate_without_positive_inertia_ends_in_nan(tmp_path: Path) -> None:
    robot = load_robot(written(tmp_path))
    impossible = table(robot.path)
    impossible[:, :10] *= -1
    follow = command(RATE, 1.0, 3)
    ((run,),) = simulate(
        robot.chain, impossible[None], [Window(follow, KP, KD, 0, 100, follow[0], np.zeros(2))], RATE
    )
    assert np.isnan(run.position[-1]).all()


def test_legs_on_one_base_are_limbs_of_their_own(tmp_path: Path) -> None:
    body = LEG[LEG.index("    <body") : LEG.index("  </worldbody>")]
    other = body
    for name in ("thigh", "shank", "hip", "knee"):
        other = other.replace(f'"{name}"', f'"other_{name}"')
    path = tmp_path / "two.xml"
    path.write_text(LEG.replace(body, body + other))
    robot = load_robot(path)
    first, second = limbs(robot.chain)
    assert first.chain.joint_names == ("hip", "knee")
    assert second.chain.joint_names == ("other_hip", "other_knee")
    assert second.chain.parent.tolist() == [-1, 0]


def test_a_play_of_no_width_is_no_play_and_a_wide_one_lets_the_link_lag(tmp_path: Path) -> None:
    robot = load_robot(written(tmp_path))
    tables = np.stack([table(robot.path)] * 3)
    tables[1, :, GAP] = 1e-12
    tables[2, 1, [GAP, ENCODER_AFTER]] = 0.02, 1.0
    follow = command(RATE, 4.0, 4)
    window = Window(follow, KP, KD, 0, len(follow), follow[0], np.zeros(2))
    rigid, tight, loose = (run.position for (run,) in simulate(robot.chain, tables, [window], RATE))
    np.testing.assert_allclose(tight, rigid, atol=1e-7)
    finer = simulate(robot.chain, tables[2:], [window], RATE, step=2e-4)[0][0].position
    assert 0.003 < np.abs(loose - rigid)[:, 1].max() < 0.1
    assert np.sqrt(np.mean((loose - finer) ** 2)) < 5e-4


def test_a_slow_firmware_follows_a_step_at_its_rate(tmp_path: Path) -> None:
    robot = load_robot(written(tmp_path))
    slow = table(robot.path)
    slow[:, COULOMB], slow[:, INVERSE_RATE] = 0.0, 2.0
    follow = np.zeros((200, 2))
    follow[20:, 0] = 0.4
    window = Window(follow, KP, KD, 0, 200, np.zeros(2), np.zeros(2))
    ((run,),) = simulate(robot.chain, slow[None], [window], RATE)
    # .4 rad at .5 rad/s.
    speed = (run.position[80, 0] - run.position[45, 0]) * RATE / 35
    assert abs(speed - 0.5) < 0.06


def test_an_error_within_the_deadband_moves_nothing(tmp_path: Path) -> None:
    robot = load_robot(written(tmp_path))
    dead = table(robot.path)
    dead[:, COULOMB], dead[:, DEADBAND] = 0.3, 0.05
    follow = np.zeros((100, 2))
    follow[20:] = 0.04
    window = Window(follow, KP, KD, 0, 100, np.zeros(2), np.zeros(2))
    ((run,),) = simulate(robot.chain, dead[None], [window], RATE)
    assert np.all(run.position == 0)


def test_friction_that_changes_with_position_holds_a_joint_at_one_end_of_its_motion(tmp_path: Path) -> None:
    robot = load_robot(written(tmp_path))
    uneven = table(robot.path)
    uneven[:, COULOMB], uneven[1, [FRICTION_SLOPE, FRICTION_CENTRE]] = 0.0, (2.0, 0.2)
    # .4 N·m from the drive against none below .2 rad, and 1 N·m at .7 rad.
    follow = np.zeros((100, 2))
    ends = []
    for start in (0.1, 0.7):
        begin = np.array([0.0, start])
        follow[:, 1] = start + 0.02
        window = Window(follow, KP, KD, 0, 100, begin, np.zeros(2))
        ((run,),) = simulate(robot.chain, uneven[None], [window], RATE)
        ends.append(run.position[-1, 1] - start)
    assert ends[0] != 0
    assert ends[1] == 0


def test_a_servo_that_sets_a_voltage_turns_as_fast_as_its_motor_and_pulls_as_its_current_lets_it(
    tmp_path: Path,
) -> None:
    path = tmp_path / "flywheel.xml"
    path.write_text(
        '<mujoco model="flywheel"><worldbody><body><inertial pos="0 0 0" mass="1" diaginertia=".01 .01 .01"/>'
        '<joint name="wheel" axis="0 0 1"/></body></worldbody></mujoco>'
    )
    robot = load_robot(path)
    drive = plant_table(robot.parameters, np.zeros(1), np.array([np.inf]))
    drive[0, [ARMATURE, VISCOUS, COULOMB]] = 0.0
    drive[0, [STALL, BACK_EMF, LIMIT]] = 0.8, 0.04, 0.5
    window = Window(np.full((400, 1), 1e3), np.ones(1), np.zeros(1), 0, 400, np.zeros(1), np.zeros(1))
    ((run,),) = simulate(robot.chain, drive[None], [window], RATE)
    speed = run.velocity[:, 0]
    # .5 N·m of current on .01 kg·m² at first; .8 / .04 rad/s in the end.
    assert abs(speed[5] - 0.05 * 50) < 1e-9
    assert abs(speed[-1] - 20) < 1e-4
    assert abs(run.torque[-1, 0]) < 1e-4
