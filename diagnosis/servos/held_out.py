"""How far the simulated position is off on halves that were not fitted, and what may be stated by that."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from identification.output_error.fit import Fit
from identification.output_error.frozen import fit_again
from identification.output_error.plant import Limb
from identification.output_error.servo_run import ServoRun
from testbench.drives.identified import position_rms, split

from ..decision.probability import share_explained
from .evidence import Weighed
from .sizes import Sizes

Array = NDArray[np.float64]

# Of each run, in the first fold.
FOLD = 0.5
# Effects with which left-out halves are missed by more than this times are not stated.
WORSE = 1.02
# Position errors that are less than this times the noise say nothing of the servo.
ABOVE_NOISE = 2.0
# Of the squared error above that, what goes with an effect that is stated.
HALF = 0.5


def held_out_errors(
    limb: Limb, given: Array, fits: Sequence[Fit], runs: Sequence[ServoRun], threads: int | None = None
) -> list[Array]:
    """RMS (n,) rad by the table given (n, WIDTH), then by each of the fits made anew on the other halves.

    A hypothesis keeps its effects, and sizes that were found on a grid; all other unknowns are fitted again.
    """
    halves = [split(run, FOLD) for run in runs]
    folds = [[first for first, _ in halves], [second for _, second in halves]]
    whole = [limb_of_own(limb)]
    squares = [np.zeros(limb.chain.joints) for _ in range(len(fits) + 1)]
    for train, test in (folds, folds[::-1]):
        tables = [given]
        for each in fits:
            tables.append(fit_again(limb.chain, each.unknowns, train, each.values, threads, 1).table)
        for total, table in zip(squares, tables, strict=True):
            total += 0.5 * position_rms(whole, table, test) ** 2
    return [np.sqrt(each) for each in squares]


def limb_of_own(limb: Limb) -> Limb:
    """The limb as a robot of its own."""
    return Limb(np.arange(limb.chain.joints), limb.chain)


def judged(
    limb: Limb, accepted: list[Weighed], errors: Sequence[Array], sizes: Sizes
) -> tuple[list[Weighed], bool, list[str]]:
    """The effects that are stated, whether the fit with them is kept, and why not.

    errors: (n,) each, by the model as given, re-identified, and with the effects where there are any.
    """
    if np.any(missed := errors[-1] > np.maximum(sizes.tracking, ABOVE_NOISE * sizes.noise)):
        names = ", ".join(np.array(limb.chain.joint_names)[missed])
        note = (
            f"At {names} the simulated loop misses the position by more than the command itself does: the "
            "stated servo is not what moved it, and nothing is stated of this limb."
        )
        return [], False, [note]
    if accepted and not _is_no_worse(errors[-1], errors[1], sizes):
        names = " and ".join(_in_words(each, limb) for each in accepted)
        return (
            [],
            False,
            [f"{names}: not stated, since halves that were not fitted are predicted worse with it."],
        )
    little = [each for each in accepted if not _explains(each, errors[1], errors[-1], sizes.noise)]
    second = _beside_another([each for each in accepted if each not in little])
    notes = [
        f"{' and '.join(_in_words(each, limb) for each in left_out)}: in the corrected model, but not "
        f"stated, since {why}."
        for left_out, why in (
            (little, "less than half of the squared error of halves that were not fitted goes with it"),
            (second, "another effect is, at that joint: a law that is nearly the joint's leaves as much"),
        )
        if left_out
    ]
    return [each for each in accepted if each not in (*little, *second)], True, notes


def _beside_another(accepted: Sequence[Weighed]) -> list[Weighed]:
    """The effects at a joint that has one already; the likeliest comes first."""
    own = [(each, each.place.joint) for each in accepted if each.place.joint is not None]
    return [each for index, (each, joint) in enumerate(own) if joint in [at for _, at in own[:index]]]


def _is_no_worse(effects: Array, parameters: Array, sizes: Sizes) -> bool:
    """Whether errors are no worse, each joint's in units of what re-identification leaves there.

    Re-identified parameters may take in a wrong gain to the noise: then both predict alike.
    """
    scale = np.maximum(parameters, sizes.noise) + 1e-12
    return bool(np.mean((effects / scale) ** 2) <= WORSE**2 * np.mean((parameters / scale) ** 2))


def _explains(each: Weighed, parameters: Array, effects: Array, noise: Array) -> bool:
    """Whether half of the squared error goes with an effect, or next to none is left before.

    Of what re-identified parameters take in, it is the shift of these that goes with it.
    """
    own = each.place.joints(len(noise))
    before, after, floor = (float(np.sum(part[own] ** 2)) for part in (parameters, effects, noise))
    share = (before - after) / max(before - floor, 1e-300)
    return before <= ABOVE_NOISE**2 * floor or share_explained(share, each.spared) >= HALF


def _in_words(each: Weighed, limb: Limb) -> str:
    joint = each.place.joint
    return each.place.effect.title + ("" if joint is None else f" at {limb.chain.joint_names[joint]}")
