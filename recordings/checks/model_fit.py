"""How well a model explains samples under a convention, by masses, rotors and friction that it may have.

The parameters are Gaussian about the model's, as wide as CAD and data sheets are off
(identification/prior.py); what they leave at a joint has its own variance. The logarithm of the likelihood,
with the parameters integrated out (MacKay, "Bayesian interpolation", Neural Computation 4(3), 1992), compares
conventions: a model that is a little wrong everywhere costs little, one that must be bent far costs much.

A joint that stands still determines its gravity torque to within its friction, once a run.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

from identification.inverse_dynamics import inverse_dynamics
from identification.parameters import ARMATURE, COULOMB, PER_JOINT, VISCOUS
from identification.prior import COULOMB_SHARE, parameter_widths
from identification.regressor import regressor
from identification.springs import spring_torque
from testbench.robot import Robot

from .convention import Convention, chain_of, read_by
from .samples import Samples

Array = NDArray[np.float64]

# What no model explains of a joint's torque at best: its share, RMS.
LEAST_LEFT = 0.02
# Samples are as many as their band and time allow, and no more than this: what a model lacks is no noise.
PER_SECOND, MOST_INDEPENDENT = 2.0, 40.0
# A joint needs so many samples in motion to count.
FEWEST = 12
# Of a parameter's width: it is as good as known.
NEXT_TO_NONE = 1e-3
# N·m (N), RMS, where nothing is known of a torque.
LEAST_TORQUE = 1e-9
# rad/s and rad/s² (m/s, m/s²), RMS, that a joint which hardly moves is taken to have.
SLOWEST = 1e-3
# Rounds between parameters and variances, and where they have settled.
ITERATIONS, SETTLED = 10, 0.03


@dataclass(frozen=True)
class Explained:
    """evidence: logarithm. left: (n,) share of each joint's torque, RMS, that is left; NaN where none counts.

    parameters: (14 n,), the likeliest. bent: by how many widths the parameters are off, all together, a
    joint.
    """

    evidence: float
    left: Array
    parameters: Array
    bent: float


class ModelFit:
    """A robot's model and samples of its logs."""

    def __init__(self, robot: Robot, samples: Samples):
        self.robot, self.samples = robot, samples
        self.torque_rms = np.sqrt(np.mean(samples.torque**2, axis=0))
        model = self.model(samples)
        rms = np.sqrt(np.mean(model**2, axis=0))
        # A joint that the model has no torque of is judged by what is measured there.
        self.typical: Array = np.asarray(rms, dtype=np.float64)
        self.typical[rms == 0] = np.maximum(self.torque_rms, LEAST_TORQUE)[rms == 0]
        speed, acceleration = (
            np.maximum(np.sqrt(np.mean(each**2, axis=0)), SLOWEST) for each in (samples.dq, samples.ddq)
        )
        self.widths = _with_any_drive(
            robot, parameter_widths(robot.parameters, self.typical, speed, acceleration), speed, acceleration
        )
        friction = np.stack([robot.parameters, self.widths]).reshape(2, -1, PER_JOINT)[
            :, : robot.joints, COULOMB
        ]
        # N·m (N): what a joint may hold at rest, and what no model explains.
        self.holds = np.sqrt(np.sum(friction**2, axis=0) + (LEAST_LEFT * self.torque_rms) ** 2)
        self._products: dict[Convention, tuple[_Products, _Products]] = {}
        self.independent = min(PER_SECOND * samples.seconds, MOST_INDEPENDENT, len(samples.q))

    def model(self, samples: Samples, convention: Convention | None = None) -> Array:
        """The torque (M, n) of the model as given along samples that are read already."""
        chain = self.robot.chain if convention is None else chain_of(self.robot.chain, convention)
        return inverse_dynamics(chain, self.robot.parameters, samples.q, samples.dq, samples.ddq, threads=1)

    def without_friction_and_rotors(self) -> "ModelFit":
        """The same with a model that surely has neither, as torque between drive and link has it."""
        table = self.robot.parameters.reshape(-1, PER_JOINT).copy()
        widths = self.widths.reshape(-1, PER_JOINT).copy()
        table[:, [ARMATURE, VISCOUS, COULOMB]] = 0.0
        widths[:, [ARMATURE, VISCOUS, COULOMB]] *= NEXT_TO_NONE
        fit = ModelFit(replace(self.robot, parameters=table.ravel()), self.samples)
        fit.widths = widths.ravel()
        return fit

    def under(self, convention: Convention) -> Explained:
        """How well the model explains the samples if the log counts by this convention."""
        n = self.robot.joints
        as_logged = replace(convention, torque_sign=(1.0,) * n, scale=(1.0,) * n)
        if as_logged not in self._products:
            self._products.clear()
            self._products[as_logged] = self._regressed(as_logged)
        (at, standing), left = self._products[as_logged], np.full(n, np.nan)
        if not len(at.joints):
            return Explained(0.0, left, self.robot.parameters, 0.0)
        scale = np.array(convention.scale)[at.joints]
        b, c = at.less_the_model(convention)
        held = standing.less_the_model(convention)
        holds = self.holds[standing.joints] ** 2
        once = standing.runs / standing.samples / holds
        floors = (LEAST_LEFT * at.torque_rms / scale) ** 2
        weight, variance = (
            self.independent * at.samples / len(self.samples.q),
            np.maximum(c / at.samples, floors),
        )
        for _ in range(ITERATIONS):
            each = weight / at.samples / variance
            a = np.eye(len(self.widths))
            at.add_information(a, each)
            standing.add_information(a, once)
            factorised = cho_factor(a)
            z = cho_solve(factorised, each @ b + once @ held[0])
            rest = np.maximum(c - 2 * b @ z + at.squares(z), 0.0)
            before, variance = variance, np.maximum(rest / at.samples, floors)
            if np.allclose(before, variance, rtol=SETTLED):
                break
        log_determinant = 2 * float(np.sum(np.log(np.diag(factorised[0]))))
        fits = -weight * (0.5 * np.log(variance) + np.log(scale) + 0.5 * rest / at.samples / variance)
        rests = held[1] - 2 * held[0] @ z + standing.squares(z)
        evidence = float(fits.sum() - 0.5 * once @ rests) - 0.5 * float(z @ z) - 0.5 * log_determinant
        left[at.joints] = np.sqrt(rest / at.samples) * scale / at.torque_rms
        bent = float(np.sqrt(z @ z / len(at.joints)))
        return Explained(evidence, left, self.robot.parameters + self.widths * z, bent)

    def _regressed(self, convention: Convention) -> tuple["_Products", "_Products"]:
        """The products that a fit needs, of the joints that move, and of those that stand still.

        A column of torques counts where the positions of its own name move, whatever the convention: one
        that chose its samples could leave out what speaks against it.
        """
        chain, read = chain_of(self.robot.chain, convention), read_by(self.samples, convention)
        rows = regressor(chain, read.q, read.dq, read.ddq, threads=1)
        model = rows @ self.robot.parameters + spring_torque(chain.springs, read.q)
        moves = self.samples.moves[:, list(convention.torque_order)]
        power = np.sum(np.where(moves, read.torque, 0.0) ** 2, axis=0)
        counts = (moves.sum(axis=0) >= FEWEST) & (power > 0)
        stands = ~moves.any(axis=0) & np.any(read.torque != 0, axis=0)
        # At rest, friction has any size and sign.
        without = rows.reshape(*rows.shape[:2], -1, PER_JOINT).copy()
        without[..., [VISCOUS, COULOMB]] = 0.0
        steady = without.reshape(rows.shape)
        return (
            self._products_of(np.flatnonzero(counts), moves, rows, model, read),
            self._products_of(
                np.flatnonzero(stands), ~moves, steady, model - (rows - steady) @ self.robot.parameters, read
            ),
        )

    def _products_of(
        self, joints: NDArray[np.int64], where: NDArray[np.bool_], rows: Array, model: Array, read: Samples
    ) -> "_Products":
        shape = (len(joints), len(self.widths))
        grams, torque_products, model_products = [], np.zeros(shape), np.zeros(shape)
        figures = np.zeros((5, len(joints)))
        for index, joint in enumerate(joints.tolist()):
            used = where[:, joint]
            x, torque, own = rows[used, joint] * self.widths, read.torque[used, joint], model[used, joint]
            counts = self.robot.chain.loading(joint)
            x = x[:, counts]
            grams.append((counts, x.T @ x))
            torque_products[index, counts] = x.T @ torque
            model_products[index, counts] = x.T @ own
            runs = len(np.unique(read.run[used]))
            figures[:, index] = len(torque), runs, torque @ torque, torque @ own, own @ own
        return _Products(joints, tuple(grams), torque_products, model_products, *figures)


