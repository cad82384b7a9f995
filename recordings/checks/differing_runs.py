"""Runs that differ: another load, other offsets or other friction in one of them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

from identification.parameters import COULOMB, INERTIAL, MASS, OFFSET, PER_JOINT, VISCOUS
from identification.regressor import regressor
from identification.springs import spring_torque

from .convention import chain_of, read_by
from .finding import Finding, Severity
from .model_fit import LEAST_LEFT, MOST_INDEPENDENT, PER_SECOND
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
    names = list(subject.recordings)
    if len(names) < 2 or subject.samples is None or subject.searched is None:
        return []
    found = []
    for each in differences(subject):
        name, joints = names[each.run], subject.robot.joint_names
        if each.kind == "payload":
            mass, deviation = each.values[MASS], each.deviations[MASS]
            load = f"{mass:.2g} ± {deviation:.1g} kg"
            sentence = f"{name} carries {load} that the other runs do not; fit it as a payload"
        elif each.kind == "offsets":
            largest = int(np.argmax(np.abs(each.values) / each.deviations))
            offset = f"{each.values[largest]:.2g} ± {each.deviations[largest]:.1g}"
            sentence = (
                f"{name} has other torque offsets, {offset} N·m (N) at {joints[largest]}: another "
                "day's zero of the torque sensors?"
            )
        else:
            half = len(each.values) // 2
            largest = int(np.argmax(np.abs(each.values[half:]) / each.deviations[half:]))
            value = each.values[half + largest]
            sentence = (
                f"{name} has other friction, {value:+.2g} N·m (N) of Coulomb friction at {joints[largest]}: "
                "warm and cold?"
            )
        found.append(Finding(Severity.WARN, "runs_differ", sentence, run=name))
    return found


def differences(subject: Subject) -> list[Difference]:
    """The most likely difference of each run, one after the other, as long as one is certain."""
    fit, taken = _JointFit(subject), list[tuple[int, str]]()
    found = list[Difference]()
    base = fit.evidence(taken)[0]
    tried = [(run, kind) for run in range(fit.runs) for kind in fit.kinds]
    while len(taken) < fit.runs - 1:
        scored = []
        for each in tried:
            if each[0] in {run for run, _ in taken}:
                continue
            evidence, values, deviations = fit.evidence([*taken, each])
            if each[1] == "payload" and values[MASS] < KNOWN * deviations[MASS]:
                continue
            scored.append((evidence - base - PER_DIFFERENCE, each, values, deviations))
        if not scored:
            break
        odds, each, values, deviations = max(scored, key=lambda one: one[0])
        if odds < ODDS:
            break
        taken.append(each)
        base += odds
        found.append(Difference(each[0], each[1], odds, values, deviations))
    return found


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
        length = float(np.max(np.linalg.norm(chain.translation, axis=1), initial=0.1))
        tool = np.concatenate([np.full(6, mass * length**2), np.full(3, mass * length), [mass]])
        # A tool hangs where the arm ends.
        tool[:9] /= 4
        joints = PER_JOINT * np.arange(self.n)
        last = PER_JOINT * (self.n - 1)
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
        self.rows = rows
        self.widths = subject.fit.widths
        seconds = PER_SECOND * read.seconds
        self.independent = min(seconds, MOST_INDEPENDENT * self.runs, len(read.q))

    def evidence(self, taken: list[tuple[int, str]]) -> tuple[float, Array, Array]:
        """Its logarithm with these runs' differences; values and deviations of the last one."""
        parts = [self.rows * self.widths]
        widths = np.ones(0)
        for run, kind in taken:
            columns, width = self.kinds[kind]
            own = (self.read.run == run)[:, None, None]
            parts.append(np.where(own, self.rows[:, :, columns] * width, 0.0))
            widths = width
        x = np.concatenate(parts, axis=2)
        grams, products, squares, counts, floors = [], [], [], [], []
        for joint in range(self.n):
            used = self.read.moves[:, joint]
            if used.sum() < 12:
                continue
            own, y = x[used, joint], self.gap[used, joint]
            grams.append(own.T @ own)
            products.append(own.T @ y)
            squares.append(float(y @ y))
            counts.append(int(used.sum()))
            floors.append(self.floors[joint])
        g, b, c, m, floor = (np.array(each) for each in (grams, products, squares, counts, floors))
        weight, variance = self.independent * m / len(self.read.q), np.maximum(c / m, floor)
        for _ in range(ITERATIONS):
            a = np.tensordot(weight / m / variance, g, axes=1) + np.eye(x.shape[2])
            factor = cho_factor(a)
            z = cho_solve(factor, (weight / m / variance) @ b)
            rest = np.maximum(c - 2 * b @ z + np.einsum("jik,i,k->j", g, z, z), 0.0)
            variance = np.maximum(rest / m, floor)
        log_determinant = 2 * float(np.sum(np.log(np.diag(factor[0]))))
        fits = -weight * 0.5 * (np.log(variance) + rest / m / variance)
        evidence = float(fits.sum()) - 0.5 * float(z @ z) - 0.5 * log_determinant
        count = len(widths)
        if not count:
            return evidence, np.zeros(0), np.zeros(0)
        covariance = cho_solve(factor, np.eye(x.shape[2]))[-count:, -count:]
        return evidence, z[-count:] * widths, np.sqrt(np.diag(covariance)) * widths
