"""A hypothesis: which effects act on the runs, its unknowns, their prior and their bounds.

Unknowns are the deviations of the standard parameters from the model's, held back by the prior of
prior.py, a common timing error, and the coefficients of the effects accepted so far.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from identification.parameters import ARMATURE, COULOMB, INERTIAL, OFFSET, PER_JOINT, VISCOUS

from ..data.run import Prepared
from .base_regressor import BaseRegressor
from .candidate import Candidate

Array = NDArray[np.float64]

# Independent samples per decimated one: the widest low-pass leaves about a quarter of the decimated band to
# noise, and what is left beside noise is coloured too.
INDEPENDENT = 0.25
# So many of them, three seconds of motion, determine little more than a joint's own parameters; half as many
# show an effect that explains nearly all that those leave.
FEWEST_INDEPENDENT, FEWEST_OF_ALL = 80.0, 40.0
# Variance scale of the prior where a model is as good as any: a third of the deviations one expects of CAD.
BEST_MODEL = 0.1
# Number of a joint's identifiable parameters of link and rotor, about; those of friction all are.
DETERMINED = 6.0
FRICTION = (VISCOUS, COULOMB, OFFSET)
# Deviation of a push, in units of the strongest joint's RMS torque.
LARGEST_PUSH = 3.0
# Seconds: torque and position are sampled less than this apart, and a timing error that is linear holds.
LATE = 2.4e-3


@dataclass(frozen=True, eq=False)
class Design:
    """The hypothesis that these effects act on the prepared runs, and no other.

    base: regressor of the runs without effects. accepted: the effects. precision: (p,) prior precision of
    each unknown, 0 for none.
    """

    base: BaseRegressor
    accepted: tuple[Candidate, ...]
    precision: Array

    @property
    def prepared(self) -> Prepared:
        """The runs."""
        return self.base.prepared

    @property
    def parameters(self) -> int:
        """Number of unknowns before the effects' coefficients."""
        return self.base.parameters

    @property
    def timing(self) -> int:
        """Index of the timing error among the unknowns: after the standard parameters."""
        return self.parameters - 1

    @property
    def gap(self) -> tuple[Array, ...]:
        """Torque less the model's, a run (M, n) N·m."""
        return self.base.gap

    @property
    def used(self) -> tuple[NDArray[np.bool_], ...]:
        """The samples that count, a run (M, n)."""
        return tuple(run.used for run in self.prepared.runs)

    @property
    def counts(self) -> Array:
        """Number of samples of each joint that count, (n,)."""
        return np.sum([np.sum(used, axis=0) for used in self.used], axis=0).astype(np.float64)

    @property
    def independent(self) -> Array:
        """Number of independent samples of each joint, (n,); all are decimated for the widest band."""
        of_each = self.prepared.band / self.prepared.band.max()
        return min(INDEPENDENT * self.prepared.thinning, 1.0) * of_each * self.counts

    @property
    def has_enough_samples(self) -> NDArray[np.bool_]:
        """Mask (n,) of the joints with enough independent samples for a cause to be reported there."""
        return self.independent >= FEWEST_INDEPENDENT

    @cached_property
    def kinds(self) -> Array:
        """Masks of the unknowns of each kind, (2, p): links and rotors; friction and offsets."""
        kinds, of_joint = np.zeros((2, len(self.precision))), np.zeros((2, PER_JOINT))
        of_joint[0, [*range(INERTIAL), ARMATURE]] = 1.0
        of_joint[1, FRICTION] = 1.0
        kinds[:, : self.timing] = np.tile(of_joint, self.prepared.robot.chain.links)
        if (followers := self.prepared.robot.chain.followers) is not None:
            kinds[:, : self.timing][:, followers.is_nobodys(np.arange(self.timing))] = 0.0
        # What holds a push back goes with the first.
        for each, part in zip(self.accepted, self.parts, strict=True):
            kinds[0, part] = each.is_event
        return kinds

    @property
    def parts(self) -> tuple[slice, ...]:
        """Slice of each effect's coefficients among the unknowns."""
        ends = np.cumsum([self.parameters, *(c.count for c in self.accepted)]).tolist()
        return tuple(slice(first, last) for first, last in pairwise(ends))

    def joints_with(self, name: str) -> set[int | None]:
        """The joints at which an effect acts."""
        return {each.family.joint for each in self.accepted if each.family.effect == name}

    @property
    def yielding(self) -> set[int | None]:
        """The joints with friction that yields before it slides."""
        return {each.family.joint for each in self.accepted if each.description.yields}

    @cached_property
    def loading(self) -> tuple[NDArray[np.int64], ...]:
        """The unknowns that load each joint, (n,) of (u,): the base regressor's, then what reaches it."""
        every, effects = np.arange(len(self.precision)), list(zip(self.accepted, self.parts, strict=True))
        return tuple(
            np.concatenate(
                [every[: self.parameters][own], *(every[p] for c, p in effects if joint in c.member.rows)]
            )
            for joint, own in enumerate(self.base.loading)
        )

    @cached_property
    def added(self) -> list[list[Array]]:
        """Used rows of the effects' columns that reach a joint, (m, k): a fold, a joint."""
        base = self.base

        def rows(fold: int, joint: int) -> Array:
            reaching = [(c, c.member.rows.index(joint)) for c in self.accepted if joint in c.member.rows]
            each = [base.rows_of(c.filtered, fold, joint, place) for c, place in reaching]
            return np.concatenate([np.zeros((len(base.used[fold][joint]), 0)), *each], axis=1)

        return [[rows(fold, joint) for joint in range(base.joints)] for fold in range(len(base.folds))]

    @cached_property
    def _x(self) -> dict[tuple[int, int], Array]:
        return {}

    def x(self, fold: int, joint: int) -> Array:
        """Used rows of what loads a joint, (m, u)."""
        if (fold, joint) in self._x:
            return self._x[fold, joint]
        base = self.base
        found = np.concatenate([base.x(fold, joint), self.added[fold][joint]], axis=1)
        if base.is_small:
            self._x[fold, joint] = found
        return found

    @cached_property
    def xx(self) -> list[list[Array]]:
        """X'X (u, u) of each fold and joint's used rows of what loads it."""
        return [[self._square(f, j) for j in range(self.base.joints)] for f in range(len(self.base.folds))]

    def _square(self, fold: int, joint: int) -> Array:
        """X'X of one fold and joint: the base regressor's, bordered by that of the effects."""
        base, z = self.base, self.added[fold][joint]
        if not z.shape[1]:
            return base.xx[fold][joint]
        cross = base.x(fold, joint).T @ z
        return np.block([[base.xx[fold][joint], cross], [cross.T, z.T @ z]])

    @cached_property
    def xy(self) -> Array:
        """X'y (F, n, p) of each fold and joint's used rows of the gap."""
        base = self.base
        found = np.zeros((len(base.folds), base.joints, len(self.precision)))
        found[:, :, : base.parameters] = base.xy
        for fold, joint in np.ndindex(*found.shape[:2]):
            own, z = self.loading[joint], self.added[fold][joint]
            found[fold, joint, own[own >= base.parameters]] = z.T @ base.y[fold][joint]
        return found

    def weighted(self, weights: Array) -> tuple[Array, Array]:
        """The sums X'X (F, p, p) and X'y (F, p) of each fold over the joints, by their weights (n,)."""
        found = np.zeros((len(self.xx), *2 * [len(self.precision)]))
        for of_fold, sums in zip(self.xx, found, strict=True):
            for xx, own, weight in zip(of_fold, self.loading, weights, strict=True):
                sums[own[:, None], own] += weight * xx
        return found, np.einsum("j,fja->fa", weights, self.xy)

    def products(self, y: Mapping[int, Sequence[Array]]) -> Array:
        """X'y (F, n, p) of used rows (m,) of some folds: by fold, in their order, and joint."""
        found = np.zeros((len(y), self.prepared.joints, len(self.precision)))
        found[:, :, : self.parameters] = self.base.products(y)
        for place, (fold, left) in enumerate(y.items()):
            for joint, own in enumerate(self.loading):
                found[place, joint, own[own >= self.parameters]] = self.added[fold][joint].T @ left[joint]
        return found


