"""Effects in the simulated robot: against closed forms and ODEs, at zero size, at half the step."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from identification.errors import InputError
from testbench.effects import effects, injection, parse_injection
from testbench.effects.base import Injection, Scope
from testbench.log import Recording, read_log, write_log
from testbench.robot import Robot, load_robot
from testbench.simulation import (
    Reference,
    SensorOptions,
    SimulationOptions,
    batch,
    layout,
    sample_reference,
    simulate,
)
from testbench.simulation.plant import plant_model
from testbench.simulation.unmodelled import put_in

from .test_simulation import Sines, same

# Of a state under a torque.
Derivative = Callable[[np.ndarray, float], list[float]]

ARM = """
<mujoco model="arm"><worldbody>
  <body pos="0 0 0.3"><inertial pos="0 0.05 0.1" mass="6" diaginertia="0.1 0.1 0.08"/>
    <joint name="turn" axis="0 0 1" armature="0.3" damping="4" frictionloss="3" actuatorfrcrange="-120 120"/>
    <body pos="0.1 0 0.2"><inertial pos="0.2 0 0" mass="4" diaginertia="0.02 0.09 0.09"/>
      <joint name="lift" axis="0 1 0" armature="0.2" damping="3" frictionloss="2"
           actuatorfrcrange="-120 120"/>
      <body pos="0.4 0 0"><inertial pos="0.15 0 0.02" mass="2" diaginertia="0.01 0.03 0.03"/>
        <joint name="bend" axis="0 1 0" armature="0.1" damping="1" frictionloss="1"
             actuatorfrcrange="-60 60"/>
      </body></body></body></worldbody>
  <custom><numeric name="velocity_limit" data="4 4 4"/></custom></mujoco>
"""
WHEEL = """
<mujoco model="wheel"><worldbody><body><inertial pos="0 0 0" mass="1" diaginertia="1 1 0.4"/>
  <joint name="hinge" axis="0 0 1" armature="0.2" damping="1.5" frictionloss="2" actuatorfrcrange="-60 60"/>