def _with_any_drive(robot: Robot, widths: Array, speed: Array, acceleration: Array) -> Array:
    """The widths (14 links,) where friction and rotors that the model only guesses are as wide as a drive's.

    They are a guess where the model has none, or the same number for drives of different torque limits.
    speed, acceleration: (n,) rad/s and rad/s² (m/s and m/s²), typical.
    """
    n, limit = robot.joints, np.where(np.isfinite(robot.limits.torque), robot.limits.torque, 0.0)
    table, wide = (each.reshape(-1, PER_JOINT).copy() for each in (robot.parameters, widths))
    for column, unit in ((COULOMB, np.ones(n)), (VISCOUS, speed), (ARMATURE, acceleration)):
        given = table[:n, column]
        is_guess = (given == 0) | (np.ptp(given) == 0 < np.ptp(limit))
        of_drive = np.where(is_guess, COULOMB_SHARE * limit / unit, 0.0)
        wide[:n, column] = np.maximum(wide[:n, column], of_drive)
    return wide.ravel()


@dataclass(frozen=True)
class _Products:
    """Products of the scaled regressors and the torques of the joints that count, (k,) each.

    grams: of each joint, which of p = 14 a link parameters may count there, and their products.
    torque_products, model_products: (k, p), with the torque and with the model's. samples: that count. runs:
    that have these. torque_square, both, model_square: of both torques.
    """

    joints: NDArray[np.int64]
    grams: tuple[tuple[slice, Array], ...]
    torque_products: Array
    model_products: Array
    samples: Array
    runs: Array
    torque_square: Array
    both: Array
    model_square: Array

    @property
    def torque_rms(self) -> Array:
        """(k,) as logged."""
        return np.sqrt(self.torque_square / self.samples)

    def add_information(self, total: Array, weight: Array) -> None:
        """Add all joints' products, each times its weight (k,), to a matrix (p, p)."""
        for (counts, gram), each in zip(self.grams, weight.tolist(), strict=True):
            total[counts, counts] += each * gram

    def squares(self, z: Array) -> Array:
        """(k,) squared torque of each joint by scaled parameters (p,)."""
        return np.array([z[counts] @ gram @ z[counts] for counts, gram in self.grams])

    def less_the_model(self, convention: Convention) -> tuple[Array, Array]:
        """Products (k, p) and squares (k,) of the torque over its factor, less the model's."""
        factor = (np.array(convention.torque_sign) / np.array(convention.scale))[self.joints]
        products = factor[:, None] * self.torque_products - self.model_products
        return products, factor**2 * self.torque_square - 2 * factor * self.both + self.model_square
