"""From references to recordings: set up the loops, run them as one batch, and let the sensors report."""

import os
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, replace
from functools import cache
from importlib.metadata import version
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.errors import InputError
from identification.parameters import COULOMB, PER_JOINT, VISCOUS

from ..log import Controller, Recording
from ..robot import Robot
from . import layout
from .batch import Loop, run_loops
from .controller import MODEL, feedforward, velocity_pole
from .options import SimulationOptions
from .plant import add_to_diagonal, plant_model, resting_pose
from .reference import Reference
from .sensors import centred_torque, encoder_quantum, measured_torque, per_joint, white_noise
from .steady import controller_gains, resolved
from .unmodelled import Acting, described, put_in

Array = NDArray[np.float64]

POSITION_CHANNEL, TORQUE_CHANNEL = 0, 1


def simulate(
    robot: Robot | Sequence[Robot],
    references: Sequence[Reference],
    options: SimulationOptions | Sequence[SimulationOptions] | None = None,
    nominal: Robot | None = None,
    seed: int | Sequence[np.random.SeedSequence] = 0,
    threads: int | None = None,
    beside: Mapping[str, Acting] | None = None,
) -> tuple[Recording, ...]:
    """Recordings of the robot following each reference; they do not depend on ``threads``.

    robot, options: one for all runs, or one a run. references: sampled at the controller's rate.
    nominal: the model the controller knows (feedforward, gains, torque limits); the robot itself when None.
    seed: of all noise; an integer gives each run its own stream, spawned in order, or one stream a run.
    threads: workers (all cores when None). beside: effects that are in no catalogue, by the name that
    injections have.

    Each run starts at rest where the controller just balances gravity: on the reference's first
    sample when the nominal model is right. The logged torque of sample k is the drive's mean over
    the control period centred on it, (tau_{k-1} + tau_k) / 2, the torque that goes with the motion
    at sample k (``torque_command`` is tau_k). ``truth`` has position, velocity, acceleration, torque,
    friction_torque (N, n) and parameters (14 links,); between them the rigid-body dynamics hold to first
    order in ``physics_timestep``.

    Raises InputError for options that do not fit the robot, models that cannot share a batch, a
    controller that cannot hold the arm at the start, and a loop that becomes unstable.
    """
    count = len(references)
    if count == 0:
        raise InputError("simulation", "references", "at least one", 0)
    robots = _one_each(robot, Robot, count, "robot")
    settings = _one_each(options or SimulationOptions(), SimulationOptions, count, "options")
    streams = np.random.SeedSequence(seed).spawn(count) if isinstance(seed, (int, np.integer)) else list(seed)
    if len(streams) != count:
        raise InputError("simulation", "seed", f"one stream a run, {count}", len(streams))

    def prepared(
        own: Robot, reference: Reference, setting: SimulationOptions, stream: np.random.SeedSequence
    ) -> _Run:
        return _Run(own, reference, setting, stream, nominal or own, beside)

    with ThreadPoolExecutor(min(threads or os.cpu_count() or 1, count)) as pool:
        # Feedforward, noise and copies take as long as the stepping; they release the interpreter.
        runs = list(pool.map(prepared, robots, references, settings, streams))
        outputs = run_loops([run.loop for run in runs], threads)
        return tuple(pool.map(_Run.recording, runs, outputs))


def _one_each(value: Any, kind: type, count: int, name: str) -> list[Any]:
    """``count`` values: one repeated, or those of a sequence of that length."""
    if isinstance(value, kind):
        return [value] * count
    if len(value) != count:
        raise InputError("simulation", name, f"one, or one a reference ({count})", len(value))
    return list(value)


