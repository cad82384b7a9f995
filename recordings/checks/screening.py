"""Conventions one mistake away from a known one, the likeliest of them by the model as given.

Friction, rotor and offset of each joint are projected out of both torques, so that only what links do counts;
which column of torques follows which joint's links is then an assignment (Kuhn, "The Hungarian method for the
assignment problem", 1955), and no permutation of them has to be tried by itself.
"""

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment, minimize_scalar

from identification.inverse_dynamics import inverse_dynamics
from identification.parameters import without_friction
from testbench.robot import Robot

from .convention import Convention, chain_of, mistakes, read_by
from .model_fit import FEWEST
from .samples import Samples

Array = NDArray[np.float64]

# rad, between zeros that are tried.
ZERO_STEP = np.deg2rad(20)
# Of a torque's square: conventions that leave less are alike in a screening.
ALIKE = 0.003
# Logarithm of the odds against one more mistake, in a screening.
PER_MISTAKE = 4.0
# A scale is worth a hypothesis beyond this factor, where torque goes with the model's by this correlation.
OFF_SCALE, GOES_WITH = 1.2, 0.7
# Singular values below this share of the largest do not determine gravity.
LEAST_SINGULAR = 1e-3
# Columns of three are passed round where the exchange of two is one of so many likeliest: all of an arm's.
SWAPS = 24
# What no assignment chooses.
NEVER = 1e6
TINY = float(np.finfo(float).tiny)


@dataclass(frozen=True)
class _Match:
    """Of every joint (row) and torque column: what is left, and the slope, of torque against the links'.

    fixed: (2, n, n) squared share left at the convention's scale, by a torque's sign of 1 and of -1. free:
    (n, n) left at any scale. slope: (n, n) that scale, signed.
    """

    fixed: Array
    free: Array
    slope: Array


class _Column:
    """A log's column of positions: of every torque, what friction, rotor and offset there leave.

    used: (M,) samples in motion. torque: (m, n) what is left of each column of torques; power: (n,) its
    square, square: (n,) that of the whole.
    """

    def __init__(self, samples: Samples, column: int):
        self.used = samples.moves[:, column]
        speed, acceleration = samples.dq[self.used, column], samples.ddq[self.used, column]
        known = np.column_stack([speed, np.sign(speed), acceleration, np.ones(len(speed))])
        self.basis = np.linalg.qr(known)[0]
        whole = samples.torque[self.used]
        self.torque = self.without(whole)
        self.power = np.sum(self.torque**2, axis=0)
        self.square = np.maximum(np.sum(whole**2, axis=0), TINY)

    def without(self, torque: Array) -> Array:
        """Residual of a torque (m, ...) without friction, armature and offset of the joint, fitted to it."""
        return torque - self.basis @ (self.basis.T @ torque)