</body></worldbody><custom><numeric name="velocity_limit" data="8"/></custom></mujoco>
"""
ROTOR, LINK, VISCOUS, COULOMB, SPEED_LIMIT = 0.2, 0.4, 1.5, 2.0, 8.0
RATE, STEP = 1000.0, 1e-4
MOTION = sample_reference(Sines((0.5, 0.3, 0.4), (1, 2, 3)), RATE)
OPTIONS = SimulationOptions(physics_timestep=2e-4)

# Parameters at which an effect does nothing, by the contract's meaning of each.
ZERO = {
    "stribeck_friction": {"extra": 0},
    "asymmetric_friction": {"offset": 0, "viscous_difference": 0},
    "nonlinear_viscous_friction": {"coefficient": 0},
    "load_dependent_friction": {"coefficient": 0},
    "presliding_hysteresis": {"stiffness": np.inf},
    "thermal_friction_drift": {"drop": 0},
    "joint_elasticity": {"stiffness": np.inf},
    "backlash": {"gap": 0},
    "transmission_ripple": {"amplitude": 0},
    "joint_coupling": {"viscous": 0, "coulomb": 0},
    "gravity_spring": {"stiffness": 0},
    "cable_spring": {"stiffness": 0},
    "torque_gain_error": {"relative": 0},
    "torque_delay": {"delay": 0},
    "actuator_lag": {"time_constant": 0},
    "torque_saturation": {"limit": np.inf},
    "encoder_offset": {"offset": 0},
    "encoder_eccentricity": {"amplitude": 0},
    "payload": {"mass": 0, "first_moment_x": 0, "first_moment_y": 0, "first_moment_z": 0},
    "base_tilt": {"roll": 0, "pitch": 0},
    "external_contact": {"torque": 0},
}


def robot_from(xml: str, folder: Path) -> Robot:
    path = folder / "robot.xml"
    path.write_text(xml)
    return load_robot(path)


@pytest.fixture(scope="module")
def arm(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    return robot_from(ARM, tmp_path_factory.mktemp("arm"))


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    return robot_from(WHEEL, tmp_path_factory.mktemp("wheel"))


def placed(robot: Robot, name: str, law: str | None = None, **values: float) -> Injection:
    """The effect on the second joint (and the third), or on the only one."""
    scope = effects()[name].DESCRIPTION.scope
    joint = None if scope is Scope.ROBOT else min(2, robot.joints)
    return injection(robot, name, joint, values, law, 3 if scope is Scope.PAIR else None)


def run(robot: Robot, *injections: Injection, step: float = 2e-4, motion: Reference = MOTION) -> Recording:
    return simulate(robot, [motion], SimulationOptions(physics_timestep=step, effects=injections), threads=1)[
        0
    ]


def pushed(robot: Robot, torque: np.ndarray, *injections: Injection, step: float = STEP) -> np.ndarray:
    """Loop output of an uncontrolled robot of one joint under a drive torque (N,) held for 1 ms each."""
    plant = plant_model(robot.model, step)
    hidden = put_in(injections, robot, plant, step, RATE)
    constants = np.zeros((layout.CONSTANTS, 1))
    constants[layout.VISCOUS], constants[layout.COULOMB] = VISCOUS, COULOMB
    constants[layout.TORQUE_LIMIT] = np.inf
    constants[layout.ARMATURE], constants[layout.SPLIT] = hidden.armature, hidden.split
    constants[layout.CONTACT_STIFFNESS], constants[layout.CONTACT_DAMPING] = hidden.stiffness, hidden.damping
    inputs = np.zeros((len(torque), layout.INPUTS, 1))
    inputs[:, layout.FEEDFORWARD, 0] = torque
    start = np.zeros(1)
    substeps = round(1 / (RATE * step))
    loop = batch.Loop(plant, substeps, RATE, 0.0, constants, inputs, start, start, hooks=hidden.hooks)
    return batch.run_loops([loop], 1)[0][:, :, 0]


def solved(
    derivative: Derivative, state: list[float], torque: np.ndarray, **options: str | float
) -> np.ndarray:
    """States (N, s) at the samples of an ODE under a held torque, by scipy."""
    found = [np.array(state)]
    for held in torque[:-1]:
        step = solve_ivp(
            lambda t, y, u=held: derivative(y, u), (0, 1 / RATE), found[-1], rtol=1e-8, atol=1e-10, **options
        )
        found.append(step.y[:, -1])
    return np.array(found)


TIME = np.arange(400) / RATE
SWING = 9 * np.sin(2 * np.pi * 5 * TIME) + 5 * np.sin(2 * np.pi * 2 * TIME)


# Zero size, combinations, provenance


@pytest.mark.parametrize("name", sorted(ZERO))
def test_an_effect_of_zero_size_changes_no_bit(arm: Robot, name: str) -> None:
    nothing, zero = run(arm), run(arm, placed(arm, name, **ZERO[name]))
    hidden = {"link_position", "effect_torque"}
    zero = replace(zero, truth={key: value for key, value in zero.truth.items() if key not in hidden})
    assert same(nothing, zero)


def test_every_effect_of_the_contract_is_in_the_catalogue() -> None:
    assert set(effects()) == set(ZERO)


def test_every_effect_and_law_changes_the_log(arm: Robot) -> None:
    nothing = run(arm)
    for name, effect in effects().items():
        values = {"start": 0.5, "duration": 0.5} if name == "external_contact" else {}
        values |= {"limit": 10.0} if name == "torque_saturation" else {}
        for law in effect.DESCRIPTION.laws:
            changed = run(arm, placed(arm, name, law, **values))
            assert np.abs(changed.torque - nothing.torque).max() > 1e-3, (name, law)


def test_effects_together_do_not_depend_on_threads_or_on_other_runs(arm: Robot) -> None:
    together = tuple(
        injection(arm, name, joint)
        for name in (
            "stribeck_friction",
            "joint_elasticity",
            "backlash",
            "transmission_ripple",
            "cable_spring",
        )
        for joint in (1, 2, 3)
    )
    hidden = replace(OPTIONS, effects=together, sensors=SensorOptions(torque_noise=0.01))
    streams = np.random.SeedSequence(5).spawn(3)
    both = simulate(arm, [MOTION] * 3, [hidden, OPTIONS, hidden], seed=streams, threads=2)
    alone = simulate(arm, [MOTION], hidden, seed=streams[:1], threads=1)
    assert same(both[0], alone[0])


def test_effects_are_told_in_the_truth_and_nowhere_else(arm: Robot, tmp_path: Path) -> None:
    recording = run(arm, placed(arm, "backlash", gap=0.002))
    write_log(recording, tmp_path / "log.h5")
    kept, told = read_log(tmp_path / "log.h5"), read_log(tmp_path / "log.h5", with_truth=True)
    assert told.truth_effects == [
        {"effect": "backlash", "joint": "lift", "into": None, "law": "dead_zone", "values": {"gap": 0.002}}
    ]
    assert not kept.truth_effects
    assert not kept.truth
    assert "backlash" not in str(kept.provenance)


# Laws in closed form, along the motion that came about


def along(recording: Recording, joint: int) -> tuple[np.ndarray, np.ndarray]:
    """Position and velocity of a joint where it moves, and which samples those are."""
    v = recording.truth["velocity"][:, joint]
    # Within a step of a reversal the set-valued friction takes any value up to its level.
    return np.abs(v) > 0.02, v


@pytest.mark.parametrize("law", ["exponential", "rational"])
def test_stribeck_friction_follows_its_curve(arm: Robot, law: str) -> None:
    recording = run(arm, placed(arm, "stribeck_friction", law, extra=1.2, velocity=0.2, exponent=1.5))
    moving, v = along(recording, 1)
    ratio = (np.abs(v) / 0.2) ** 1.5
    curve = np.exp(-ratio) if law == "exponential" else 1 / (1 + ratio)
    wanted = 3 * v + (2 + 1.2 * curve) * np.sign(v)
    np.testing.assert_allclose(recording.truth["friction_torque"][moving, 1], wanted[moving], atol=6e-3)


def test_asymmetric_friction_does_not_change_sign(arm: Robot) -> None:
    recording = run(arm, placed(arm, "asymmetric_friction", offset=-0.4, viscous_difference=0.5))
    moving, v = along(recording, 1)
    wanted = 3 * v + 2 * np.sign(v) - 0.4 + 0.5 * np.abs(v)
    np.testing.assert_allclose(recording.truth["friction_torque"][moving, 1], wanted[moving], atol=6e-3)


@pytest.mark.parametrize("law", ["power", "saturating"])
def test_nonlinear_viscous_friction_follows_its_power(arm: Robot, law: str) -> None:
    recording = run(arm, placed(arm, "nonlinear_viscous_friction", law, coefficient=1.5, exponent=0.5))
    moving, v = along(recording, 1)
    power = np.sqrt(np.abs(v))
    wanted = 3 * v + (2 + 1.5 * (np.log1p(power) if law == "saturating" else power)) * np.sign(v)
    np.testing.assert_allclose(recording.truth["friction_torque"][moving, 1], wanted[moving], atol=6e-3)


@pytest.mark.parametrize("law", ["symmetric", "driving"])
def test_load_friction_follows_the_torque_that_the_gearbox_carries(arm: Robot, law: str) -> None:
    recording = run(arm, placed(arm, "load_dependent_friction", law, coefficient=0.1))
    moving, v = along(recording, 1)
    truth = recording.truth
    load = truth["torque"][:, 1] - truth["friction_torque"][:, 1] - 0.2 * truth["acceleration"][:, 1]
    share = np.where((law == "driving") & (load * v < 0), 0.05, 0.1)
    wanted = 3 * v + (2 + share * np.abs(load)) * np.sign(v)
    # A held torque that jumps by some 0.1 N·m each period, seen before the jump.
    np.testing.assert_allclose(truth["friction_torque"][moving, 1], wanted[moving], atol=0.05)


@pytest.mark.parametrize("law", ["harmonic", "second_harmonic"])
def test_ripple_is_periodic_in_the_position(arm: Robot, law: str) -> None:
    recording = run(arm, placed(arm, "transmission_ripple", law, amplitude=1.5, cycles=20, phase=0.3))
    angle = 20 * recording.truth["position"][:, 1] + 0.3
    wanted = -1.5 * np.sin(angle) - (0.45 * np.sin(2 * angle) if law == "second_harmonic" else 0)
    np.testing.assert_allclose(recording.truth["effect_torque"][:, 1], wanted, atol=0.02)


def test_springs_pull_towards_their_rest(arm: Robot) -> None:
    balance = placed(arm, "gravity_spring", stiffness=8, phase=0.4)
    cable = placed(arm, "cable_spring", stiffness=2, rest=-0.3)
    recording = run(arm, balance, cable)
    q = recording.truth["link_position"][:, 1]
    wanted = 8 * np.sin(0.4 - q) - 2 * (q + 0.3)
    np.testing.assert_allclose(recording.truth["effect_torque"][:, 1], wanted, atol=2e-3)


@pytest.mark.parametrize("law", ["coulomb", "smooth"])
def test_coupling_loads_both_joints_with_their_summed_speed(arm: Robot, law: str) -> None:
    recording = run(arm, placed(arm, "joint_coupling", law, viscous=0.7, coulomb=1.1))
    speed = recording.truth["velocity"][:, 1] + recording.truth["velocity"][:, 2]
    # The shared bristle has slid through once the sum has gone 5 of its 0.5 mrad one way.
    moving = np.abs(speed) > 0.1
    wanted = -0.7 * speed - 1.1 * np.sign(speed)
    settled = moving & np.roll(moving, 50) & (np.sign(speed) == np.sign(np.roll(speed, 50)))
    torque = recording.truth["effect_torque"]
    np.testing.assert_allclose(torque[settled, 1], wanted[settled], atol=6e-3)
    np.testing.assert_array_equal(torque[:, 1], torque[:, 2])


# Laws with a state of their own, against scipy


def test_dahl_friction_is_the_solution_of_its_equation(wheel: Robot) -> None:
    stiffness = 400.0

    def dahl(y: np.ndarray, u: float) -> list[float]:
        _, v, z = y
        return [v, (u - VISCOUS * v - stiffness * z) / (ROTOR + LINK), v - stiffness * abs(v) * z / COULOMB]

    output = pushed(wheel, SWING, placed(wheel, "presliding_hysteresis", stiffness=stiffness))
    wanted = solved(dahl, [0, 0, 0], SWING)
    np.testing.assert_allclose(output[:, layout.VELOCITY], wanted[:, 1], atol=2e-3 * np.ptp(wanted[:, 1]))


def test_elastoplastic_bristles_give_all_back_below_breakaway(wheel: Robot) -> None:
    time = np.arange(8000) / RATE
    pulse = np.where(time < 0.1, 0.5 * COULOMB * np.sin(np.pi * time / 0.1) ** 2, 0.0)
    given = [
        pushed(wheel, pulse, placed(wheel, "presliding_hysteresis", law, stiffness=400))[-1, layout.POSITION]
        for law in ("elasto_plastic", "dahl")
    ]
    # What is left of the swing after 8 s decays as exp(-t viscous / 2 inertia).
    assert abs(given[0]) < 2e-3 * np.exp(-8 * VISCOUS / 2 / (ROTOR + LINK)) + 1e-9
    assert given[1] > 1e-4


def test_bristles_follow_the_level_that_stribeck_friction_sets(wheel: Robot) -> None:
    both = (
        placed(wheel, "stribeck_friction", extra=1.5, velocity=1.0, exponent=2),
        placed(wheel, "presliding_hysteresis", "lugre", stiffness=2000),
    )
    output = pushed(wheel, np.full(8000, 6.0), *both)
    speed = output[-1, layout.VELOCITY]
    assert VISCOUS * speed + COULOMB + 1.5 * np.exp(-(speed**2)) == pytest.approx(6.0, abs=1e-3)


def test_friction_falls_while_it_warms_the_joint(wheel: Robot) -> None:
    rated_speed = 0.3 * SPEED_LIMIT
    rated = (VISCOUS * rated_speed + COULOMB) * rated_speed

    def warming(y: np.ndarray, u: float) -> list[float]:
        v, w = y
        friction = VISCOUS * (1 - 0.5 * w) * v + COULOMB * np.sign(v) if v > 0 else u
        return [(u - friction) / (ROTOR + LINK), (friction * v / rated - w) / 0.4]

    torque = np.full(1500, 7.0)
    output = pushed(wheel, torque, placed(wheel, "thermal_friction_drift", drop=0.5, time_constant=0.4))
    wanted = solved(warming, [1e-9, 0], torque)
    np.testing.assert_allclose(output[:, layout.VELOCITY], wanted[:, 0], atol=2e-3 * wanted[:, 0].max())


def two_mass(stiffness: float, damping: float, half_gap: float = 0.0) -> Derivative:
    """Motor and link on scipy's terms; smooth friction on the motor, so that its solver can follow."""

    def derivative(y: np.ndarray, u: float) -> list[float]:
        qm, vm, ql, vl = y
        w = qm - ql
        wound = np.sign(w) * max(abs(w) - half_gap, 0.0)
        s = stiffness * wound + damping * (vm - vl) if wound or not half_gap else 0.0
        if half_gap and s * wound < 0:
            s = 0.0
        return [vm, (u - VISCOUS * vm - COULOMB * np.tanh(vm / 1e-4) - s) / ROTOR, vl, s / LINK]

    return derivative


