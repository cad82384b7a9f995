"""The diagnosis of position servos: limbs re-identified, searched for effects, judged by held-out halves."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.output_error.fit import Fit, fit
from identification.output_error.plant import WIDTH, Limb, limbs
from identification.output_error.servo_run import ServoRun
from identification.output_error.start import regression_start
from testbench.drives.effects import drive_effects
from testbench.drives.identified import IdentifiedDrives, consistent, given_table, knowledge, simulated
from testbench.drives.stated import LONGEST_DELAY, Servo
from testbench.effects.signature import Quantity
from testbench.robot import Robot

from ..decision.probability import held_by
from ..decision.verdict import PARAMETERS_SHARE
from .contest import ACCEPTED, Contest, Round
from .evidence import Weighed
from .findings import Experiment, ServoCandidate, ServoDiagnosis, ServoFault, ServoShare
from .healthy import healthy_unknowns
from .held_out import held_out_errors, judged, limb_of_own
from .sizes import Sizes, sizes_of

Array = NDArray[np.float64]

# An effect that is likelier than this may be in the stated one's place, or is not ruled out.
CONFUSABLE = 0.03
# Of a joint's RMS speed: slower is near rest, faster is fast.
NEAR_REST, FAST = 0.2, 1.5
# A regime is said where the squared error is so many times as dense there.
DENSE = 1.5


@dataclass(frozen=True)
class _OfLimb:
    """Findings at a limb. stated: rounds whose effect is stated. errors: given, parameters, effects."""

    limb: Limb
    base: Fit
    final: Fit
    rounds: tuple[Round, ...]
    stated: tuple[Weighed, ...]
    errors: tuple[Array, Array, Array]
    sizes: Sizes
    notes: tuple[str, ...]


def diagnose_servos(
    robot: Robot,
    servos: Sequence[Servo],
    runs: Sequence[ServoRun],
    without: Sequence[str] = (),
    threads: int | None = None,
) -> ServoDiagnosis:
    """Why the simulated position of these runs is not the measured one.

    servos: as stated of each run; their spreads are those of a robot in order. without: effects that are not
    looked for.
    """
    servo = servos[0]
    given = given_table(robot, servo)
    parts = limbs(robot.chain)
    found = [_of_limb(robot, limb, servo, given, runs, without, threads) for limb in parts]
    identified = given.copy()
    for each in found:
        identified[each.limb.joints] = consistent(each.final.table)
    fits = tuple(each.final for each in found)
    drives = IdentifiedDrives(robot, servo, given, identified, parts, fits, fits)
    errors = np.zeros((4, robot.joints))
    for each in found:
        errors[:, each.limb.joints] = [*each.errors, each.sizes.noise]
    most = held_by(len(runs))
    stated = (fault for each in found for fault in _faults(each, most))
    faults = sorted(stated, key=lambda each: -each.probability)
    candidates = sorted(
        (candidate for each in found for candidate in _candidates(each, most)),
        key=lambda each: (-each.probability, -each.score),
    )
    verdict = _verdict(found, faults, errors)
    return ServoDiagnosis(
        found=drives,
        runs=tuple(run.name for run in runs),
        verdict=verdict,
        effects=tuple(faults),
        candidates=tuple(candidates),
        where=_where(robot, found, runs, errors),
        given=errors[0],
        parameters=errors[1],
        corrected=errors[2],
        noise=errors[3],
        unknown=max(each.rounds[-1].verdicts.unknown for each in found),
        experiment=_experiment(verdict, faults, candidates),
        notes=tuple(note for each in found for note in each.notes),
    )


def _of_limb(
    robot: Robot,
    limb: Limb,
    servo: Servo,
    given: Array,
    runs: Sequence[ServoRun],
    without: Sequence[str],
    threads: int | None,
) -> _OfLimb:
    own = [run.of(limb.joints) for run in runs]
    known = knowledge(robot, limb, servo, own, ())
    table = given[limb.joints]
    is_stated = bool(np.any(servo.delay_upper - servo.delay_lower != LONGEST_DELAY))
    rate = min(run.rate for run in own)
    unknown = healthy_unknowns(limb.chain, table, known, rate, is_stated)
    base = fit(limb.chain, unknown, own, regression_start(limb.chain, unknown, own), threads)
    sizes = sizes_of(own, known, servo.limit[limb.joints])
    rounds = Contest(limb, own, sizes, without, threads).rounds(base)
    stated = [each.verdicts.faults[0] for each in rounds[:-1]]
    final = rounds[-1].base.fit
    hypotheses = [base, final] if stated else [base]
    errors = held_out_errors(limb, table, hypotheses, own, threads)
    stated, kept, notes = judged(limb, stated, errors, sizes)
    if not kept:
        final, errors[-1] = base, errors[1]
    three = errors[0], errors[1], errors[-1]
    return _OfLimb(limb, base, final, tuple(rounds), tuple(stated), three, sizes, tuple(notes))


def _faults(found: _OfLimb, most: float) -> list[ServoFault]:
    """The effects that are stated at a limb. most: the largest probability that the runs can give."""
    names, out = found.limb.chain.joint_names, []
    for each in found.stated:
        of_round = next(one for one in found.rounds if each in one.verdicts.faults)
        place, own = each.place, each.place.joints(len(names))
        others = [
            other.place.effect.name
            for other in of_round.verdicts.faults[1:]
            if other.probability >= CONFUSABLE
        ]
        before, after = (float(np.sum(found.errors[stage][own] ** 2)) for stage in (1, 2))
        out.append(
            ServoFault(
                effect=place.effect.name,
                joint=None if place.joint is None else names[place.joint],
                joints=tuple(names[joint] for joint in own),
                law=place.law.name or place.effect.law,
                probability=most * each.probability,
                parameters=_parameters(found, each, own[0]),
                confusable_with=tuple(dict.fromkeys(name for name in others if name != place.effect.name)),
                held_out_share=1 - after / before if before > 0 else 0.0,
            )
        )
    return out


def _parameters(found: _OfLimb, each: Weighed, joint: int) -> dict[str, Quantity]:
    """The entry of the plant's table that the effect moves, in the last of the fits."""
    effect, fitted = each.place.effect, found.final
    column = effect.moves[0][0]
    value = float(fitted.table[joint, column])
    weights = fitted.unknowns.basis.reshape(fitted.unknowns.count, -1, WIDTH)[:, joint, column]
    std = max(float(weights @ fitted.covariance @ weights), 0.0) ** 0.5
    if not effect.smooth:
        std = each.fitted.size_std * float(found.sizes.scales[effect.scale][joint])
    if effect.inverse:
        value, std = 1 / value, std / value**2
    return {effect.parameter: Quantity(value, std, effect.unit)}


