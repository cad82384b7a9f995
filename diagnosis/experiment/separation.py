"""Separation of the open effects along a motion, in units of the diagnosis's noise.

T-optimality (Atkinson & Fedorov 1975, "The design of experiments for discriminating between two
rival models"): with the torque eta_i that hypothesis i adds, at its likely size, the separation of i
from its rival j is what no choice of the rival's coefficients and of the base parameters can imitate,

    T_ij = min over c, theta of |W^(1/2) (eta_i - Z_j c - Y theta)|².
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from identification.base_parameters import base_parameters
from identification.excitation.trajectory import Trajectory
from identification.parameters import GROUPS
from identification.regressor import regressor
from testbench.effects import effect
from testbench.effects.signature import Logged

from ..data.decimation import DecimatingFilter, decimating_filter, parts
from ..data.run import DEAD_ZONE, filter_cutoff
from ..decision.findings import Diagnosis
from ..model.candidates import MOST_AT_ONCE
from .projection import left, projected_gram
from .rival_size import sized
from .rivals import Open

Array = NDArray[np.float64]

SAMPLE_RATE = 200.0
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
        logged = logged.as_predicted().thinned(max(int(logged.sample_rate / SAMPLE_RATE), 1))
        lowpass = decimating_filter(logged.sample_rate, filter_cutoff(logged.sample_rate))
        blocks: list[Block] = []
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
        gram = projected_gram(self._parts(logged, lowpass, blocks), len(self.columns))
        out = np.full(len(added), np.nan)
        for i, (y, size) in enumerate(zip(added, self.sized, strict=True)):
            if y is not None:
                others = [left(gram, y, span) for j, each in enumerate(spans) if j != i for span in each]
                out[i] = max(min([gram[y, y], *others]), 0.0)
            elif size is not None:
                out[i] = 0.0
        return out

    def _parts(self, logged: Logged, lowpass: DecimatingFilter, blocks: Sequence[Block]) -> Iterator[Array]:
        """Rows of all columns over the noise, part by part: (m n, c). blocks: those of effects."""
        base, joints = len(self.columns), logged.joints
        count = base + sum(columns.shape[2] for columns, _ in blocks)
        at_once = max(MOST_AT_ONCE // (8 * joints * count), 1)
        kept = lowpass.kept(logged.samples)
        weights = np.sqrt(self.weights) * (np.abs(logged.dq[kept]) > DEAD_ZONE)
        for part, samples in parts(lowpass, logged.samples, at_once):
            out = np.zeros((len(weights[part]), joints, count))
            motion = logged.q[samples], logged.dq[samples], logged.ddq[samples]
            out[:, :, :base] = lowpass(regressor(logged.chain, *motion, self.columns))
            column = base
            for columns, reached in blocks:
                out[:, list(reached), column : column + columns.shape[2]] = columns[part]
                column += columns.shape[2]
            yield (out * weights[part, :, None]).reshape(-1, count)
