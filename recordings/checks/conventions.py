"""Columns, signs, zeros, scales and gravity of a log that are not the model's, in words."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from testbench.findings import significant

from .convention import Convention, cycles, mistakes
from .convention_search import Candidate
from .finding import Finding, Severity
from .subject import Subject

STAGE = 2

# A convention is certain by so much of the posterior odds' logarithm, where the model explains what it
# concerns to this share of torque, RMS, with parameters so many widths off, a joint; it is suspected by as
# much without these.
ODDS, LEFT, BENT = 15.0, 0.35, 2.2
# Another unit is said by less: it takes three joints alike, or one that is far off.
UNIT_ODDS = 4.0
# rad: an encoder's zero may be off by less, which the diagnosis has an effect for.
ZERO = np.deg2rad(4.0)
# rad: a zero this near to a quarter turn is likely to be one, as joints are counted from other poses.
NEAR_A_QUARTER = np.deg2rad(6.0)
# No drive's constant, and no model's mass, is off by more.
FACTOR = 3.0
# Of its drive's limit: no torque is more, RMS.
BEYOND = 5.0
# A factor that is nearer to one is a gain, or the model's own error.
LEAST_FACTOR = 1.25
# Gravity, m/s², that is less is none; a share of the model's.
NO_GRAVITY = 0.25
# Torques that are this many times the model's, in what unit or way.
UNITS = {
    1000.0: "N·mm",
    100.0: "N·cm",
    0.001: "kN·m",
    10.2: "kgf·cm",
    0.102: "kgf·m",
    8.85: "lbf·in",
    141.6: "ozf·in",
}
NEAR_A_UNIT = 1.25

SIGN_EXPECTED = "the sign that turns a joint the way its position grows"
ORDER_EXPECTED = "positions and torques in the order of joint_names"
ZERO_EXPECTED = "positions from the model's zeros"
SCALE_EXPECTED = "torque in N·m (N) at the joint"


def check(subject: Subject) -> list[Finding]:
    """How the log counts otherwise than the model, certain or suspected; torques that no drive gives."""
    found = _by_model(subject)
    return found if any(each.code == "torque_scale" for each in found) else [*found, *_beyond_drives(subject)]


def _beyond_drives(subject: Subject) -> list[Finding]:
    """Joints whose torque is more than their drives give, where the model says nothing of it."""
    torque = np.concatenate([each.torque for each in subject.recordings.values()])
    limit = subject.robot.limits.torque
    times = np.sqrt(np.mean(torque**2, axis=0)) / np.where(limit > 0, limit, np.inf)
    joints = np.flatnonzero(times > BEYOND).tolist()
    if not joints:
        return []
    each = ", ".join(f"{subject.robot.joint_names[j]} is {significant(float(times[j]), 2)}" for j in joints)
    sentence = f"that of {each} times what its drive can, RMS: another unit?"
    names = subject.names(joints)
    return [Finding(Severity.STOP, "torque_scale", sentence, names, "", "joint/torque", SCALE_EXPECTED)]


def _by_model(subject: Subject) -> list[Finding]:
    """How the log counts otherwise than the model, by the search over conventions."""
    if subject.searched is None:
        return []
    first, best = subject.searched
    is_unit = any(factor != 1 for factor in best.convention.scale)
    least = UNIT_ODDS if is_unit else ODDS
    if best.convention == first.convention or best.score - first.score < least:
        return []
    is_certain = _is_certain(first, best)
    found = in_words(subject, best)
    if is_certain:
        return found
    return [_suspected(each, best) for each in found]


def _is_certain(first: Candidate, best: Candidate) -> bool:
    """Whether the model explains all that the convention changes, and need not be bent for it."""
    before, after = (np.nan_to_num(each.explained.left) for each in (first, best))
    convention = best.convention
    n = len(before)
    order = np.arange(n)
    concerned = (np.array(convention.position_order) != order) | (np.array(convention.torque_order) != order)
    concerned |= (np.array(convention.position_sign) < 0) | (np.array(convention.torque_sign) < 0)
    better = after < before / 2
    concerned |= (np.array(convention.zero) != 0) | (np.array(convention.scale) != 1) | better
    # Gravity acts on every joint: what one of several alone says of it may be that joint's own.
    if convention.gravity is not None and np.count_nonzero(better) < min(2, n):
        return False
    return bool(np.all(after[concerned] < LEFT) and best.explained.bent < BENT)


def _suspected(finding: Finding, best: Candidate) -> Finding:
    left = float(np.sqrt(np.nanmean(best.explained.left**2)))
    sentence = f"suspected, since {left:.0%} of the torque is left even so: {finding.sentence}"
    is_scale = finding.code == "torque_scale"
    return replace(
        finding,
        severity=Severity.WARN,
        sentence=sentence,
        expected="",
        bars_names=not is_scale,
        # A factor that a drive's constant may be off by is an effect, and may have its name.
        bars_joints=is_scale and finding.severity is Severity.STOP,
    )


def in_words(subject: Subject, best: Candidate) -> list[Finding]:
    """A convention's mistakes as findings, one each."""
    convention = best.convention
    found = [
        *_order(subject, convention),
        *_signs(subject, convention),
        *_zeros(subject, convention),
        *_scales(subject, convention, np.isfinite(best.explained.left)),
        *_gravity(subject, convention),
    ]
    assert found or not mistakes(convention) or all(abs(each) < ZERO for each in convention.zero)
    return found


