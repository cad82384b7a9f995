"""Ripples of what a hypothesis leaves: where another effect left far more, none of theirs were the peaks."""

import numpy as np
from numpy.typing import NDArray

from testbench.effects.signature import Member
from testbench.effects.transmission_ripple import DESCRIPTION, SLOWEST, highest_cycles, peaks_of, ripples

from ..fit.normal_equations import Fit, squares
from ..model.candidate import Candidate
from ..model.candidates import candidate
from ..model.hypothesis import Design

Array = NDArray[np.float64]

RIPPLE = DESCRIPTION.name
# Of a joint's squared residual, what is left where the peaks may be others.
OTHERS = 0.5


def ripple_candidates(first: Fit, hypothesis: Design, fitted: Fit) -> list[Candidate]:
    """Ripples at the peaks of what is left, of the joints at which effects took much away.

    first: re-identification, without effects, whose peaks those of the catalogue are.
    """
    prepared = hypothesis.prepared
    left = squares(fitted.residual) / np.maximum(squares(first.residual), 1e-300)
    others = set(np.flatnonzero(left < OTHERS).tolist()) - hypothesis.joints_with(RIPPLE)
    logged, found = [run.logged for run in prepared.runs], []
    for joint in sorted(others):
        family = ripples(logged, joint, *_peaks(hypothesis, fitted, joint))
        # What is slower is what any misfit looks like.
        quick = [each for each in family.members if each.shape["cycles"] > SLOWEST]
        found += [candidate(prepared, family, member) for member in quick]
    return found


def second_waves(hypothesis: Design, fitted: Fit) -> tuple[Member, ...]:
    """The ripple that was accepted last, with a second wave at each peak of what is left."""
    ripple = hypothesis.accepted[-1]
    make, joint = ripple.family.member, ripple.family.joint
    assert make is not None
    assert joint is not None
    peaks, _ = _peaks(hypothesis, fitted, joint)
    return tuple(make({**ripple.member.shape, "second_cycles": cycles}) for cycles in peaks)


def _peaks(hypothesis: Design, fitted: Fit, joint: int) -> tuple[Array, float]:
    """``peaks_of`` what a hypothesis leaves of a joint."""
    runs, chosen = hypothesis.prepared.runs, [used[:, joint] for used in hypothesis.used]
    angles, speeds, left = (
        [signal[use, joint] for signal, use in zip(signals, chosen, strict=True)]
        for signals in ([run.q for run in runs], [run.dq for run in runs], fitted.residual)
    )
    return peaks_of(angles, speeds, left, highest_cycles(hypothesis.prepared.robot.chain, joint))