def test_an_elastic_joint_is_the_two_mass_system(wheel: Robot) -> None:
    # A free mode of 20 Hz.
    stiffness = (2 * np.pi * 20) ** 2 * ROTOR * LINK / (ROTOR + LINK)
    output = pushed(wheel, SWING, placed(wheel, "joint_elasticity", stiffness=stiffness, damping=0.5))
    wanted = solved(two_mass(stiffness, 0.5), [0, 0, 0, 0], SWING, method="LSODA")
    for channel, state in ((layout.POSITION, 0), (layout.VELOCITY, 1), (layout.LINK_POSITION, 2)):
        scale = np.ptp(wanted[:, state])
        np.testing.assert_allclose(output[:, channel], wanted[:, state], atol=5e-3 * scale)


@pytest.mark.parametrize("frequency", [25.0, 2000.0])
def test_an_undamped_spring_neither_gains_nor_loses_energy(wheel: Robot, frequency: float) -> None:
    model = wheel.model
    # Without friction: what is left after a kick of torque swings for ever.
    stiffness = (2 * np.pi * frequency) ** 2 * ROTOR * LINK / (ROTOR + LINK)
    kick = np.where(TIME < 0.05, 5.0, 0.0)
    plant = plant_model(model, STEP)
    hidden = put_in(
        [placed(wheel, "joint_elasticity", stiffness=stiffness, damping=0)], wheel, plant, STEP, RATE
    )
    constants = np.zeros((layout.CONSTANTS, 1))
    constants[layout.TORQUE_LIMIT], constants[layout.ARMATURE], constants[layout.SPLIT] = np.inf, ROTOR, 1
    inputs = np.zeros((4000, layout.INPUTS, 1))
    inputs[: len(kick), layout.FEEDFORWARD, 0] = kick
    loop = batch.Loop(plant, 10, RATE, 0.0, constants, inputs, np.zeros(1), np.zeros(1), hooks=hidden.hooks)
    output = batch.run_loops([loop], 1)[0][:, :, 0]
    windup = output[:, layout.POSITION] - output[:, layout.LINK_POSITION]
    early, late = np.abs(windup[100:600]).max(), np.abs(windup[-500:]).max()
    assert late == pytest.approx(early, rel=0.03)
    # Momentum: a kick of 5 N·m for 50 ms.
    speed = np.diff(ROTOR * output[:, layout.POSITION] + LINK * output[:, layout.LINK_POSITION])[
        -1000:
    ].mean()
    assert speed * RATE == pytest.approx(5.0 * 0.05, rel=1e-3)


