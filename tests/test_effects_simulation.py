"""Effects in the simulated robot: at zero size, together, at half the step, and how they are asked for."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from identification.errors import InputError
from testbench.effects import effects, injection, parse_injection
from testbench.effects.base import Injection
from testbench.log import read_log, write_log
from testbench.robot import Robot
from testbench.simulation import Reference, SensorOptions, SimulationOptions, simulate

from .simulated_arm import robot_from, same
from .simulated_effects import ARM, MOTION, WHEEL, placed, run

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


@pytest.fixture(scope="module")
def arm(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    return robot_from(ARM, tmp_path_factory.mktemp("arm"))


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


def test_effects_are_reported_in_the_truth_and_nowhere_else(arm: Robot, tmp_path: Path) -> None:
    recording = run(arm, placed(arm, "backlash", gap=0.002))
    write_log(recording, tmp_path / "log.h5")
    kept, with_truth = read_log(tmp_path / "log.h5"), read_log(tmp_path / "log.h5", with_truth=True)
    assert with_truth.truth_effects == [
        {"effect": "backlash", "joint": "lift", "into": None, "law": "dead_zone", "values": {"gap": 0.002}}
    ]
    assert not kept.truth_effects
    assert not kept.truth
    assert "backlash" not in str(kept.provenance)


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
        ("torque_delay:elbow", "turn, lift, bend"),
        ("torque_delay:lift:into=turn", "no pair"),
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
