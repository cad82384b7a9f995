"""A drive that two joints share stands still where they turn against each other as fast.

There its Coulomb friction is whatever holds it, as a joint's own is at rest, while both joints move. Where
most of what a coupling leaves is there, those samples say nothing of it.
"""

import numpy as np
from numpy.typing import NDArray

from ..data.run import DEAD_ZONE, Run
from ..fit.score import Stage

# Where its drive stands still a coupling leaves so many times as much a sample as elsewhere.
DENSER = 4.0
# Share of a joint's samples that identify its friction once those near rest are left out.
FEWEST = 0.25


def standing_drives(stage: Stage) -> frozenset[tuple[int, int]]:
    """The pairs of joints with a coupling that leaves most where their drive stands still, unless known."""
    found = set()
    for each in stage.hypothesis.accepted:
        joint, into = each.family.joint, each.family.into
        if joint is None or into is None or (joint, into) in stage.prepared.standing:
            continue
        if _is_left_standing(stage, (joint, into)):
            found.add((joint, into))
    return frozenset(found)


def apart_from_standing(run: Run, pair: tuple[int, int]) -> NDArray[np.bool_]:
    """The samples (M, 2) of each joint that hold nothing of their shared drive standing still."""
    standing = np.abs(run.logged.turning[:, pair].sum(axis=1)) <= DEAD_ZONE
    return np.column_stack([run.apart_from(standing, joint) for joint in pair])


def _is_left_standing(stage: Stage, pair: tuple[int, int]) -> bool:
    """Whether most of what is left at either joint is where their drive stands still, and enough is apart."""
    runs = stage.prepared.runs
    apart = np.concatenate([apart_from_standing(run, pair) for run in runs])
    used = np.concatenate([run.used[:, pair] for run in runs])
    left = np.concatenate([residual[:, pair] for residual in stage.fitted.held_out]) ** 2
    left_there, left_apart = (np.sum(left * where, axis=0) for where in (~apart, apart))
    there, elsewhere = (np.sum(used & where, axis=0) for where in (~apart, apart))
    most = left_there > left_apart
    denser = left_there * elsewhere > DENSER * left_apart * there
    return bool(np.any(most & denser) and np.all(elsewhere > FEWEST * (there + elsewhere)))
