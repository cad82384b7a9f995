"""Separation of the open effects along a motion, in units of the diagnosis's noise.

T-optimality (Atkinson & Fedorov 1975, "The design of experiments for discriminating between two
rival models"): with the torque eta_i that hypothesis i adds, at its likely size, the separation of i
from its rival j is what no choice of the rival's coefficients and of the base parameters can imitate,

    T_ij = min over c, theta of |W^(1/2) (eta_i - Z_j c - Y theta)|².
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from identification.base_parameters import base_parameters
from identification.excitation.trajectory import Trajectory
from identification.parameters import GROUPS
from identification.regressor import regressor
from testbench.effects import effect
from testbench.effects.signature import Logged

from ..data.decimation import decimating_filter
from ..data.preparation import DEAD_ZONE, filter_cutoff
from ..decision.findings import Diagnosis
from .projection import BLOCK, left, projected_gram
from .rival_size import sized
from .rivals import Open

Array = NDArray[np.float64]

SAMPLE_RATE = 200.0
# Bytes of the regressor that are filtered at once, and of all columns that are multiplied at once.
MOST_AT_ONCE, MOST_MULTIPLIED = 1 << 27, 1 << 23
# Filtered columns (M, r, k) and the r joints that they reach.
Block = tuple[Array, Sequence[int]]


class Separation:
    """The squared separation of each rival along a motion."""

    def __init__(self, diagnosis: Diagnosis, open_: Open):
        self.open = open_
        self.template = diagnosis.prepared.runs[0].logged
        self.columns = base_parameters(diagnosis.robot.chain, tuple(GROUPS)).columns
        self.weights = diagnosis.final[1].weights
        self.sized = [sized(diagnosis, open_, rival) for rival in open_.rivals]

    def of_motion(self, motion: Trajectory) -> Array:
        """(R,) along one period of a motion that is tracked perfectly."""
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
            carried=None,
            beside=None,
            reference_position=q,
            reference_velocity=dq,
            reference_acceleration=ddq,
        )
        return self.of_run(logged)

    def of_run(self, logged: Logged) -> Array:
        """(R,) along a run's motion, whose torque is not used.

        Of effects that are confused, the distance from the nearest other; of others, from no effect at all.
        NaN for a rival without a size, zero for one that the motion leaves without columns. Whatever rate
        a run was logged at, it is judged at that of the motions.
        """
        logged = logged.foretold().thinned(max(int(logged.sample_rate / SAMPLE_RATE), 1))
        lowpass = decimating_filter(logged.sample_rate, filter_cutoff(logged.sample_rate))
        blocks: list[Block] = []
        for columns in np.array_split(self.columns, -(-len(self.columns) * logged.q.nbytes // MOST_AT_ONCE)):
            base = regressor(logged.chain, logged.q, logged.dq, logged.ddq, columns)
            blocks.append((lowpass(base), range(logged.joints)))
        count = len(self.columns)
        added: list[int | None] = []
        spans: list[list[slice]] = []
        for rival, size in zip(self.open.rivals, self.sized, strict=True):
            family = effect(rival.effect).signature([logged], rival.joint, rival.into)
            member = None if size is None else family.at(size.shape)
            added.append(None)
            if member is not None and size is not None:
                torque = np.einsum("trk,k->tr", member.columns[0], size.coefficients)
                blocks.append((lowpass(torque[:, :, None]), member.rows))
                added[-1] = count
                count += 1
            spans.append([])
            for one in family.members if self.open.confused else ():
                blocks.append((lowpass(one.columns[0]), one.rows))
                spans[-1].append(slice(count, count + one.count))
                count += one.count
        moving = np.abs(logged.dq[lowpass.kept(logged.samples)]) > DEAD_ZONE
        gram = projected_gram(partial(self._parts, blocks, moving), len(self.columns))
        out = np.full(len(added), np.nan)
        for i, (y, size) in enumerate(zip(added, self.sized, strict=True)):
            if y is not None:
                others = [left(gram, y, span) for j, each in enumerate(spans) if j != i for span in each]
                out[i] = max(min([gram[y, y], *others]), 0.0)
            elif size is not None:
                out[i] = 0.0
        return out

    def _parts(self, blocks: Sequence[Block], moving: NDArray[np.bool_]) -> Iterator[Array]:
        """Rows of all columns over the noise, part by part: (m n, c). moving: (M, n), joints not at rest."""
        samples, joints = moving.shape
        count = sum(columns.shape[2] for columns, _ in blocks)
        step = BLOCK * max(MOST_MULTIPLIED // (8 * BLOCK * joints * count), 1)
        weights = np.sqrt(self.weights) * moving
        for first in range(0, samples, step):
            part = slice(first, first + step)
            out = np.zeros((len(weights[part]), joints, count))
            column = 0
            for columns, reached in blocks:
                out[:, list(reached), column : column + columns.shape[2]] = columns[part]
                column += columns.shape[2]
            yield (out * weights[part, :, None]).reshape(-1, count)
