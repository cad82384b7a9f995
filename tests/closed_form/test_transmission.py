"""Signatures of transmission and springs, against laws written here in closed form."""

from dataclasses import replace

import numpy as np
import pytest

from identification.inverse_dynamics import inverse_dynamics
from testbench.effects import effects
from testbench.effects.link_motion import typical_link_inertia
from testbench.effects.signature import Logged
from testbench.effects.transmission_ripple import periodogram_peaks
from testbench.robot import Robot

from ..closed_form_arm import (
    DDQ,
    DQ,
    FINE,
    FINE_STEP,
    FINENESS,
    TIME,
    J,
    K,
    Q,
    link_side,
    on_joint,
    single,
    unexplained,
)


def elastic_torque(arm: Robot, stiffness: float, damping: float) -> np.ndarray:
    """Change of motor torque (N, 3) by a spring at joint J behind the motor's motion Q.

    The motor leads the link by w; semi-implicit Euler for w, full dynamics of the displaced link.
    """
    links, load, inertia = link_side(arm, J)
    w, dw, path = load[0] / stiffness, 0.0, []
    fine = (np.interp(FINE, TIME, load).tolist(), np.interp(FINE, TIME, inertia).tolist())
    for wanted, own in zip(*fine, strict=True):
        ddw = (wanted - stiffness * w - damping * dw) / own
        dw += FINE_STEP * ddw
        w += FINE_STEP * dw
        path.append((w, dw, ddw))
    moved = np.array(path)[::FINENESS, :, None] * np.eye(3)[J]
    displaced = inverse_dynamics(arm.chain, links, Q - moved[:, 0], DQ - moved[:, 1], DDQ - moved[:, 2])
    return displaced - inverse_dynamics(arm.chain, links, Q, DQ, DDQ)


# 8 Hz is midway between two of those that are tried first, each of which explains less of it.
@pytest.mark.parametrize(
    ("frequency", "most_left"), [(6, 0.1), (8, 0.2), (10, 0.1), (12, 0.1), (16, 0.1), (20, 0.1)]
)
def test_elasticity_is_explained(
    arm: Robot, base: np.ndarray, logged: Logged, frequency: float, most_left: float
) -> None:
    inertia = 0.9  # about what joint J carries
    stiffness = (2 * np.pi * frequency) ** 2 * inertia
    torque = elastic_torque(arm, stiffness, 4.0)
    family = effects()["joint_elasticity"].signature([logged], J, None)
    assert unexplained(base, torque, family)[0] < most_left
    ratio = 4.0 / (2 * np.sqrt(stiffness * typical_link_inertia(logged, J)))
    # Neither a stiffness 5 % off nor another damping explains as much as those that acted.
    springs = [
        single(family, stiffness=k * stiffness, damping_ratio=d * ratio / np.sqrt(k)).members[0]
        for k, d in ((1.0, 1.0), (0.95, 1.0), (1.05, 1.0), (1.0, 0.7), (1.0, 1.4))
    ]
    left, found = unexplained(base, torque, replace(family, members=tuple(springs)))
    assert left < 0.02
    assert found["stiffness"] == pytest.approx(stiffness, rel=0.01)
    assert found["damping"] == pytest.approx(4.0, rel=0.01)


def test_a_link_without_inertia_keeps_its_columns_finite(logged: Logged) -> None:
    negative = logged.parameters.reshape(3, 14).copy()
    negative[:, :10] *= -1
    odd = replace(logged, parameters=negative.ravel())
    for name in ("joint_elasticity", "backlash"):
        for member in effects()[name].signature([odd], J, None).members:
            assert np.isfinite(member.columns[0]).all()


def test_backlash_is_explained(arm: Robot, base: np.ndarray, logged: Logged) -> None:
    # Joint 0 turns about the vertical: its load changes sign with the acceleration, and it has no gravity.
    gap, joint = 0.003, 0
    links, load, inertia = link_side(arm, joint)
    contact = (2 * np.pi * 60) ** 2 * 0.3
    damping = 2 * 0.3 * 2 * np.pi * 60 * 0.3

    # The motor leads the link by x; semi-implicit Euler in steps far below the contact's period.
    x, dx, path = gap / 2, 0.0, []
    fine = (np.interp(FINE, TIME, load).tolist(), np.interp(FINE, TIME, inertia).tolist())
    for wanted, own in zip(*fine, strict=True):
        deep = np.sign(x) * max(abs(x) - gap / 2, 0.0)
        s = contact * deep + damping * dx if deep else 0.0
        s = 0.0 if s * deep < 0 else s
        ddx = (wanted - s) / own
        dx += FINE_STEP * ddx
        x += FINE_STEP * dx
        path.append((x, dx, ddx))
    # The mean over a sample, as an impact is shorter.
    means = [
        np.convolve(each, np.full(FINENESS, 1 / FINENESS), mode="same") for each in zip(*path, strict=True)
    ]
    moved = np.array(means).T[::FINENESS, :, None] * np.eye(3)[joint]
    displaced = inverse_dynamics(arm.chain, links, Q - moved[:, 0], DQ - moved[:, 1], DDQ - moved[:, 2])
    torque = displaced - inverse_dynamics(arm.chain, links, Q, DQ, DDQ)
    family = effects()["backlash"].signature([logged], joint, None)
    left, found = unexplained(base, torque, family)
    assert left < 0.3
    assert found["gap"] == pytest.approx(gap, rel=0.5)


