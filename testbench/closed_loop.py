"""Logged runs simulated again in MuJoCo, with candidate parameters in the plant.

Reference, controller and sampling are those of the logs; the controller's feedforward stays that of
the nominal model, as it was on the robot. Motions are returned exactly, but the controller reads the noise
that the robot's encoders had: that shakes the arm, and may drive its torque to the limits.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from identification.chain import frame_with_z
from identification.closed_loop import SimulatedRun
from identification.errors import InputError
from identification.filtering import zero_phase_lowpass
from identification.measurement_noise import position_noise_std
from identification.observations import POSITION_BAND, Preprocessing
from identification.parameters import (
    ARMATURE,
    COULOMB,
    INERTIAL,
    OFFSET,
    PER_JOINT,
    VISCOUS,
    pseudo_inertia,
)
from identification.signals import Motion

from .log import Controller, Recording
from .robot import Robot
from .sampling import is_on_grid
from .simulation import layout
from .simulation.bare_model import bare_model
from .simulation.batch import Loop, run_loops
from .simulation.controller import KINDS, ControllerOptions, feedforward, velocity_pole
from .simulation.hooks import Standstill
from .simulation.plant import plant_model, resting_pose
from .simulation.reference import Reference

Array = NDArray[np.float64]

# s, at most. Differences between candidates need less than the candidates themselves.
PHYSICS_TIMESTEP, COARSE_TIMESTEP = 2.5e-4, 1e-3
# Loops in one batch, which bounds the memory of their logs.
LOOPS = 24
# Hz: what a position has beyond is noise but for little motion, and all of it beyond this share of the rate.
NOISE_BAND, WHITE_SHARE = 80.0, 0.25
# Of what is beyond the band, at least this share must be noise to be taken for it.
NOISE_SHARE = 0.5


@dataclass(frozen=True)
class RecordedLoops:
    """The closed loops of some recordings; implements ``identification.closed_loop.ClosedLoop``.

    robot: the model that the controller knows. threads: workers (all cores when None).
    """

    robot: Robot
    recordings: tuple[Recording, ...]
    threads: int | None = None

    def simulate(self, candidates: Array, coarse: bool = False) -> list[tuple[SimulatedRun, ...]]:
        """Every recording's motion for each candidate, standard parameters (C, 14 links).

        coarse: larger physics steps, for derivatives by differences.

        Raises InputError for a log without reference or controller gains, for one that is not sampled
        at the controller's ticks, and for candidates that MuJoCo cannot carry or that are unstable.
        """
        largest = COARSE_TIMESTEP if coarse else PHYSICS_TIMESTEP
        loops = [self._loop(run, candidate, largest) for candidate in candidates for run in self._runs]
        motions = []
        for start in range(0, len(loops), LOOPS):
            for output in run_loops(loops[start : start + LOOPS], self.threads):
                channels = (layout.POSITION, layout.VELOCITY, layout.ACCELERATION)
                motions.append(SimulatedRun(*(output[:, channel].copy() for channel in channels)))
        each = len(self.recordings)
        return [tuple(motions[start : start + each]) for start in range(0, len(motions), each)]

    @cached_property
    def _runs(self) -> tuple["_Run", ...]:
        return tuple(_run(self.robot, recording) for recording in self.recordings)

    @cached_property
    def _plant(self) -> Any:
        """The robot's moving masses, to be given a candidate's parameters."""
        return bare_model(self.robot.model)

    def _loop(self, run: "_Run", candidate: Array, largest: float) -> Loop:
        """One run's closed loop with a candidate in the plant; physics steps of at most ``largest`` s."""
        substeps = max(1, int(np.ceil(1 / (run.controller.rate * largest) - 1e-9)))
        n, chain = self.robot.joints, self.robot.chain
        links = candidate.reshape(-1, PER_JOINT)
        plant = plant_model(self._plant, 1 / (run.controller.rate * substeps))
        _set_inertia(plant, links if chain.followers is None else links[chain.followers.place])
        table = links[:n]
        # A torque offset is a constant less of drive.
        forward = run.forward - table[:, OFFSET]
        nothing = np.zeros(n)
        still = Standstill((), nothing > 0, nothing, plant.opt.timestep)
        limit = self.robot.limits.torque
        reference = run.reference.position
        at_rest = run.at_rest - table[:, OFFSET]
        pose, _, hold = resting_pose(plant, chain, reference[0], at_rest, run.kp, limit, still)
        constants = np.zeros((layout.CONSTANTS, n))
        constants[layout.VISCOUS] = table[:, VISCOUS]
        # Friction that drives has no solution.
        constants[layout.COULOMB] = np.maximum(table[:, COULOMB], 0.0)
        constants[layout.KP], constants[layout.KD] = run.kp, run.kd
        constants[layout.TORQUE_LIMIT] = limit
        return Loop(
            plant=plant,
            substeps=substeps,
            rate=run.controller.rate,
            velocity_pole=run.velocity_pole,
            constants=constants,
            inputs=np.stack([reference, run.reference.velocity, forward, run.noise], axis=1),
            pose=pose,
            hold=hold,
            followers=chain.followers,
        )


def recorded_loops(
    robot: Robot, recordings: Sequence[Recording], threads: int | None = None
) -> RecordedLoops | None:
    """The closed loops of these recordings, or None where one of them states no reference or controller."""
    if any(run.reference_position is None or run.controller is None for run in recordings):
        return None
    return RecordedLoops(robot, tuple(recordings), threads)