def design(base: BaseRegressor, accepted: Sequence[Candidate] = (), is_delayed: bool = False) -> Design:
    """The hypothesis that these effects act, and no other. is_delayed: but for a delay, known apart."""
    # A window in which next to nothing counts must not hold a push without bounds.
    push = (LARGEST_PUSH * float(base.torque_rms.max())) ** -2.0
    free = [np.full(c.count, push) if c.is_event else c.precision for c in accepted]
    precision = np.concatenate([base.precision, *free])
    if is_delayed or any(c.is_common_delay for c in accepted):
        # A delay that is an effect leaves none to the way the log was taken.
        precision[base.parameters - 1] /= np.sqrt(np.finfo(float).eps)
    return Design(base, tuple(accepted), precision)


def log_prior(hypothesis: Design, values: Array) -> Array:
    """Log-prior of parameters (p, ...), the scale of each kind integrated out; up to a constant."""
    timing, freedom = hypothesis.timing, _determined(hypothesis)
    late = values[timing] ** 2 * hypothesis.precision[timing]
    return -0.5 * freedom @ np.log(likeliest_scales(hypothesis, values)) - 0.5 * late


def likeliest_scales(hypothesis: Design, values: Array) -> Array:
    """The prior's variance scale of each kind, (2, ...), at which parameters (p, ...) are likeliest.

    Small for what a model has right: links may be as drawn where nobody knew the friction.
    """
    distance = (hypothesis.kinds * hypothesis.precision) @ values**2
    return BEST_MODEL + (distance.T / _determined(hypothesis)).T


def scaled_precision(hypothesis: Design, scales: Array) -> Array:
    """Prior precision (p,) at the variance scales (2,), which the time of sampling has nothing to do with."""
    kinds = hypothesis.kinds
    return hypothesis.precision / np.where(kinds.any(axis=0), scales @ kinds, 1.0)


def bounds(hypothesis: Design) -> tuple[Array, Array]:
    """Lower and upper bounds of the parameters, (p,) each; standard parameters are unbounded."""
    unbounded = np.full(hypothesis.parameters, np.inf)
    lower, upper = zip((-unbounded, unbounded), *(c.bounds for c in hypothesis.accepted), strict=True)
    return np.concatenate(lower), np.concatenate(upper)


def _determined(hypothesis: Design) -> Array:
    """Number of identifiable parameters of each kind, (2,): about nine of fourteen a joint."""
    return hypothesis.prepared.joints * np.array([DETERMINED, len(FRICTION)])
