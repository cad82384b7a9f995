"""One logged run, with what the model says along it: the ground that signatures are made from."""

from collections.abc import Callable, Hashable
from dataclasses import dataclass, field, fields, replace
from functools import cached_property, partial
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline

from identification.chain import Chain
from identification.filtering import central_difference, zero_phase_lowpass
from identification.inverse_dynamics import inverse_dynamics
from identification.kinematics import kernel
from identification.parameters import ARMATURE, COULOMB, INERTIAL, OFFSET, PER_JOINT, VISCOUS

from ..log import Recording
from ..robot import Limits, Robot

Array = NDArray[np.float64]

# Central difference of an analytic function: truncation and rounding both below 1e-9 of the torque.
ANGLE_STEP = 1e-5
# Samples of the load's derivatives in a period of the cut-off.
SPLINE_SAMPLES = 8
# Joints whose derivatives of the load are kept, at most so many bytes of them: effects are made for a few
# joints at a time. So many samples of them are made at once.
DERIVATIVES, MOST_BYTES, AT_ONCE = 3, 1 << 27, 1 << 14
# What a run has of every sample.
PER_SAMPLE = (
    "time",
    "q",
    "dq",
    "ddq",
    "tau",
    "temperature",
    "torque_command",
    "reference_position",
    "reference_velocity",
    "reference_acceleration",
    "carried",
    "beside",
)


