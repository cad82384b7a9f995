"""The next experiment: the motion along which effects that these runs cannot distinguish differ most.

What is maximised, within the limits, is the mean of T / (T + ENOUGH²) over the hypotheses that stay open, T
being how far each is from the nearest of the others (separation.py): as many as one motion can show are
shown, and none is shown at the cost of the rest.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.base_parameters import base_parameters
from identification.errors import InputError
from identification.excitation.criteria import criterion_values
from identification.excitation.excitation import DesignOptions, Excitation
from identification.excitation.limits import Limits, limit_margins, require_usable, share_of
from identification.excitation.problem import weighted_regressor
from identification.excitation.random_motion import FeasibleMotions, resting_centres
from identification.excitation.trajectories import trajectory_basis
from identification.excitation.trajectory import Trajectory
from identification.inverse_dynamics import inverse_dynamics
from identification.parameters import GROUPS
from testbench.clearance import robot_clearance
from testbench.jobs.excite import CLEARANCE

from ..decision.findings import Diagnosis
from .reached_limits import within_reach
from .reasons import ENOUGH, why
from .rivals import Open, still_open
from .separation import SAMPLE_RATE, Separation

Array = NDArray[np.float64]

FILE = "next_experiment.json"
# How often a motion repeats, Hz, and how many harmonics it may have. Slow sweeps show what depends on
# position, content of some Hz what depends on acceleration and its derivatives.
FREQUENCY, HARMONICS = 0.1, (5, 15, 60)
DRAWS, IMPROVEMENTS = 4, 20
FIRST_STEP, SHRINK = 0.3, 0.85
LIMIT_SHARE = 0.9
COARSE_RATE = 50.0
# What a motion shows no more than so many times better than the runs at hand, it is not worth running for.
BETTER = 2.0
# Of what is needed, a motion that shows less than this of every effect is not improved to show one.
HOPEFUL = 0.4
NO_BETTER = "no motion was found that shows them much better"
BY_RUNS = "Where the model sets no limit, it keeps to what these runs reached."


@dataclass(frozen=True)
class NextExperiment:
    """Proposal of the next experiment. why: in words. file: the motion's, None if none helps.

    separates: the effects that it distinguishes, or "none" and those that it shows. separation: sqrt of the
    smallest T of those that it shows, noise units, along the proposed motion. separation_now: likewise along
    the best of the runs at hand. excitation: the motion, or None.
    """

    why: str
    separates: tuple[str, ...]
    file: str | None
    separation: float
    separation_now: float
    excitation: Excitation | None


def next_experiment(diagnosis: Diagnosis, seed: int = 0) -> NextExperiment | None:
    """The motion that distinguishes the open effects, or None where nothing is open.

    Random feasible motions of several kinds, the best of them improved by a (1+1) evolution strategy. The
    same seed gives the same motion. Where a model sets too few limits, what the runs reached stands in for
    them. Where no motion distinguishes them, or none can be designed, only the words say what to do. Where a
    frame of the model is not the robot's, that is mended first.
    """
    open_ = None if diagnosis.barred else still_open(diagnosis)
    if open_ is None:
        return None
    judge = Separation(diagnosis, open_)
    everything = np.ones(len(open_.rivals), dtype=bool)
    everyone = _names(open_, everything)
    now = [judge.of_run(run.logged) for run in diagnosis.prepared.runs]
    limits, by_runs = within_reach(diagnosis.robot.limits, [run.logged for run in diagnosis.prepared.runs])
    needed = np.full(len(open_.rivals), ENOUGH**2)
    if not open_.confused:
        needed = np.maximum(needed, BETTER**2 * np.nan_to_num(np.max(now, axis=0)))
    try:
        motion, options = _best_motion(diagnosis, limits, judge, needed, seed)
    except InputError as error:
        least = max(_least(each, everything) for each in now)
        reason = f"no motion could be designed: {error.field} is {error.got}"
        return NextExperiment(why(everyone, everyone, None, reason), everyone, None, 0.0, least, None)
    found = np.nan_to_num(judge.of_motion(motion))
    shown = np.asarray(found >= needed)
    helps = bool(np.any(shown))
    # What a motion does not show is not what it is for.
    chosen = shown if helps else everything
    separation, least = _least(found, chosen), max(_least(each, chosen) for each in now)
    if not helps:
        words = why(everyone, everyone, separation if open_.confused else None, NO_BETTER)
        return NextExperiment(words, everyone, None, separation, least, None)
    names = _names(open_, chosen)
    words = why(everyone, names, separation, "") + (f" {BY_RUNS}" if by_runs else "")
    excitation = _excitation(diagnosis, limits, motion, options, separation)
    separates = everyone if open_.confused else names
    return NextExperiment(words, separates, FILE, separation, least, excitation)


def _names(open_: Open, chosen: NDArray[np.bool_]) -> tuple[str, ...]:
    """Names of the chosen rivals, "none" first where they are to be distinguished from no effect."""
    names = [rival.effect for rival, takes in zip(open_.rivals, chosen, strict=True) if takes]
    return tuple(dict.fromkeys(names if open_.confused else ["none", *names]))


def _least(separations: Array, chosen: NDArray[np.bool_]) -> float:
    """sqrt of the smallest separation of the chosen; 0 where none has any."""
    known = separations[chosen & np.isfinite(separations)]
    return float(np.sqrt(known.min())) if len(known) else 0.0


def _merit(separations: Array) -> float:
    """Merit of a motion, 0 to 1: mean of T / (T + ENOUGH²) over the finite separations T."""
    known = separations[np.isfinite(separations)]
    if not len(known):
        return 0.0
    return float(np.mean(known / (known + ENOUGH**2)))


def _best_motion(
    diagnosis: Diagnosis, limits: Limits, judge: Separation, needed: Array, seed: int
) -> tuple[Trajectory, DesignOptions]:
    """The best motion found, and how it was designed. needed: (R,) separations. Raises InputError."""
    robot = diagnosis.robot
    require_usable(robot.chain, limits)
    clearance = robot_clearance(robot, CLEARANCE)
    usable = share_of(limits, LIMIT_SHARE)
    parameters = diagnosis.parameters
    centres = resting_centres(robot.chain, parameters, usable, clearance, seed)
    rng = np.random.default_rng(seed)
    best: tuple[float, Array, FeasibleMotions, DesignOptions] | None = None
    most = 0.0
    for harmonics in HARMONICS:
        options = DesignOptions(
            harmonics=harmonics,
            base_frequency=FREQUENCY,
            groups=tuple(GROUPS),
            starts=DRAWS,
            iterations=IMPROVEMENTS,
            limit_share=LIMIT_SHARE,
            seed=seed,
        )
        basis = trajectory_basis(options.trajectory, FREQUENCY, harmonics)
        motions = FeasibleMotions(robot.chain, parameters, usable, basis, clearance, centres)
        for _ in range(DRAWS):
            coefficients = motions.draw(rng)
            found = np.nan_to_num(judge.of_motion(basis.trajectory(coefficients)))
            value, most = _merit(found), max(most, float(np.max(found / needed)))
            if best is None or value > best[0]:
                best = value, coefficients, motions, options
    assert best is not None
    value, coefficients, motions, options = best
    step = FIRST_STEP
    for _ in range(IMPROVEMENTS if most > HOPEFUL else 0):
        spread = np.sqrt(np.mean(coefficients[1:] ** 2, axis=0))
        trial = coefficients.copy()
        trial[1:] += step * spread * rng.standard_normal(coefficients[1:].shape)
        improved = -np.inf
        if _keeps(motions, trial):
            improved = _merit(judge.of_motion(motions.basis.trajectory(trial)))
        if improved > value:
            value, coefficients = improved, trial
            step /= SHRINK
        else:
            step *= SHRINK
    motion = motions.repaired(motions.basis.trajectory(coefficients))
    if motion is None:
        raise InputError("limits", "excitation", "room to move about a configuration of rest", "next to none")
    return motion, options


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
    diagnosis: Diagnosis, limits: Limits, motion: Trajectory, options: DesignOptions, separation: float
) -> Excitation:
    robot = diagnosis.robot
    clearance = robot_clearance(robot, CLEARANCE)
    columns = base_parameters(robot.chain, tuple(GROUPS)).columns
    scale = np.where(np.isfinite(limits.torque), limits.torque, 1.0)
    count = int(motion.duration * SAMPLE_RATE)
    sampled = motion.evaluate(np.arange(count) / SAMPLE_RATE)
    return Excitation(
        joint_names=robot.joint_names,
        trajectory=motion,
        criterion="separation",
        values=criterion_values(weighted_regressor(robot.chain, columns, scale, sampled), count),
        margins=limit_margins(robot.chain, diagnosis.parameters, limits, motion, clearance),
        options=options,
        evaluations=DRAWS * len(HARMONICS) + IMPROVEMENTS,
        start_values=(separation,),
    )