def test_backlash_is_the_two_mass_system_with_a_dead_zone(wheel: Robot) -> None:
    gap = 0.01
    output = pushed(wheel, SWING, placed(wheel, "backlash", gap=gap))
    omega = 2 * np.pi * 60
    contact = two_mass(omega**2 * ROTOR, 2 * 0.3 * omega * ROTOR, gap / 2)
    wanted = solved(contact, [0, 0, 0, 0], SWING, method="LSODA", max_step=1e-4)
    lag = output[:, layout.POSITION] - output[:, layout.LINK_POSITION]
    np.testing.assert_allclose(output[:, layout.POSITION], wanted[:, 0], atol=0.01 * np.ptp(wanted[:, 0]))
    assert np.sqrt(np.mean((lag - (wanted[:, 0] - wanted[:, 2])) ** 2)) < 0.05 * gap


def test_a_split_joint_starts_wound_up_by_what_it_carries(arm: Robot) -> None:
    soft = placed(arm, "joint_elasticity", stiffness=2000, damping=5)
    play = placed(arm, "backlash", gap=0.002)
    still = Reference(*[np.zeros((50, 3))] * 3)
    truth = run(arm, soft, play, motion=still).truth
    windup = truth["position"][:, 1] - truth["link_position"][:, 1]
    held = truth["torque"][0, 1]
    assert abs(held) > 10
    wound = held / 2000 + np.sign(held) * 0.001
    assert windup[0] == pytest.approx(wound, rel=1e-9)
    # The step softens the spring by h² K / 4 I, so it settles by as much.
    np.testing.assert_allclose(windup, wound, rtol=1e-2)


