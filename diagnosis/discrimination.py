"""The next experiment: the motion along which effects that these runs cannot tell apart differ most.

T-optimality (Atkinson & Fedorov 1975, "The design of experiments for discriminating between two
rival models"): with the torque eta_i that hypothesis i adds, as large as these runs make it, the
separation of i from its rival j is what no choice of the rival's coefficients and of the base
parameters can imitate,

    T_ij = min over c, theta of |W^(1/2) (eta_i - Z_j c - Y theta)|²,

in units of the noise. The motion maximises the smallest T_ij over all ordered pairs, within the limits.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from identification.base_parameters import base_parameters
from identification.errors import InputError
from identification.excitation.criteria import criterion_values
from identification.excitation.excitation import DesignOptions, Excitation
from identification.excitation.limits import limit_margins, require_usable, share_of
from identification.excitation.problem import weighted_regressor
from identification.excitation.random_motion import FeasibleMotions, resting_centres
from identification.excitation.trajectories import trajectory_basis
from identification.excitation.trajectory import Trajectory
from identification.filtering import decimation_step, edge_samples, zero_phase_lowpass
from identification.inverse_dynamics import inverse_dynamics
from identification.parameters import GROUPS
from identification.regressor import regressor
from testbench.clearance import robot_clearance
from testbench.effects import effect, effects
from testbench.effects.base import Scope
from testbench.effects.signature import Family, Logged
from testbench.effects.size import typical_values

from .experiments import ENOUGH, why
from .findings import Diagnosis
from .predict import member_of
from .preparation import DEAD_ZONE, filter_cutoff

Array = NDArray[np.float64]

FILE = "next_experiment.json"
# Kinds of motion to choose from: how often it repeats, Hz, and how many harmonics it has. Slow sweeps show
# what depends on position, content of some Hz what depends on acceleration and its derivatives.
KINDS = ((0.1, 5), (0.1, 15), (0.1, 60))
DRAWS, IMPROVEMENTS = 4, 20
FIRST_STEP, SHRINK = 0.3, 0.85
LIMIT_SHARE = 0.9
CLEARANCE = 0.03
SAMPLE_RATE, COARSE_RATE = 200.0, 50.0
RIDGE = 1e-10
BLOCK = 16
MOST_RIVALS = 4


@dataclass(frozen=True)
class Rival:
    """One hypothesis: an effect at a place, or none at all where ``effect`` is empty."""

    effect: str
    joint: int | None
    into: int | None = None


@dataclass(frozen=True)
class NextExperiment:
    """What to record next. why: in words. separates: the effects. file: the motion's, None if none helps.

    separation: sqrt of the smallest T, noise units, along the proposed motion. separation_now: along the
    best of the runs at hand. excitation: the motion, or None.
    """

    why: str
    separates: tuple[str, ...]
    file: str | None
    separation: float
    separation_now: float
    excitation: Excitation | None


def rivals(diagnosis: Diagnosis) -> tuple[Rival, ...]:
    """What stays open: the first effect with those confusable with it, else what these runs would not show.

    In the second case the first rival is no effect at all. Empty where nothing stays open.
    """
    for named in diagnosis.effects:
        if named.confusable_with:
            others = [_rival(diagnosis, name, named.joint) for name in named.confusable_with]
            found = [Rival(named.effect, named.joint, named.into), *(o for o in others if o is not None)]
            return tuple(found[:MOST_RIVALS])
    if diagnosis.effects:
        return ()
    hidden = [_rival(diagnosis, name, joint) for name, joint in diagnosis.not_observable]
    seen = tuple(rival for rival in hidden if rival is not None)
    return (Rival("", None), *seen[: MOST_RIVALS - 1]) if seen else ()


def _rival(diagnosis: Diagnosis, name: str, joint: int | None) -> Rival | None:
    """An effect at this joint as it was weighed, or as its scope has it; None if it cannot be there."""
    weighed = [each for each in diagnosis.ranked if each.effect == name]
    for each in weighed:
        if joint in (each.joint, each.into):
            return Rival(name, each.joint, each.into)
    scope = effects()[name].DESCRIPTION.scope
    if scope is Scope.ROBOT:
        return Rival(name, None)
    if scope is Scope.JOINT and joint is not None:
        return Rival(name, joint)
    return Rival(name, weighed[0].joint, weighed[0].into) if weighed else None


def next_experiment(diagnosis: Diagnosis, seed: int = 0) -> NextExperiment | None:
    """The motion that tells apart what stays open, or None where nothing does.

    Random feasible motions of several kinds, the best of them improved by a (1+1) evolution strategy. The
    same seed gives the same motion. Where no motion tells them apart, or the model sets too few limits
    to design one, only the words say what to do.
    """
    open_ = rivals(diagnosis)
    if len(open_) < 2:
        return None
    judge = _Judge(diagnosis, open_)
    names = tuple(dict.fromkeys(rival.effect or "none" for rival in open_))
    now = float(np.sqrt(max(judge.of_run(run.logged) for run in diagnosis.prepared.runs)))
    try:
        motion, best, options = _best_motion(diagnosis, judge, seed)
    except InputError as error:
        reason = f"no motion could be designed: {error.field} is {error.got}"
        return NextExperiment(why(names, None, reason), names, None, 0.0, now, None)
    separation = float(np.sqrt(best))
    words = why(names, separation, "")
    if separation < ENOUGH:
        return NextExperiment(words, names, None, separation, now, None)
    excitation = _excitation(diagnosis, motion, options, separation)
    return NextExperiment(words, names, FILE, separation, now, excitation)


class _Judge:
    """The smallest separation of the rivals along a motion, in chi-squared units of the diagnosis's noise."""

    def __init__(self, diagnosis: Diagnosis, open_: Sequence[Rival]):
        self.diagnosis, self.rivals = diagnosis, open_
        self.template = diagnosis.prepared.runs[0].logged
        self.columns = base_parameters(diagnosis.robot.chain, tuple(GROUPS)).columns
        self.weights = diagnosis.final[1].weights
        self.sizes = [self._size(rival) for rival in open_]

    def of_motion(self, motion: Trajectory) -> float:
        """Along one period of a motion that is tracked perfectly."""
        time = np.arange(int(motion.duration * SAMPLE_RATE) + 1) / SAMPLE_RATE
        q, dq, ddq = motion.evaluate(time)
        logged = replace(
            self.template,
            time=time,
            sample_rate=SAMPLE_RATE,
            q=q,
            dq=dq,
            ddq=ddq,
            tau=np.zeros_like(q),
            temperature=None,
            torque_command=None,
            reference_position=q,
            reference_velocity=dq,
            reference_acceleration=ddq,
        )
        return self.of_run(logged)

    def of_run(self, logged: Logged) -> float:
        """Along a run's motion; its torque is not used."""
        logged = replace(logged, tau=np.zeros_like(logged.q), torque_command=None)
        logged = replace(logged, tau=logged.predicted)
        count, everywhere = len(self.columns), range(logged.joints)
        base = regressor(logged.chain, logged.q, logged.dq, logged.ddq, self.columns)
        blocks: list[tuple[Array, Sequence[int]]] = [(base, everywhere)]
        added: list[int | None] = []
        spans: list[list[slice]] = []
        for rival, size in zip(self.rivals, self.sizes, strict=True):
            family = _family(rival, logged) if size is not None else None
            member = None if family is None or size is None else member_of(family, size[0])
            added.append(None)
            if member is not None and size is not None:
                torque = np.einsum("trk,k->tr", member.columns[0], size[1])
                blocks.append((torque[:, :, None], member.rows))
                added[-1] = count
                count += 1
            spans.append([])
            for one in () if family is None else family.members:
                blocks.append((one.columns[0], one.rows))
                spans[-1].append(slice(count, count + one.count))
                count += one.count
        gram = _projected_gram(self._rows(logged, blocks, count), len(self.columns))
        # Against "no effect" each one need only show.
        against = range(len(added)) if self.rivals[0].effect else (0,)
        smallest = np.inf
        for i, y in enumerate(added):
            for j in against:
                if y is not None and i != j:
                    smallest = min(smallest, *(_left(gram, y, span) for span in spans[j]), gram[y, y])
        return float(smallest) if np.isfinite(smallest) else 0.0

    def _rows(self, logged: Logged, blocks: Sequence[tuple[Array, Sequence[int]]], count: int) -> Array:
        """All columns filtered, decimated, over the noise, without rest: (M n, count).

        blocks: columns (N, r, k) and the r joints that they reach; together ``count`` columns.
        """
        cutoff = filter_cutoff(logged.sample_rate)
        trim = edge_samples(logged.sample_rate, cutoff)
        kept = np.arange(trim, logged.samples - trim, decimation_step(logged.sample_rate, cutoff))
        flat = np.concatenate([columns.reshape(logged.samples, -1) for columns, _ in blocks], axis=1)
        smooth = zero_phase_lowpass(flat, logged.sample_rate, cutoff)[kept]
        out = np.zeros((len(kept), logged.joints, count))
        first = column = 0
        for columns, reached in blocks:
            r, k = columns.shape[1:]
            part = smooth[:, first : first + r * k].reshape(len(kept), r, k)
            out[:, list(reached), column : column + k] = part
            first, column = first + r * k, column + k
        moving = np.abs(logged.dq[kept]) > DEAD_ZONE
        return (out * (np.sqrt(self.weights) * moving)[:, :, None]).reshape(-1, count)

    def _size(self, rival: Rival) -> tuple[dict[str, float], Array] | None:
        """Shape and coefficients of a rival at its likely size; None for no effect.

        A named effect's are those fitted; its rivals' are what imitates it best on these runs, and what
        is not observable is taken at a typical size.
        """
        if not rival.effect:
            return None
        if not self.rivals[0].effect:
            return self._typical(rival)
        return self._fitted(rival) or self._imitation(rival)

    def _fitted(self, rival: Rival) -> tuple[dict[str, float], Array] | None:
        hypothesis, fitted = self.diagnosis.final
        start = hypothesis.parameters
        for accepted in hypothesis.accepted:
            if accepted.place == (rival.effect, rival.joint, rival.into):
                return dict(accepted.member.shape), fitted.values[start : start + accepted.count]
            start += accepted.count
        return None

    def _imitation(self, rival: Rival) -> tuple[dict[str, float], Array] | None:
        """The rival's member and coefficients nearest to the first rival's torque on these runs."""
        runs = self.diagnosis.prepared.runs
        first = self.rivals[0]
        size = self._fitted(first)
        places = {accepted.place: accepted for accepted in self.diagnosis.final[0].accepted}
        accepted = places.get((first.effect, first.joint, first.into))
        if size is None or accepted is None:
            return None
        family = effect(rival.effect).signature([run.logged for run in runs], rival.joint, rival.into)
        weights = [np.sqrt(self.weights) * run.used for run in runs]
        target = _stacked([(c @ size[1])[:, :, None] for c in accepted.columns], weights)
        base = _stacked([run.rows[:, :, self.columns] for run in runs], weights)
        best: tuple[float, tuple[dict[str, float], Array] | None] = (np.inf, None)
        for member in family.members:
            columns = [run.filtered(member.spread(k, len(self.weights))) for k, run in enumerate(runs)]
            gram = _projected_gram(np.hstack([base, _stacked(columns, weights), target]), base.shape[1])
            own, y = slice(base.shape[1], len(gram) - 1), len(gram) - 1
            left = _left(gram, y, own)
            coefficients = np.clip(_nearest(gram, y, own), member.lower, member.upper)
            # A rival whose signs forbid it to imitate has no size of its own.
            if left < best[0] and np.any(coefficients != 0):
                best = left, (dict(member.shape), coefficients)
        return best[1]

    def _typical(self, rival: Rival) -> tuple[dict[str, float], Array] | None:
        """The middle of the family's grid, sized so that its parameters come out at a typical value."""
        logged = replace(self.template, tau=self.template.predicted, torque_command=None)
        family = _family(rival, logged)
        if not family.members:
            return None
        member = family.members[len(family.members) // 2]
        description = effect(rival.effect).DESCRIPTION
        wanted = typical_values(description, self.diagnosis.robot, rival.joint)
        covariance = np.zeros((member.count + len(family.refine),) * 2)
        unit = np.ones(member.count)
        size = 1.0
        for name, quantity in family.parameters(member, unit, covariance).items():
            value = quantity.value
            if name in wanted and name not in member.shape and isinstance(value, float) and value != 0:
                size = wanted[name] / value
                break
        return dict(member.shape), np.clip(size * unit, member.lower, member.upper)


def _stacked(columns: Sequence[Array], weights: Sequence[Array]) -> Array:
    """Columns (M, n, k) of every run times its weights (M, n), one below the other."""
    return np.concatenate(
        [(c * w[:, :, None]).reshape(-1, c.shape[2]) for c, w in zip(columns, weights, strict=True)]
    )


def _family(rival: Rival, logged: Logged) -> Family:
    return effect(rival.effect).signature([logged], rival.joint, rival.into)


def _projected_gram(columns: Array, base: int) -> Array:
    """Inner products of the columns (R, c), what the first ``base`` of them span taken out, (c, c)."""
    norms = np.maximum(np.linalg.norm(columns, axis=0), np.finfo(float).tiny)
    scaled = columns / norms
    # Products too small for BLAS to share among threads, which could change the order of its sums.
    blocks = np.zeros((-(-len(scaled) // BLOCK), BLOCK, scaled.shape[1]))
    blocks.reshape(-1, scaled.shape[1])[: len(scaled)] = scaled
    gram = np.sum(blocks.transpose(0, 2, 1) @ blocks, axis=0)
    inner = gram[:base, :base] + RIDGE * np.eye(base)
    return np.asarray((gram - gram[:, :base] @ np.linalg.solve(inner, gram[:base])) * np.outer(norms, norms))


def _nearest(gram: Array, y: int, span: slice) -> Array:
    """Coefficients (k,) of the columns ``span`` that come nearest to column ``y``."""
    inner = gram[span, span]
    scale = np.sqrt(np.maximum(np.diag(inner), np.finfo(float).tiny))
    scaled = inner / np.outer(scale, scale) + RIDGE * np.eye(len(scale))
    return np.asarray(np.linalg.solve(scaled, gram[span, y] / scale) / scale)


def _left(gram: Array, y: int, span: slice) -> float:
    """Squared length of what the columns ``span`` leave of column ``y``."""
    return float(gram[y, y] - gram[span, y] @ _nearest(gram, y, span))


def _best_motion(diagnosis: Diagnosis, judge: _Judge, seed: int) -> tuple[Trajectory, float, DesignOptions]:
    """The motion of largest separation found, that separation, and how it was designed."""
    robot = diagnosis.robot
    require_usable(robot.chain, robot.limits)
    clearance = robot_clearance(robot, CLEARANCE)
    usable = share_of(robot.limits, LIMIT_SHARE)
    parameters = diagnosis.parameters
    centres = resting_centres(robot.chain, parameters, usable, clearance, seed)
    rng = np.random.default_rng(seed)
    best: tuple[float, Array, FeasibleMotions, DesignOptions] | None = None
    for frequency, harmonics in KINDS:
        options = DesignOptions(
            harmonics=harmonics,
            base_frequency=frequency,
            groups=tuple(GROUPS),
            starts=DRAWS,
            iterations=IMPROVEMENTS,
            limit_share=LIMIT_SHARE,
            seed=seed,
        )
        basis = trajectory_basis(options.trajectory, frequency, harmonics)
        motions = FeasibleMotions(robot.chain, parameters, usable, basis, clearance, centres)
        for _ in range(DRAWS):
            coefficients = motions.draw(rng)
            value = judge.of_motion(basis.trajectory(coefficients))
            if best is None or value > best[0]:
                best = value, coefficients, motions, options
    assert best is not None
    value, coefficients, motions, options = best
    step = FIRST_STEP
    for _ in range(IMPROVEMENTS):
        spread = np.sqrt(np.mean(coefficients[1:] ** 2, axis=0))
        trial = coefficients.copy()
        trial[1:] += step * spread * rng.standard_normal(coefficients[1:].shape)
        found = -np.inf
        if _keeps(motions, trial):
            found = judge.of_motion(motions.basis.trajectory(trial))
        if found > value:
            value, coefficients = found, trial
            step /= SHRINK
        else:
            step *= SHRINK
    motion = motions.repaired(motions.basis.trajectory(coefficients))
    if motion is None:
        raise InputError("limits", "excitation", "room to move about a configuration of rest", "next to none")
    return motion, judge.of_motion(motion), options


def _keeps(motions: FeasibleMotions, coefficients: Array) -> bool:
    """Whether a motion keeps its limits on a coarse grid; the fine one is checked at the end."""
    time = np.arange(int(motions.basis.duration * COARSE_RATE)) / COARSE_RATE
    q, dq, ddq = motions.basis.trajectory(coefficients).evaluate(time)
    limits = motions.limits
    torque = inverse_dynamics(motions.chain, motions.parameters, q, dq, ddq)
    clearance = motions.clearance
    return bool(
        np.all((q >= limits.lower) & (q <= limits.upper))
        and np.all(np.abs(dq) <= limits.velocity)
        and np.all(np.abs(ddq) <= limits.acceleration)
        and np.all(np.abs(torque) <= limits.torque)
        and (clearance is None or clearance.distances(q).min() >= clearance.required)
    )


def _excitation(
    diagnosis: Diagnosis, motion: Trajectory, options: DesignOptions, separation: float
) -> Excitation:
    robot = diagnosis.robot
    clearance = robot_clearance(robot, CLEARANCE)
    columns = base_parameters(robot.chain, tuple(GROUPS)).columns
    scale = np.where(np.isfinite(robot.limits.torque), robot.limits.torque, 1.0)
    count = int(motion.duration * SAMPLE_RATE)
    sampled = motion.evaluate(np.arange(count) / SAMPLE_RATE)
    return Excitation(
        joint_names=robot.joint_names,
        trajectory=motion,
        criterion="separation",
        values=criterion_values(weighted_regressor(robot.chain, columns, scale, sampled), count),
        margins=limit_margins(robot.chain, diagnosis.parameters, robot.limits, motion, clearance),
        options=options,
        evaluations=DRAWS * len(KINDS) + IMPROVEMENTS,
        start_values=(separation,),
    )
