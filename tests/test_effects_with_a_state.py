"""Effects in the simulated robot whose laws have a state of their own, against ODEs solved by scipy."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from testbench.effects.base import Injection
from testbench.robot import Robot
from testbench.simulation import Reference, batch, layout
from testbench.simulation.plant import plant_model
from testbench.simulation.unmodelled import put_in

from .simulated_arm import robot_from
from .simulated_effects import ARM, RATE, WHEEL, placed, run

# Of a state under a torque.
Derivative = Callable[[np.ndarray, float], list[float]]
ROTOR, LINK, VISCOUS, COULOMB, SPEED_LIMIT = 0.2, 0.4, 1.5, 2.0, 8.0
STEP = 1e-4
TIME = np.arange(400) / RATE
SWING = 9 * np.sin(2 * np.pi * 5 * TIME) + 5 * np.sin(2 * np.pi * 2 * TIME)


@pytest.fixture(scope="module")
def arm(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    return robot_from(ARM, tmp_path_factory.mktemp("arm"))


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    return robot_from(WHEEL, tmp_path_factory.mktemp("wheel"))


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


@pytest.mark.parametrize("exponent", [0.5, 1.0, 2.0])
def test_dahl_friction_is_the_solution_of_its_equation(wheel: Robot, exponent: float) -> None:
    stiffness = 400.0

    def dahl(y: np.ndarray, u: float) -> list[float]:
        _, v, z = y
        left = max(1 - np.sign(v) * stiffness * z / COULOMB, 0.0)
        return [v, (u - VISCOUS * v - stiffness * z) / (ROTOR + LINK), v * left**exponent]

    law: dict[str, Any] = {} if exponent == 1.0 else {"exponent": exponent, "law": "dahl_exponent"}
    output = pushed(wheel, SWING, placed(wheel, "presliding_hysteresis", stiffness=stiffness, **law))
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