def test_a_link_that_never_leaves_its_wall_shows_no_backlash(logged: Logged) -> None:
    # Gravity holds joint J against one end all the time.
    still = replace(logged, q=0 * Q + 0.1, dq=0 * Q, ddq=0 * Q)
    for member in effects()["backlash"].signature([still], J, None).members:
        assert not member.columns[0].any()


@pytest.mark.parametrize("cycles", [23.7, 320.4])
def test_ripple_is_found_in_the_residual_and_explained(
    cycles: float, arm: Robot, base: np.ndarray, logged: Logged
) -> None:
    ripple = on_joint(0.8 * np.sin(cycles * Q[:, J] + 0.6))
    family = effects()["transmission_ripple"].signature([replace(logged, tau=logged.tau + ripple)], J, None)
    assert family.member is not None
    near = min((m.shape["cycles"] for m in family.members), key=lambda found: abs(found - cycles))
    _, spacing = periodogram_peaks([logged], J)
    assert near == pytest.approx(cycles, abs=spacing)
    refined = replace(family, members=(*family.members, family.member({"cycles": cycles})))
    assert unexplained(base, ripple, family)[0] < 0.3
    left, found = unexplained(base, ripple, refined)
    assert left < 1e-9
    assert found["amplitude"] == pytest.approx(0.8)
    assert found["phase"] == pytest.approx(0.6)


def test_coupling_is_explained(arm: Robot, base: np.ndarray, logged: Logged) -> None:
    speed = DQ[:, J] + DQ[:, K]
    # Which way the shaft was turned since the sample before; at the first it is relaxed.
    turned = np.sign(np.convolve(speed, [1, 1])[: len(speed)]) * (np.arange(len(speed)) > 0)
    shared = 0.6 * speed + 1.1 * turned
    family = effects()["joint_coupling"].signature([logged], J, K)
    # The stiffer the shared shaft, the nearer is its friction to the sign.
    stiff = single(family, twist=1e-9)
    left, found = unexplained(base, on_joint(shared, J) + on_joint(shared, K), stiff)
    assert left < 1e-9
    assert (found["viscous"], found["coulomb"]) == pytest.approx((0.6, 1.1))


def test_springs_are_explained(arm: Robot, base: np.ndarray, logged: Logged) -> None:
    # At the first joint, where no gravity hides a sine.
    q = Q[:, 0]
    left, found = unexplained(
        base, on_joint(-5 * np.sin(0.7 - q), 0), effects()["gravity_spring"].signature([logged], 0, None)
    )
    assert left < 1e-9
    assert (found["stiffness"], found["phase"]) == pytest.approx((5, 0.7))
    gas = -4 * 0.5 * np.sin(0.7 - q) / np.sqrt(1.25 - np.cos(0.7 - q))
    springs = effects()["gravity_spring"].signature([logged], 0, None)
    left, found = unexplained(base, on_joint(gas, 0), single(springs, phase=0.7))
    assert left < 1e-9
    assert (found["stiffness"], found["phase"]) == pytest.approx((4, 0.7))
    left, found = unexplained(
        base, on_joint(3 * (q + 0.2), 0), effects()["cable_spring"].signature([logged], 0, None)
    )
    assert left < 1e-9
    assert (found["stiffness"], found["rest"]) == pytest.approx((3, -0.2))
    pulled, cable = q + 0.2, effects()["cable_spring"].signature([logged], 0, None)
    hose = single(cable, rest=-0.2, doubling=0.4)
    left, found = unexplained(base, on_joint(3 * pulled * (1 + (pulled / 0.4) ** 2), 0), hose)
    assert left < 1e-9
    assert (found["stiffness"], found["rest"]) == pytest.approx((3, -0.2))