def _order(subject: Subject, convention: Convention) -> list[Finding]:
    position, torque = convention.position_order, convention.torque_order
    if position == torque:
        kinds = [("joint_order", "joint_names", "positions and torques", position)]
    else:
        kinds = [
            ("position_order", "joint/position", "positions", position),
            ("torque_order", "joint/torque", "torques", torque),
        ]
    found = []
    for code, field, what, order in kinds:
        moved = [joint for joint, column in enumerate(order) if joint != column]
        if not moved:
            continue
        names = subject.robot.joint_names
        pairs = ", ".join(f"{names[joint]}'s in the column of {names[order[joint]]}" for joint in moved)
        kind = "exchanged" if all(len(cycle) == 2 for cycle in cycles(order)) else "in another order"
        sentence = f"{what} {kind}: {pairs}"
        found.append(Finding(Severity.STOP, code, sentence, subject.names(moved), "", field, ORDER_EXPECTED))
    return found


def _signs(subject: Subject, convention: Convention) -> list[Finding]:
    kinds: dict[str, list[int]] = {"axis": [], "torque": [], "position": []}
    for joint, signs in enumerate(zip(convention.position_sign, convention.torque_sign, strict=True)):
        if signs == (-1, -1):
            kinds["axis"].append(joint)
        elif signs == (1, -1):
            kinds["torque"].append(joint)
        elif signs == (-1, 1):
            kinds["position"].append(joint)
    found = []
    for kind, joints in kinds.items():
        if not joints:
            continue
        names = ", ".join(subject.names(joints))
        sentence, code, field = {
            "axis": (
                f"the opposite at {names}, of position and torque: it turns the other way than in the model",
                "axis_turned",
                "joint/position",
            ),
            "torque": (f"the opposite at {names}", "torque_sign", "joint/torque"),
            "position": (f"the opposite at {names}, of its position", "position_sign", "joint/position"),
        }[kind]
        found.append(Finding(Severity.STOP, code, sentence, subject.names(joints), "", field, SIGN_EXPECTED))
    return found


def _zeros(subject: Subject, convention: Convention) -> list[Finding]:
    off = [(joint, float(angle)) for joint, angle in enumerate(convention.zero) if abs(angle) > ZERO]
    found = []
    for joint, angle in off:
        # What is taken off a position that counts backwards is what the log reads less.
        reads = convention.position_sign[joint] * angle
        reads = (reads + np.pi) % (2 * np.pi) - np.pi
        (name,) = subject.names([joint])
        quarters = round(reads / (np.pi / 2))
        near = abs(reads - quarters * np.pi / 2) < NEAR_A_QUARTER and quarters
        hint = f", or counted from {90 * quarters}° of it" if near else ""
        sentence = (
            f"{name} {np.rad2deg(reads):.3g}° from where the model has it: is its zero the model's{hint}?"
        )
        found.append(
            Finding(Severity.STOP, "zero_off", sentence, (name,), "", "joint/position", ZERO_EXPECTED)
        )
    return found


def _scales(subject: Subject, convention: Convention, counts: NDArray[np.bool_]) -> list[Finding]:
    """Scales, of the joints that move enough to count (n,)."""
    factors = {
        joint: factor
        for joint, factor in enumerate(convention.scale)
        if counts[joint] and not 1 / LEAST_FACTOR < factor < LEAST_FACTOR
    }
    if not factors:
        return []
    names = subject.robot.joint_names
    different = set(factors.values())
    if len(factors) == len(names) and len(different) == 1:
        (factor,) = different
        whose = f"that of every joint is {significant(factor, 2)} times the model's"
    else:
        each = ", ".join(
            f"{', '.join(names[joint] for joint in factors if factors[joint] == factor)} is "
            f"{significant(factor, 2)}"
            for factor in dict.fromkeys(factors.values())
        )
        whose = f"that of {each} times the model's"
    hints = {unit for factor in different for unit in [_unit(factor)] if unit}
    if len(hints) == 1 and len(different) == 1:
        asks = f"is it {hints.pop()}?"
    elif len(different) > 1:
        asks = "is it motor current, or torque on the motor's side of the gearbox?"
    else:
        asks = "another unit, the motor's side of a gearbox, or motor current?"
    is_far = any(not 1 / FACTOR < factor < FACTOR for factor in factors.values())
    severity = Severity.STOP if is_far else Severity.WARN
    if not is_far:
        asks = f"{asks} A drive's constant or the model's masses may be off, or a spring carries the arm"
    return [
        Finding(
            severity,
            "torque_scale",
            f"{whose}: {asks}",
            subject.names(list(factors)),
            "",
            "joint/torque",
            SCALE_EXPECTED,
        )
    ]


def _unit(factor: float) -> str:
    near = [unit for known, unit in UNITS.items() if 1 / NEAR_A_UNIT < factor / known < NEAR_A_UNIT]
    return near[0] if near else ""


def _gravity(subject: Subject, convention: Convention) -> list[Finding]:
    if convention.gravity is None:
        return []
    felt, modelled = np.array(convention.gravity), subject.robot.chain.gravity
    if np.linalg.norm(felt) < NO_GRAVITY * np.linalg.norm(modelled):
        sentence = (
            "The logged torque has no gravity in it, and the model has: it was logged after gravity "
            "compensation, or the arm is balanced by counterweights or springs that the model lacks"
        )
        return [Finding(Severity.WARN, "no_gravity", sentence, (), "", "joint/torque", bars_names=True)]
    # Not -0.0.
    down = ", ".join(f"{value:.1f}" for value in np.round(felt, 1) + 0.0)
    sentence = f"gravity as ({down}) m/s² by the torque: is the arm mounted so, and the model not?"
    return [Finding(Severity.STOP, "mounting", sentence, (), "", "joint/torque", "gravity as in the model")]