class _Run:
    """One run: what the loop needs before it, and what the log needs after it."""

    def __init__(
        self,
        robot: Robot,
        reference: Reference,
        options: SimulationOptions,
        stream: np.random.SeedSequence,
        nominal: Robot,
        beside: Mapping[str, Acting] | None,
    ):
        n = robot.joints
        for source, joints in (("references", reference.joints), ("nominal model", nominal.joints)):
            if joints != n:
                raise InputError("simulation", source, f"{n} joints, as the robot has", joints)
        damped = resolved(options, robot)
        options = damped.options
        self.robot, self.reference, self.options, self.stream = robot, reference, options, stream
        sensors, controller = options.sensors, options.controller
        self.deviation = self._torque_deviation()
        found = controller_gains(options, nominal)
        self.kp, self.kd = found.kp, found.kd
        forward, at_rest = np.zeros_like(reference.position), np.zeros(n)
        if controller.kind == "pd_with_model_feedforward":
            smoothing = controller.coulomb_smoothing
            forward = feedforward(nominal.chain, nominal.parameters, reference, smoothing)
            still = np.zeros((2, n))
            standing = Reference(reference.position[:2], still, still)
            at_rest = feedforward(nominal.chain, nominal.parameters, standing, smoothing)[0]
        noise = per_joint(sensors.position_noise, n, "position_noise", 0) * self._noise(POSITION_CHANNEL)
        step = 1 / (controller.rate * options.substeps)
        plant = plant_model(robot.model, step)
        unmodelled = put_in(options.effects, robot, plant, step, controller.rate, beside)
        # Friction acts on the motor, where that moves apart from the link.
        on_motor = np.where(unmodelled.split, damped.implicit, 0.0)
        add_to_diagonal(plant, damped.implicit - on_motor, robot.chain.in_tree[:n])
        limit = nominal.limits.torque
        pose, windup, self.hold = resting_pose(
            plant, robot.chain, reference.position[0], at_rest, self.kp, limit, unmodelled.standstill
        )
        constants = np.empty((layout.CONSTANTS, n))
        own = robot.parameters.reshape(-1, PER_JOINT)[:n]
        constants[layout.VISCOUS], constants[layout.COULOMB] = own[:, VISCOUS], own[:, COULOMB]
        constants[layout.KP], constants[layout.KD] = self.kp, self.kd
        constants[layout.TORQUE_LIMIT] = limit
        constants[layout.ENCODER_QUANTUM] = encoder_quantum(sensors, robot.chain.is_slide)
        constants[layout.ARMATURE] = unmodelled.armature + on_motor
        constants[layout.SPLIT], constants[layout.IMPLICIT] = unmodelled.split, damped.implicit
        constants[layout.CONTACT_STIFFNESS] = unmodelled.stiffness
        constants[layout.CONTACT_DAMPING] = unmodelled.damping
        # A position servo has no velocity command.
        speed = np.zeros_like(forward) if controller.kind == MODEL else reference.velocity
        self.loop = Loop(
            plant=plant,
            substeps=options.substeps,
            rate=controller.rate,
            velocity_pole=velocity_pole(controller),
            constants=constants,
            inputs=np.stack([reference.position, speed, forward, noise], axis=1),
            pose=pose,
            hold=self.hold,
            windup=windup,
            hooks=unmodelled.hooks,
            followers=robot.chain.followers,
        )

    def _noise(self, channel: int) -> Array:
        return white_noise(self.stream, channel, self.reference.position.shape)

    def _torque_deviation(self) -> Array:
        """Standard deviation of the torque noise, (n,) N·m."""
        n = self.robot.joints
        share = per_joint(self.options.sensors.torque_noise, n, "torque_noise", 0)
        limit = self.robot.limits.torque
        if (np.isinf(limit) & (share > 0)).any():
            raise InputError(
                "simulation", "torque_noise", "0 where the model has no torque limit", share.tolist()
            )
        return share * np.where(share > 0, limit, 0.0)

    def recording(self, output: Array) -> Recording:
        """The log of this run, from the loop's output (N, OUTPUTS, n)."""
        robot, reference, options = self.robot, self.reference, self.options
        controller, rate, every = options.controller, options.logged_rate, options.loops_a_sample
        delay = per_joint(options.sensors.torque_delay, robot.joints, "torque_delay")
        # The mean over a sample's period is that of the means over the loop's periods in it.
        reported = np.mean(
            [
                centred_torque(output[:, layout.COMMAND], self.hold, delay + late, controller.rate)
                for late in (np.arange(every) - (every - 1) / 2) / controller.rate
            ],
            axis=0,
        )[::every]
        output = output[::every]
        samples = len(output)
        has_feedforward = controller.kind == "pd_with_model_feedforward"
        return Recording(
            robot=robot.name,
            joint_names=robot.joint_names,
            sample_rate=rate,
            source="simulation",
            time=np.arange(samples) / rate,
            position=output[:, layout.READING].copy(),
            torque=measured_torque(
                reported, self._noise(TORQUE_CHANNEL)[:samples], rate, self.deviation, options.sensors
            ),
            torque_command=output[:, layout.COMMAND].copy(),
            reference_position=reference.position[::every],
            reference_velocity=reference.velocity[::every],
            reference_acceleration=reference.acceleration[::every],
            controller=Controller(
                controller.logged_kind,
                controller.rate,
                self.kp,
                self.kd,
                controller.coulomb_smoothing if has_feedforward else None,
            ),
            truth=self._truth(output),
            truth_effects=[described(injection, robot) for injection in options.effects],
            provenance={
                "model": robot.path.name,
                # What the robot hides belongs to the truth.
                "simulation": _plain(asdict(replace(options, effects=()))),
                "seed": {"entropy": self.stream.entropy, "spawn_key": list(self.stream.spawn_key)},
                "versions": _versions(),
            },
            is_slide=tuple(bool(slide) for slide in robot.chain.is_slide),
        )

    def _truth(self, output: Array) -> dict[str, Array]:
        """What only the simulation knows, by name."""
        channels = {
            "position": layout.POSITION,
            "velocity": layout.VELOCITY,
            "acceleration": layout.ACCELERATION,
            "torque": layout.DRIVE,
            "friction_torque": layout.FRICTION,
        }
        if self.options.effects:
            channels |= {"link_position": layout.LINK_POSITION, "effect_torque": layout.EFFECT_TORQUE}
        truth = {name: output[:, channel].copy() for name, channel in channels.items()}
        return truth | {"parameters": self.robot.parameters.copy()}


@cache
def _versions() -> dict[str, str]:
    """Versions of what decides the numbers; read once, it opens every package's metadata."""
    return {name: version(name) for name in ("identification-testbench", "mujoco", "numba", "numpy", "scipy")}


def _plain(value: Any) -> Any:
    """The same value in JSON's types."""
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    return np.asarray(value).tolist() if isinstance(value, (np.ndarray, np.generic, list, tuple)) else value
