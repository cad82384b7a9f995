"""Regressor of 4000 samples of the TX-90, 6 x 78, against a Python loop over Pinocchio's."""

from collections.abc import Callable
from functools import partial

import numpy as np
import pinocchio

from identification.base_parameters import base_parameters
from identification.parameters import DEFAULT_GROUPS, INERTIAL, PER_JOINT, group_columns
from identification.regressor import regressor

from ._arms import MODEL, random_states, tx90
from ._report import Goal, Report
from ._timing import alternate

SAMPLES, ROUNDS = 4000, 15
# As many are worth a second thread; into given memory, since touching it anew takes as long again.
MANY = 40_000
WITHOUT_OFFSET = PER_JOINT - 1
# Where Pinocchio keeps XX XY XZ YY YZ ZZ MX MY MZ M among its ten: m, mc, then Ixx Ixy Iyy Ixz Iyz Izz.
PINOCCHIO_ORDER = (4, 5, 7, 6, 8, 9, 1, 2, 3, 0)


def measure() -> Report:
    chain = tx90().chain
    q, dq, ddq = random_states(SAMPLES)
    columns = group_columns(chain.joints, DEFAULT_GROUPS)
    base = base_parameters(chain).columns
    within = np.searchsorted(columns, base)

    def ours(threads: int, chosen: np.ndarray = columns) -> np.ndarray:
        return regressor(chain, q, dq, ddq, chosen, threads=threads)

    rivals = {
        "Pinocchio in a Python loop": _pinocchio_loop(q, dq, ddq),
        "ours, 1 thread": lambda: ours(1),
        "base columns gathered, 1 thread": lambda: ours(1)[:, :, within],
        "base columns written direct, 1 thread": lambda: ours(1, base),
    }
    large, memory = random_states(MANY), np.empty((MANY, chain.joints, len(columns)))
    for threads in (1, 2):
        rivals[f"ours, {MANY} samples into given memory, {threads} threads"] = partial(
            regressor, chain, *large, columns, threads=threads, out=memory
        )
    theirs = rivals["Pinocchio in a Python loop"]()[:, :, _in_pinocchio_order(columns)]
    difference = float(np.abs(theirs - ours(1)).max() / np.abs(theirs).max())
    times = alternate(rivals, ROUNDS)
    first = next(iter(rivals))
    rows = tuple(
        (
            name,
            f"{1e3 * times.median(name):.2f}",
            f"{1e6 * times.median(name) / (MANY if str(MANY) in name else SAMPLES):.2f}",
            "" if str(MANY) in name else f"{times.speedup(first, name):.1f}",
        )
        for name in rivals
    )
    gathered, direct, one, two = list(rivals)[2:]
    return Report(
        columns=("way", "ms", "µs a sample", "times faster"),
        rows=rows,
        goals=(
            Goal("one thread against Pinocchio's loop", times.speedup(first, "ours, 1 thread"), 5),
            Goal("two threads against one", times.speedup(one, two), 1.6),
            Goal("largest relative difference between the two", difference, 1e-12, at_least=False),
        ),
        notes=(
            f"Base columns written direct: {times.speedup(gathered, direct):.2f} times as fast as gathered.",
            "Pinocchio's loop keeps its own order of columns; rotor inertia and friction are numpy's.",
        ),
    )


def _pinocchio_loop(q: np.ndarray, dq: np.ndarray, ddq: np.ndarray) -> Callable[[], np.ndarray]:
    """The same 78 columns in Pinocchio's order: ten a joint sample by sample, then three groups by numpy."""
    model = pinocchio.buildModelFromMJCF(str(MODEL))
    data = model.createData()
    samples, n = q.shape
    joints, rigid = np.arange(n), INERTIAL * n

    def loop() -> np.ndarray:
        out = np.zeros((samples, n, WITHOUT_OFFSET * n))
        function = pinocchio.computeJointTorqueRegressor
        for t in range(samples):
            out[t, :, :rigid] = function(model, data, q[t], dq[t], ddq[t])
        for group, values in enumerate((ddq, dq, np.sign(dq))):
            out[:, joints, rigid + group * n + joints] = values
        return out

    return loop


def _in_pinocchio_order(columns: np.ndarray) -> np.ndarray:
    """Which of Pinocchio's loop's columns each of ours is."""
    joint, symbol = np.divmod(columns, PER_JOINT)
    rigid = INERTIAL * joint + np.array(PINOCCHIO_ORDER)[np.minimum(symbol, INERTIAL - 1)]
    other = symbol * (joint.max() + 1) + joint
    return np.where(symbol < INERTIAL, rigid, other)