def _candidates(found: _OfLimb, most: float) -> list[ServoCandidate]:
    """The effects that were weighed and are not stated, with the reason. most: as of ``_faults``."""
    names, out = found.limb.chain.joint_names, []
    for of_round in found.rounds:
        for each in of_round.verdicts.faults:
            if each in found.stated:
                continue
            place = each.place
            joint = None if place.joint is None else names[place.joint]
            reason = "in the corrected model, but not stated: see the notes"
            if each.probability < CONFUSABLE:
                reason = "explains the runs less well"
            elif each.probability < ACCEPTED:
                reason = f"likelier than not only from {ACCEPTED:.0%}: these runs do not decide"
            out.append(
                ServoCandidate(place.effect.name, joint, most * each.probability, each.log_factor, reason)
            )
    return out


def _verdict(found: Sequence[_OfLimb], faults: Sequence[ServoFault], errors: Array) -> str:
    if faults:
        return "effect"
    if any(each.rounds[-1].verdicts.in_order < 0.5 or each.notes for each in found):
        return "unknown"
    as_good = errors[0] <= (1 + PARAMETERS_SHARE) * np.maximum(errors[1], errors[3])
    return "none" if np.all(as_good) else "parameters"


def _where(
    robot: Robot, found: Sequence[_OfLimb], runs: Sequence[ServoRun], errors: Array
) -> tuple[ServoShare, ...]:
    """Joints by their share of the squared position error that re-identification leaves, most first."""
    total = float(np.sum(errors[1] ** 2))
    out = []
    for each in found:
        limb, whole = each.limb, limb_of_own(each.limb)
        squares, speeds = [], []
        for run in runs:
            own = run.of(limb.joints)
            squares.append((simulated([whole], each.base.table, own).position - own.position) ** 2)
            speeds.append(np.abs(own.smoothed[1]))
        square, speed = np.concatenate(squares), np.concatenate(speeds)
        for place, joint in enumerate(limb.joints):
            share = float(errors[1, joint] ** 2 / total) if total > 0 else 0.0
            regime = _regime(square[:, place], speed[:, place])
            left, noise = float(errors[1, joint]), float(errors[3, joint])
            out.append(ServoShare(robot.joint_names[joint], share, regime, left, noise))
    return tuple(sorted(out, key=lambda each: -each.share))


def _regime(square: Array, speed: Array) -> str:
    """Where squared errors (N,) are dense by the joint's speed (N,)."""
    typical = float(np.sqrt(np.mean(speed**2)))
    regimes = {"near rest and reversals": speed < NEAR_REST * typical, "fast motion": speed > FAST * typical}
    density = {
        name: float(np.mean(square[inside]) / (np.mean(square) + 1e-300)) if np.any(inside) else 0.0
        for name, inside in regimes.items()
    }
    name = max(density, key=lambda each: density[each])
    return name if density[name] >= DENSE else "the whole motion"


def _experiment(
    verdict: str, faults: Sequence[ServoFault], candidates: Sequence[ServoCandidate]
) -> Experiment | None:
    """The motion that separates the stated effect from those like it, or the likeliest candidates."""
    effects = drive_effects()
    open_fault = next((each for each in faults if each.confusable_with), None)
    if open_fault is not None:
        names = (open_fault.effect, *open_fault.confusable_with)
    elif verdict == "unknown" and candidates:
        names = tuple(dict.fromkeys(each.effect for each in candidates[:2]))
    else:
        return None
    ways = dict.fromkeys(effects[name].experiment for name in names)
    titles = " from ".join(effects[name].title.lower() for name in names[:2])
    return Experiment(f"To distinguish {titles}: record {'; and '.join(ways)}.", names)