def test_the_encoder_sits_on_the_motor(arm: Robot) -> None:
    recording = run(arm, placed(arm, "joint_elasticity", stiffness=2000, damping=5))
    np.testing.assert_array_equal(recording.position, recording.truth["position"])
    assert np.abs(recording.truth["position"] - recording.truth["link_position"])[:, 1].max() > 1e-3


# Step halving, on the effect's own scale

HALVED = [
    (name, law)
    for name in sorted(set(ZERO) - {"payload", "external_contact", "torque_saturation"})
    for law in effects()[name].DESCRIPTION.laws
]


@pytest.mark.parametrize(("name", "law"), HALVED)
def test_half_the_step_changes_the_torque_by_little_of_the_effect(arm: Robot, name: str, law: str) -> None:
    # Two seconds are too short for the warming of a minute.
    values = {"time_constant": 1.0} if name == "thermal_friction_drift" else {}
    effect = placed(arm, name, law, **values)
    assert halving(arm, effect) < 0.05


def test_half_the_step_changes_a_two_mass_joint_of_20_hz_by_little(arm: Robot) -> None:
    link = arm.model.dof_M0[1] - arm.model.dof_armature[1]
    stiff = placed(arm, "joint_elasticity", stiffness=(2 * np.pi * 20) ** 2 * link)
    assert halving(arm, stiff) < 0.05