@dataclass(frozen=True)
class Logged:
    """One run, with what the model says along it. N samples, n joints; SI units at the joint.

    chain: kinematics. parameters: (14 links,) standard parameters as last estimated. nominal: likewise of the
    model as given. limits: of the joints. time: (N,) s, uniform. sample_rate: Hz. cutoff: Hz, of the
    low-pass behind q, dq and ddq. q, dq, ddq: (N, n) filtered at the full rate. tau: (N, n) measured
    torque at the full rate. temperature: (N, n) degC. torque_command: (N, n) N·m. reference_position,
    reference_velocity, reference_acceleration: (N, n). body_rotation (3, 3), body_origin (3,) m: the last
    body's frame in the last link's (``body_in_link``), in which the contract states a payload. carried:
    (N, n) N·m, torque of effects behind the gearboxes that are known already. beside: likewise of all others.
    coulomb_smoothing, coulomb_lead: (n,) rad/s (m/s) and s, w and l of Coulomb friction fc tanh(u / w) with
    u = dq + l ddq; fc sgn u for w = 0, as everywhere where it is left out. zeros: (n,) rad, by which joints
    are known to read too much.
    """

    chain: Chain
    parameters: Array
    nominal: Array
    limits: Limits
    time: Array
    sample_rate: float
    cutoff: float
    q: Array
    dq: Array
    ddq: Array
    tau: Array
    temperature: Array | None = None
    torque_command: Array | None = None
    reference_position: Array | None = None
    reference_velocity: Array | None = None
    reference_acceleration: Array | None = None
    body_rotation: Array = field(default_factory=lambda: np.eye(3))
    body_origin: Array = field(default_factory=lambda: np.zeros(3))
    carried: Array | None = None
    beside: Array | None = None
    coulomb_smoothing: Array | None = None
    coulomb_lead: float = 0.0
    zeros: Array | None = None

    def part(self, samples: slice) -> "Logged":
        """Some samples of the run, of which nothing is copied."""
        series = {name: getattr(self, name) for name in PER_SAMPLE}
        kept: dict[str, Any] = {name: w if w is None else w[samples] for name, w in series.items()}
        return replace(self, **kept)

    def thinned(self, every: int) -> "Logged":
        """One in so many samples, where the others add no information on the motion."""
        if every == 1:
            return self
        series = {name: getattr(self, name) for name in PER_SAMPLE}
        kept: dict[str, Any] = {name: w if w is None else w[::every].copy() for name, w in series.items()}
        return replace(self, sample_rate=self.sample_rate / every, **kept)

    @property
    def samples(self) -> int:
        """Number of samples, N."""
        return len(self.q)

    @property
    def joints(self) -> int:
        """Number of joints, n."""
        return self.chain.joints

    @cached_property
    def load(self) -> Array:
        """Torque the gearboxes carry by the model: links and springs, no rotors and friction, (N, n) N·m.

        With what is known to act behind them.
        """
        rigid = inverse_dynamics(self.chain, self._links, self.q, self.dq, self.ddq)
        return rigid if self.carried is None else rigid + self.carried

    @cached_property
    def direction(self) -> Array:
        """Share of its Coulomb friction that each joint has, with the sign of its speed, (N, n)."""
        sign = np.sign(self.turning)
        if self.coulomb_smoothing is not None:
            soft = np.flatnonzero(self.coulomb_smoothing)
            sign[:, soft] = np.tanh(self.turning[:, soft] / self.coulomb_smoothing[soft])
        return sign

    @property
    def turning(self) -> Array:
        """What Coulomb friction changes its sign with, (N, n) rad/s (m/s): the speed a little later."""
        return self.dq + self.coulomb_lead * self.ddq

    @property
    def friction(self) -> Array:
        """Viscous and Coulomb friction and offset by the model, (N, n) N·m."""
        table = self.table
        return table[:, VISCOUS] * self.dq + table[:, COULOMB] * self.direction + table[:, OFFSET]

    def friction_at(self, joint: int) -> Array:
        """The same at one joint, (N,) N·m."""
        own = self.table[joint]
        return own[VISCOUS] * self.dq[:, joint] + own[COULOMB] * self.direction[:, joint] + own[OFFSET]

    @cached_property
    def predicted(self) -> Array:
        """Drive torque by the model, (N, n) N·m: load, rotors and friction; never the measured torque."""
        return self.load + self.table[:, ARMATURE] * self.ddq + self.friction

    def predicted_rate(self, joint: int) -> Array:
        """Time derivative of ``predicted`` at a joint, (N,) N·m/s; a jump of Coulomb friction is a spike."""
        # Of two samples, so that a jump touches no others.
        return np.gradient(self.predicted[:, joint], 1 / self.sample_rate, edge_order=2)

    @cached_property
    def residual(self) -> Array:
        """Measured torque less predicted and known, (N, n) N·m: to look for effects, never to regress on."""
        left = self.tau - self.predicted
        return left if self.beside is None else left - self.beside

    def as_predicted(self) -> "Logged":
        """The run with the torque that the model predicts: nothing measured, commanded or known beside it."""
        return replace(self, tau=self.predicted, torque_command=None, beside=None)

    @cached_property
    def table(self) -> Array:
        """The standard parameters of the joints' own links as (n, 14)."""
        return self.parameters.reshape(-1, PER_JOINT)[: self.joints]

    @cached_property
    def gravity_load(self) -> Array:
        """Gravity's share of ``load``, (N, n) N·m."""
        still = np.zeros_like(self.q)
        return inverse_dynamics(self.chain.without_springs(), self._links, self.q, still, still)

    def load_change(self, joint: int, displacement: Array) -> Array:
        """First-order change of ``load``, (N, n) N·m, where link coordinate ``joint`` is q + displacement.

        displacement: of it and its first two time derivatives, rad, rad/s, rad/s²: (N, 3), or (1, 3) where
        nothing moves.
        """
        change = np.empty((self.samples, self.joints))
        each = np.ascontiguousarray(displacement)
        if len(each) < self.samples:
            each = np.repeat(each, self.samples, axis=0)
        _combine(*self.load_derivatives(joint), each, change)
        return change

    def load_elsewhere(self, joint: int, by: float) -> Array:
        """Change of ``load``, (N, n) N·m, where link coordinate ``joint`` is by so much more, rad: exact."""
        here, there = (
            inverse_dynamics(self.chain, self._links, q, self.dq, self.ddq)
            for q in (self.q, self.q + by * np.eye(self.joints)[joint])
        )
        return there - here

    @property
    def _links(self) -> Array:
        """The standard parameters with rotors and friction left out, (14 links,)."""
        table = self.parameters.reshape(-1, PER_JOINT).copy()
        table[:, INERTIAL:] = 0.0
        return table.ravel()

    def let_go(self) -> None:
        """Forget all that was made of this run so far; whatever is asked for again is made again."""
        for name in self.__dict__.keys() - {each.name for each in fields(self)}:
            self.__dict__.pop(name, None)

    @property
    def joints_kept(self) -> int:
        """Number of joints whose derivatives of the load are kept at a time."""
        return min(DERIVATIVES, max(MOST_BYTES // (3 * self.q.nbytes), 1))

    @cached_property
    def _derivatives(self) -> dict[int, "_Derivatives"]:
        return {}

    def load_derivatives(self, joint: int) -> tuple[Array, Array, Array]:
        """d load / d(q, dq, ddq) of one joint, each (N, n)."""
        return self._derivatives_of(joint).each

    def kept_with_derivatives(self, joint: int) -> dict[Hashable, tuple[Array, ...]]:
        """What else was made of one joint's derivatives, by its name: kept as long as they are."""
        return self._derivatives_of(joint).made_of_them

    def _derivatives_of(self, joint: int) -> "_Derivatives":
        kept = self._derivatives
        if (found := kept.get(joint)) is None:
            # The motion has nothing above the cut-off, so a coarse grid and a cubic spline carry them.
            step = max(int(self.sample_rate / (SPLINE_SAMPLES * self.cutoff)), 1)
            grid = np.unique(np.r_[0 : self.samples : step, self.samples - 1])
            values: Callable[[NDArray[np.int64]], Array] = partial(self._load_derivatives_at, joint)
            if step > 1 and len(grid) > 3:
                values = make_interp_spline(grid, values(grid))
            # Those of all joints are most of what a run would hold: old ones go before new ones come.
            for old in list(kept)[: max(len(kept) - self.joints_kept + 1, 0)]:
                kept.pop(old, None)
            made = np.empty((3, self.samples, self.joints))
            for first in range(0, self.samples, AT_ONCE):
                part = np.arange(first, min(first + AT_ONCE, self.samples))
                for whole, own in zip(made, np.split(values(part), 3, axis=1), strict=True):
                    whole[part] = own
            found = kept[joint] = _Derivatives((made[0], made[1], made[2]))
        return found

    def _load_derivatives_at(self, joint: int, samples: NDArray[np.int64]) -> Array:
        """Derivatives by q, dq and ddq of one joint, side by side, (K, 3 n)."""
        unit = np.eye(self.joints)[joint]
        q, dq, ddq = self.q[samples], self.dq[samples], self.ddq[samples]

        # So few samples that handing them to threads would cost more than it saves.
        def load(q: Array, dq: Array, ddq: Array) -> Array:
            return inverse_dynamics(self.chain, self._links, q, dq, ddq, threads=1)

        turn = ANGLE_STEP * unit
        weightless = replace(self.chain.without_springs(), gravity=np.zeros(3))
        still = np.zeros_like(q)
        return np.hstack(
            [
                (load(q + turn, dq, ddq) - load(q - turn, dq, ddq)) / (2 * ANGLE_STEP),
                # Torque is quadratic in the velocities, so any step is exact there.
                (load(q, dq + unit, ddq) - load(q, dq - unit, ddq)) / 2,
                inverse_dynamics(weightless, self._links, q, still, still + unit, threads=1),
            ]
        )


@dataclass(frozen=True)
class _Derivatives:
    """d load / d(q, dq, ddq) of one joint, each (N, n), and what was made of them."""

    each: tuple[Array, Array, Array]
    made_of_them: dict[Hashable, tuple[Array, ...]] = field(default_factory=dict)


@kernel
def _combine(first: Array, second: Array, third: Array, weights: Array, out: Array) -> None:
    """Three arrays (N, n) weighted by a sample's (N, 3), summed."""
    for t in range(out.shape[0]):
        for j in range(out.shape[1]):
            out[t, j] = (
                first[t, j] * weights[t, 0] + second[t, j] * weights[t, 1] + third[t, j] * weights[t, 2]
            )


def logged_run(robot: Robot, recording: Recording, parameters: Array, cutoff: float) -> Logged:
    """A recording on a uniform grid with q, dq and ddq by zero-phase low-pass and central differences.

    parameters: (14 n,) standard parameters to predict with. cutoff: Hz.
    """
    rate = recording.sample_rate
    q = zero_phase_lowpass(recording.position, rate, cutoff)
    dq = central_difference(q, rate)
    rotation, origin = body_in_link(robot, robot.chain.last)
    return Logged(
        chain=robot.chain,
        parameters=parameters,
        nominal=robot.parameters,
        limits=robot.limits,
        time=recording.time,
        sample_rate=rate,
        cutoff=cutoff,
        q=q,
        dq=dq,
        ddq=central_difference(dq, rate),
        tau=recording.torque,
        temperature=recording.temperature,
        torque_command=recording.torque_command,
        reference_position=recording.reference_position,
        reference_velocity=recording.reference_velocity,
        reference_acceleration=recording.reference_acceleration,
        body_rotation=rotation,
        body_origin=origin,
    )


def body_in_link(robot: Robot, joint: int) -> tuple[Array, Array]:
    """The frame of the body that carries a joint, in that joint's link frame: (3, 3) and origin (3,) m.

    joint: in the order of the standard parameters, so that it may be a follower.
    """
    data = mujoco.MjData(robot.model)
    mujoco.mj_kinematics(robot.model, data)
    rotation, origin = np.eye(3), np.zeros(3)
    chain, link = robot.chain.tree, int(robot.chain.in_tree[joint])
    for index in chain.path(link):
        position = data.qpos[index]
        turn = 0.0 if chain.is_slide[index] else position
        shift = chain.rotation[index, :, 2] * (position if chain.is_slide[index] else 0.0)
        origin = origin + rotation @ (chain.translation[index] + shift)
        c, s = np.cos(turn), np.sin(turn)
        rotation = rotation @ chain.rotation[index] @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    body = int(robot.model.jnt_bodyid[link])
    return rotation.T @ data.xmat[body].reshape(3, 3), rotation.T @ (data.xpos[body] - origin)