class Screening:
    """Conventions near a known one, for one robot and its samples."""

    def __init__(self, robot: Robot, samples: Samples, independent: float):
        self.robot, self.samples, self.independent = robot, samples, independent
        self.links = without_friction(robot.parameters)
        self.n = robot.joints
        enough = samples.moves.sum(axis=0) >= FEWEST
        self.columns = [_Column(samples, column) if enough[column] else None for column in range(self.n)]

    def likeliest(self, start: Convention, most: int, joints: Sequence[int]) -> list[Convention]:
        """At most so many conventions one mistake or one assignment away, likeliest first.

        joints: of which positions may count otherwise.
        """
        scored: dict[Convention, float] = {}

        def screen(near: Convention) -> float:
            """Keep the likeliest conventions with these positions; an upper bound of their scores."""
            match = self._match(near)
            at_most = self._at_most(match, near)
            if len(scored) < most or at_most >= min(scored.values()):
                for convention, score in self._torques(near, match):
                    if convention != start and score > scored.get(convention, -np.inf):
                        scored[convention] = score
                for each in sorted(scored, key=lambda each: -scored[each])[most:]:
                    del scored[each]
            return at_most

        screen(start)
        order = start.position_order
        moving = [joint for joint in joints if self.columns[order[joint]] is not None]
        pairs = list(itertools.combinations(moving, 2))
        swaps = {pair: screen(replace(start, position_order=_passed_round(order, pair))) for pair in pairs}
        best = sorted(swaps, key=lambda pair: -swaps[pair])[:SWAPS]
        for three in _threes(best, moving):
            screen(replace(start, position_order=_passed_round(order, three)))
        for near in self._moved(start, joints):
            screen(near)
        return [self._finer(each) for each in sorted(scored, key=lambda each: -scored[each])]

    def score(self, convention: Convention) -> float:
        """The screening's score of one convention, its torque columns, signs and scales as they are."""
        match = self._match(convention)
        columns = np.array(convention.torque_order)
        sign = np.array([0 if each > 0 else 1 for each in convention.torque_sign])
        left = match.fixed[sign, np.arange(self.n), columns]
        return self._score(left, convention)

    def _score(self, left: Array, convention: Convention) -> float:
        fits = -0.5 * self.independent * float(np.nansum(np.log(left + ALIKE)))
        return fits - PER_MISTAKE * mistakes(convention)

    def _at_most(self, match: _Match, near: Convention) -> float:
        """An upper bound of the score with these positions, whatever the torque columns, signs and scales."""
        left = np.minimum(match.fixed.min(axis=0), match.free).min(axis=1)
        ones = (1.0,) * self.n
        fewest = replace(near, torque_order=near.position_order, torque_sign=ones, scale=ones)
        return self._score(left, fewest)

    def _moved(self, start: Convention, joints: Sequence[int]) -> Iterator[Convention]:
        """Conventions with other signs and zeros of positions, or other gravity, one mistake away."""
        for count in (1, 2):
            for places in itertools.combinations(joints, count):
                turned = start
                for joint in places:
                    turned = turned.turned("position_sign", joint)
                yield turned
        yield replace(start, position_sign=tuple(-each for each in start.position_sign))
        for joint in (each for each in joints if not self.robot.chain.is_slide[each]):
            for angle in np.arange(-np.pi, np.pi, ZERO_STEP).tolist():
                off = start.with_value("zero", joint, float(angle))
                yield off
                # A joint that counts the other way has its zero elsewhere, too.
                yield off.turned("position_sign", joint)
        if np.any(self.robot.chain.gravity) and any(self.columns):
            yield replace(start, gravity=(0.0, 0.0, 0.0))
            yield replace(start, gravity=self._felt_gravity(start))

    def _felt_gravity(self, start: Convention) -> tuple[float, float, float]:
        """Gravity, m/s², of the model's size, in the direction that explains most by the links' masses."""
        read = read_by(self.samples, start)
        chain = chain_of(self.robot.chain, start).without_springs()
        still = np.zeros_like(read.q)
        gap = read.torque - inverse_dynamics(chain, self.links, read.q, read.dq, read.ddq, threads=1)
        columns, wanted = [], []
        weights = [
            inverse_dynamics(replace(chain, gravity=axis), self.links, read.q, still, still, threads=1)
            for axis in np.eye(3)
        ]
        for joint in range(self.n):
            column = self.columns[start.position_order[joint]]
            if column is None:
                continue
            size = max(float(np.linalg.norm(read.torque[column.used, joint])), TINY)
            columns.append(column.without(np.column_stack([w[column.used, joint] for w in weights])) / size)
            wanted.append(column.without(gap[column.used, joint]) / size)
        more = np.linalg.lstsq(np.concatenate(columns), np.concatenate(wanted), rcond=LEAST_SINGULAR)[0]
        felt = chain.gravity + more
        # An arm may hang or lean, but weigh nothing else: more or less torque than this is the masses'.
        felt *= np.linalg.norm(chain.gravity) / max(float(np.linalg.norm(felt)), TINY)
        x, y, z = (float(each) for each in np.round(felt, 2))
        return x, y, z

    def _torques(self, near: Convention, match: _Match) -> Iterator[tuple[Convention, float]]:
        """This convention with the torque columns, signs and scales that suit it, and their scores."""
        rows = np.arange(self.n)
        signs = np.array([0 if each > 0 else 1 for each in near.torque_sign])
        orders = [np.array(near.torque_order)]
        for left in (match.fixed.min(axis=0), match.free):
            orders.append(linear_sum_assignment(self._cost(left, near))[1])
        for columns in {tuple(each.tolist()): each for each in orders}.values():
            order = tuple(columns.tolist())
            fixed, free, slope = (each[..., rows, columns] for each in (match.fixed, match.free, match.slope))
            turned = np.where(np.isnan(slope), signs, (slope < 0).astype(int))
            # The one joint whose sign, turned, explains most.
            gain = np.nan_to_num(np.log(fixed[signs, rows] + ALIKE) - np.log(fixed[1 - signs, rows] + ALIKE))
            one = np.where(rows == np.argmax(gain), 1 - signs, signs)
            for sign in (signs, one, turned, 1 - signs):
                tried = replace(near, torque_order=order, torque_sign=_signs(sign))
                yield tried, self._score(fixed[sign, rows], tried)
            for scale in self._scales(np.abs(slope), free):
                tried = replace(near, torque_order=order, torque_sign=_signs(turned), scale=scale)
                is_as_is = np.array(scale) == np.array(near.scale)
                yield tried, self._score(np.where(is_as_is, fixed[turned, rows], free), tried)

    def _cost(self, left: Array, near: Convention) -> Array:
        """(n, n) of what is left, such that joints that stand still keep their columns."""
        cost = np.log(left + ALIKE)
        for joint, column in enumerate(near.torque_order):
            if np.isnan(left[joint]).any():
                cost[joint], cost[:, column] = NEVER, NEVER
                cost[joint, column] = 0.0
        return cost

    def _scales(self, factors: Array, left: Array) -> Iterator[tuple[float, ...]]:
        """Scales that joints may have by these factors (n,) of torque to the links': one of all, one each."""
        sure = np.isfinite(factors) & (left < 1 - GOES_WITH**2) & (factors > 0)
        if not sure.any():
            return
        logs = np.log(np.where(sure, factors, 1.0))
        off = sure & (np.abs(logs) > np.log(OFF_SCALE))
        if not off.any():
            return
        common = float(np.exp(np.median(logs[sure])))
        if not 1 / OFF_SCALE < common < OFF_SCALE:
            yield (common,) * self.n
        each = np.where(off, np.exp(logs), 1.0)
        yield tuple(each.tolist())

    def _match(self, convention: Convention) -> _Match:
        chain = chain_of(self.robot.chain, convention)
        read = read_by(self.samples, convention)
        links = inverse_dynamics(chain, self.links, read.q, read.dq, read.ddq, threads=1)
        fixed, free = np.full((2, self.n, self.n), np.nan), np.full((self.n, self.n), np.nan)
        slope = np.full((self.n, self.n), np.nan)
        for joint in range(self.n):
            column = self.columns[convention.position_order[joint]]
            if column is None:
                continue
            own = column.without(links[column.used, joint])
            both, mine = own @ column.torque, max(float(own @ own), TINY)
            for index, sign in enumerate((1.0, -1.0)):
                factor = sign * convention.scale[joint]
                fixed[index, joint] = (column.power - 2 * factor * both + factor**2 * mine) / column.square
            free[joint] = (column.power - both**2 / mine) / column.square
            slope[joint] = both / mine
        return _Match(np.maximum(fixed, 0.0), np.maximum(free, 0.0), slope)

    def _finer(self, convention: Convention) -> Convention:
        """The convention with each zero at the angle that suits best."""
        for joint, angle in enumerate(convention.zero):
            if angle == 0:
                continue
            found = minimize_scalar(
                lambda value, j=joint, c=convention: -self.score(c.with_value("zero", j, float(value))),
                bounds=(angle - ZERO_STEP, angle + ZERO_STEP),
                method="bounded",
                options={"xatol": 1e-3},
            )
            convention = convention.with_value("zero", joint, float(found.x))
        return convention


def _threes(pairs: Sequence[tuple[int, int]], joints: Sequence[int]) -> Iterator[tuple[int, ...]]:
    """Every cycle of three of these joints, two of them such a pair, once; from its first joint."""
    found: dict[tuple[int, ...], None] = {}
    for one, other in pairs:
        for third in joints:
            if third not in (one, other):
                for a, b, c in ((one, other, third), (other, one, third)):
                    found[min((a, b, c), (b, c, a), (c, a, b))] = None
    yield from found


def _passed_round(order: tuple[int, ...], places: Sequence[int]) -> tuple[int, ...]:
    """The order with the columns of these joints passed round: each has that of the next."""
    moved = list(order)
    for place, follower in zip(places, (*places[1:], places[0]), strict=True):
        moved[place] = order[follower]
    return tuple(moved)


def _signs(turned: NDArray[np.int64]) -> tuple[float, ...]:
    """Signs of joints, -1 of those that are turned (n,), as 0 or 1."""
    return tuple(np.where(turned == 1, -1.0, 1.0).tolist())