@dataclass(frozen=True)
class _Run:
    """What the loops of one recording share.

    forward: (N, n) feedforward; at_rest: (n,) its value before the motion. noise: (N, n) rad (m), of the
    encoders. kp, kd: (n,).
    """

    reference: Reference
    controller: Controller
    forward: Array
    at_rest: Array
    noise: Array
    kp: Array
    kd: Array
    velocity_pole: float


def _run(robot: Robot, recording: Recording) -> _Run:
    controller = recording.controller
    if controller is None or controller.kind not in KINDS or controller.kp is None or controller.kd is None:
        kind = "none" if controller is None else repr(controller.kind)
        raise InputError("log", "controller", "a controller with its gains", kind, KINDS)
    reference = _reference(recording)
    rate = controller.rate
    if not is_on_grid(recording.time, rate):
        got = f"{recording.sample_rate:g} Hz"
        raise InputError("log", "time", f"one sample a tick of the controller ({rate:g} Hz)", got)
    forward, at_rest = np.zeros_like(reference.position), np.zeros(robot.joints)
    # What the log does not state has the value of our own controller.
    options = ControllerOptions(kind=controller.kind, rate=rate)
    if controller.kind == "pd_with_model_feedforward":
        smoothing = controller.coulomb_smoothing or options.coulomb_smoothing
        forward = feedforward(robot.chain, robot.parameters, reference, smoothing)
        still = np.zeros((2, robot.joints))
        standing = Reference(reference.position[:2], still, still)
        at_rest = feedforward(robot.chain, robot.parameters, standing, smoothing)[0]
    pole = velocity_pole(options)
    noise = _encoder_noise(recording, rate)
    return _Run(reference, controller, forward, at_rest, noise, controller.kp, controller.kd, pole)


def _encoder_noise(recording: Recording, rate: float) -> Array:
    """What the encoders' noise was beyond the band of the motion, (N, n) rad (m); 0 for quiet encoders.

    White noise has as much in every hertz: where a joint has far more just beyond the band, that is motion.
    """
    white_from = WHITE_SHARE * rate
    band = min(NOISE_BAND, white_from)
    motion = Motion(recording.position, recording.torque, rate)
    white, beyond = (
        position_noise_std(motion, Preprocessing(cutoff / POSITION_BAND)) for cutoff in (white_from, band)
    )
    noise = recording.position - zero_phase_lowpass(recording.position, rate, band)
    return np.where(white**2 > NOISE_SHARE * beyond**2, noise, 0.0)


def _reference(recording: Recording) -> Reference:
    """The motion commanded of the controller. Raises InputError where the log lacks a part."""
    return Reference(
        _logged("reference/position", recording.reference_position),
        _logged("reference/velocity", recording.reference_velocity),
        _logged("reference/acceleration", recording.reference_acceleration),
    )


def _logged(name: str, values: Array | None) -> Array:
    if values is None:
        raise InputError("log", name, "a reference to simulate", "none")
    return values


def _set_inertia(plant: Any, table: Array) -> None:
    """Give each joint's body the inertia of its link; bodies welded to it keep none.

    table: (links, 14), in the model's order. Raises InputError for a link without mass and for inertia
    between joints of one body.
    """
    carriers = np.asarray(plant.jnt_bodyid)
    plant.body_mass[:] = 0.0
    plant.body_inertia[:] = 0.0
    plant.dof_armature[:] = table[:, ARMATURE]
    # MuJoCo's shortcuts for aligned frames and diagonal inertia no longer hold.
    plant.body_sameframe[:] = 0
    for joint, body in enumerate(carriers):
        if joint + 1 < len(carriers) and carriers[joint + 1] == body:
            if np.any(table[joint, :INERTIAL] != 0):
                name = plant.joint(joint).name
                raise InputError("model", name, "no inertia between joints of one body", "some")
            continue
        if not table[joint, INERTIAL - 1] > 0:
            got = f"{table[joint, INERTIAL - 1]:g} kg"
            raise InputError("model", plant.joint(joint).name, "a link of positive mass", got)
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = frame_with_z(plant.jnt_axis[joint]), plant.jnt_pos[joint]
        pseudo = pose @ pseudo_inertia(table[joint, :INERTIAL]) @ pose.T
        mass = pseudo[3, 3]
        center = pseudo[:3, 3] / mass
        # The second moments and the inertia share their axes; they need not be positive.
        second, axes = np.linalg.eigh(pseudo[:3, :3] - mass * np.outer(center, center))
        if np.linalg.det(axes) < 0:
            axes[:, 0] = -axes[:, 0]
        plant.body_mass[body], plant.body_ipos[body] = mass, center
        plant.body_inertia[body] = second.sum() - second
        plant.body_iquat[body] = _quaternion(axes)
    plant.body_subtreemass[:] = plant.body_mass
    for body in range(plant.nbody - 1, 0, -1):
        plant.body_subtreemass[plant.body_parentid[body]] += plant.body_subtreemass[body]


def _quaternion(axes: Array) -> Array:
    """(w, x, y, z) of a rotation matrix (3, 3)."""
    out = np.empty(4)
    mujoco.mju_mat2Quat(out, np.ascontiguousarray(axes).ravel())
    return out
