"""Runs that differ: another load, other offsets or other friction in some of them."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

from identification.parameters import COULOMB, INERTIAL, MASS, OFFSET, PER_JOINT, VISCOUS
from identification.regressor import regressor
from identification.springs import spring_torque

from .convention import chain_of, read_by
from .finding import Finding, Severity
from .model_fit import FEWEST, LEAST_LEFT, MOST_INDEPENDENT, PER_SECOND
from .samples import MOST, Samples, slow_samples
from .subject import Subject

Array = NDArray[np.float64]

STAGE = 3

# Logarithm of the odds by which a run differs, and what a further difference costs.
ODDS, PER_DIFFERENCE = 12.0, 6.0
# A payload, as a share of the arm's moving mass, one standard deviation; offsets and friction, of a joint's
# torque.
PAYLOAD, OFFSETS, FRICTION = 0.3, 0.15, 0.3
# A payload is known where its mass is so many of its deviations.
KNOWN = 3.0
ITERATIONS = 8


@dataclass(frozen=True)
class Difference:
    """Payload, offsets or friction of one run that the other runs do not share.

    run: its index. kind: payload, offsets or friction. odds: logarithm. values, deviations: estimates of its
    parameters and their standard deviations.
    """

    run: int
    kind: str
    odds: float
    values: Array
    deviations: Array


def check(subject: Subject) -> list[Finding]:
    """The runs that others predict worse than they must, and what sets them apart."""
    names, joints = list(subject.recordings), subject.robot.joint_names
    if len(names) < 2 or subject.samples is None or subject.searched is None:
        return []
    found = []
    differing = differences(subject)
    if loads := [each for each in differing if each.kind == "payload"]:
        masses = [f"{each.values[MASS]:.2g} ± {each.deviations[MASS]:.1g} kg" for each in loads]
        carried = [f"{names[each.run]} {mass}" for each, mass in zip(loads, masses, strict=True)]
        carried[0] = f"{names[loads[0].run]} carries {masses[0]}"
        sentence = f"{', '.join(carried)} that the other runs do not; fit it as a payload"
        found.append(_finding(sentence, names[loads[0].run] if len(loads) == 1 else ""))
    for each in differing:
        name = names[each.run]
        if each.kind == "offsets":
            largest = int(np.argmax(np.abs(each.values) / each.deviations))
            offset = f"{each.values[largest]:.2g} ± {each.deviations[largest]:.1g}"
            sentence = (
                f"{name} has other torque offsets, {offset} N·m (N) at {joints[largest]}: another "
                "day's zero of the torque sensors?"
            )
            found.append(_finding(sentence, name))
        elif each.kind == "friction":
            half = len(each.values) // 2
            largest = int(np.argmax(np.abs(each.values[half:]) / each.deviations[half:]))
            value = each.values[half + largest]
            sentence = (
                f"{name} has other friction, {value:+.2g} N·m (N) of Coulomb friction at {joints[largest]}: "
                "warm and cold?"
            )
            found.append(_finding(sentence, name))
    return found


def _finding(sentence: str, run: str = "") -> Finding:
    return Finding(Severity.WARN, "runs_differ", sentence, run=run)


def differences(subject: Subject) -> list[Difference]:
    """The most likely differences of one kind after the other, as long as they are certain."""
    fit, found = _JointFit(subject), list[Difference]()
    while True:
        taken = [(each.run, each.kind) for each in found]
        left = [run for run in range(fit.runs) if run not in {own for own, _ in taken}]
        groups = [_group(fit, taken, left, kind) for kind in fit.kinds] if len(left) > 1 else []
        _, group = max(groups, key=lambda one: one[0], default=(0.0, []))
        if not group:
            return found
        found += group


def _group(
    fit: "_JointFit", taken: list[tuple[int, str]], left: list[int], kind: str
) -> tuple[float, list[Difference]]:
    """The runs among those left that surely have a difference of this kind, and the odds of them all."""
    runs = left
    if not taken:
        # One run is like the robot: the one that carries least, or that is nearest to the others.
        _, found, known = fit.evidence([(run, kind) for run in runs])
        values, deviations = np.array(found), np.array(known)
        if kind == "payload":
            apart = values[:, MASS]
        else:
            apart = np.abs((values[:, None] - values) / deviations[:, None]).sum(axis=(1, 2))
        runs = [run for run in runs if run != runs[int(np.argmin(apart))]]
    while runs:
        all_of_them = [*taken, *((run, kind) for run in runs)]
        evidence, found, known = fit.evidence(all_of_them)
        own = list[Difference]()
        for place, each in enumerate(all_of_them[len(taken) :], len(taken)):
            others = all_of_them[:place] + all_of_them[place + 1 :]
            odds = evidence - fit.evidence(others)[0] - PER_DIFFERENCE
            value, deviation = found[place], known[place]
            if odds > ODDS and (kind != "payload" or value[MASS] > KNOWN * deviation[MASS]):
                own.append(Difference(each[0], kind, odds, value, deviation))
        if len(own) == len(runs):
            return evidence - fit.evidence(taken)[0] - PER_DIFFERENCE * len(runs), own
        runs = [each.run for each in own]
    return 0.0, []


class _JointFit:
    """All runs by one set of parameters, with what some of them have of their own."""

    def __init__(self, subject: Subject):
        assert subject.searched is not None
        assert subject.fit is not None
        best = subject.searched[1]
        robot, recordings = subject.robot, list(subject.recordings.values())
        samples = slow_samples(recordings, MOST * 2)
        assert samples is not None
        chain, read = chain_of(robot.chain, best.convention), read_by(samples, best.convention)
        self.read: Samples = read
        self.n, self.runs = robot.joints, len(recordings)
        rows = regressor(chain, read.q, read.dq, read.ddq, threads=1)
        self.gap = read.torque - spring_torque(chain.springs, read.q) - rows @ robot.parameters
        rms = np.maximum(np.sqrt(np.mean(read.torque**2, axis=0)), 1e-9)
        self.floors = (LEAST_LEFT * rms) ** 2
        table = robot.parameters.reshape(-1, PER_JOINT)
        mass = PAYLOAD * float(table[:, MASS].sum())
        length = float(np.max(np.linalg.norm(chain.tree.translation, axis=1), initial=0.1))
        tool = np.concatenate([np.full(6, mass * length**2), np.full(3, mass * length), [mass]])
        # A tool hangs where the arm ends.
        tool[:9] /= 4
        joints = PER_JOINT * np.arange(self.n)
        last = PER_JOINT * chain.last
        self.kinds = {
            "payload": (last + np.arange(INERTIAL), tool),
            "offsets": (joints + OFFSET, OFFSETS * rms),
            "friction": (
                np.concatenate([joints + VISCOUS, joints + COULOMB]),
                np.concatenate(
                    [FRICTION * rms / np.maximum(np.sqrt(np.mean(read.dq**2, axis=0)), 1e-3), FRICTION * rms]
                ),
            ),
        }
        self.widths = subject.fit.widths
        self._sum_up(rows)
        seconds = PER_SECOND * read.seconds
        self.independent = min(seconds, MOST_INDEPENDENT * self.runs, len(read.q))

    def _sum_up(self, rows: Array) -> None:
        """Products of each run's rows (N, n, p), a joint that moves enough: all that a fit needs."""
        moves = self.read.moves
        self.joints = np.flatnonzero(moves.sum(axis=0) >= FEWEST)
        count, p = len(self.joints), rows.shape[2]
        self.xx, self.xy = np.zeros((self.runs, count, p, p)), np.zeros((self.runs, count, p))
        self.yy, self.counts = np.zeros(count), np.zeros(count)
        for place, joint in enumerate(self.joints):
            for run in range(self.runs):
                used = moves[:, joint] & (self.read.run == run)
                x, y = rows[used, joint], self.gap[used, joint]
                self.xx[run, place], self.xy[run, place] = x.T @ x, x.T @ y
                self.yy[place] += float(y @ y)
                self.counts[place] += int(used.sum())

    def evidence(self, taken: list[tuple[int, str]]) -> tuple[float, list[Array], list[Array]]:
        """Its logarithm with these runs' differences; values and deviations of each."""
        p, own = self.xx.shape[2], [(run, *self.kinds[kind]) for run, kind in taken]
        starts = p + np.cumsum([0, *(len(columns) for _, columns, _ in own)])
        g = np.zeros((len(self.joints), starts[-1], starts[-1]))
        b = np.zeros((len(self.joints), starts[-1]))
        g[:, :p, :p] = self.xx.sum(axis=0) * np.outer(self.widths, self.widths)
        b[:, :p] = self.xy.sum(axis=0) * self.widths
        for (run, columns, widths), start in zip(own, starts[:-1], strict=True):
            part, xx = slice(start, start + len(columns)), self.xx[run]
            g[:, :p, part] = xx[:, :, columns] * np.outer(self.widths, widths)
            g[:, part, :p] = np.swapaxes(g[:, :p, part], 1, 2)
            g[:, part, part] = xx[:, columns[:, None], columns] * np.outer(widths, widths)
            b[:, part] = self.xy[run][:, columns] * widths
        c, m, floor = self.yy, self.counts, self.floors[self.joints]
        weight, variance = self.independent * m / len(self.read.q), np.maximum(c / m, floor)
        for _ in range(ITERATIONS):
            a = np.tensordot(weight / m / variance, g, axes=1) + np.eye(starts[-1])
            factor = cho_factor(a)
            z = cho_solve(factor, (weight / m / variance) @ b)
            rest = np.maximum(c - 2 * b @ z + np.einsum("jik,i,k->j", g, z, z, optimize=True), 0.0)
            variance = np.maximum(rest / m, floor)
        log_determinant = 2 * float(np.sum(np.log(np.diag(factor[0]))))
        fits = -weight * 0.5 * (np.log(variance) + rest / m / variance)
        evidence = float(fits.sum()) - 0.5 * float(z @ z) - 0.5 * log_determinant
        root = np.sqrt(np.diag(cho_solve(factor, np.eye(starts[-1]))))
        parts = [slice(start, stop) for start, stop in pairwise(starts)]
        widths_of = [widths for _, _, widths in own]
        values = [z[part] * widths for part, widths in zip(parts, widths_of, strict=True)]
        return evidence, values, [root[part] * widths for part, widths in zip(parts, widths_of, strict=True)]