def halving(arm: Robot, effect: Injection) -> float:
    """RMS change of the torque with half the step, as a share of the effect's own size."""
    coarse, fine = run(arm, effect, step=2e-4), run(arm, effect, step=1e-4)
    size = np.sqrt(np.mean((coarse.torque - run(arm, step=2e-4).torque) ** 2))
    return float(np.sqrt(np.mean((coarse.torque - fine.torque) ** 2)) / size)


# Input


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("stribek:1", "stribeck_friction"),
        ("backlash", "joint"),
        ("backlash:4", "1 to 3"),
        ("backlash:elbow", "turn, lift, bend"),
        ("backlash:lift:play=0.1", "gap"),
        ("backlash:lift:gap=wide", "a number"),
        ("backlash:lift:gap=-1", "0 to 0.1 rad"),
        ("backlash:lift:gap", "key=value"),
        ("backlash:lift:law=soft", "soft_contact"),
        ("base_tilt:lift", "whole robot"),
        ("joint_coupling:lift", "another joint"),
        ("joint_coupling:lift:into=lift", "another joint"),
    ],
)
def test_a_wrong_effect_is_refused_in_one_line(arm: Robot, text: str, says: str) -> None:
    with pytest.raises(InputError) as caught:
        parse_injection(arm, text)
    assert says in str(caught.value)
    assert "\n" not in str(caught.value)


def test_an_effect_is_read_from_text(arm: Robot) -> None:
    found = parse_injection(arm, "joint_coupling:lift:into=bend,law=smooth,viscous=0.5")
    assert (found.effect, found.joint, found.into, found.law) == ("joint_coupling", 1, 2, "smooth")
    assert found.values["viscous"] == 0.5
    assert found.values["coulomb"] > 0


def test_a_joint_without_rotor_inertia_cannot_be_split(tmp_path: Path) -> None:
    bare = robot_from(WHEEL.replace('armature="0.2"', ""), tmp_path)
    still = Reference(*[np.zeros((50, 1))] * 3)
    with pytest.raises(InputError, match="armature"):
        run(bare, placed(bare, "backlash", gap=0.01), motion=still)
