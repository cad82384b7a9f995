"""A small identification result with known answers, made without simulation or filters."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from identification.base_parameters import BaseParameters, base_parameters
from identification.estimate import Estimate, TorqueFit
from identification.regressor import regressor
from testbench.log import Recording
from testbench.results import Comparison, IdentificationResult
from testbench.robot import Robot, load_robot

ARM = """
<mujoco model="slider_arm">
  <compiler angle="radian"/>
  <asset><mesh name="fin" vertex="0 0 0  .2 0 0  0 .2 0  0 0 .2"/></asset>
  <worldbody>
    <geom type="plane" size="2 2 .1" rgba=".8 .8 .8 1"/>
    <geom type="cylinder" size=".12 .1" pos="0 0 .1" rgba=".3 .3 .3 1"/>
    <body name="turret" pos="0 0 .2">
      <inertial pos="0 0 .1" mass="6" diaginertia=".05 .05 .04"/>
      <joint name="turn" axis="0 0 1" range="-3 3" armature=".1" damping="4" frictionloss="3"/>
      <geom type="box" size=".08 .1 .15" pos="0 0 .15" rgba=".9 .6 .1 1"/>
      <geom type="mesh" mesh="fin" pos="0 .1 .1" rgba=".2 .2 .8 1"/>
      <body name="arm" pos="0 0 .3" quat=".7071068 .7071068 0 0">
        <inertial pos=".2 0 .02" mass="4" diaginertia=".02 .06 .06"/>
        <joint name="lift" axis="0 0 1" range="-2 2" armature=".08" damping="3" frictionloss="2"/>
        <geom type="capsule" size=".06" fromto="0 0 0 .4 0 0" rgba=".9 .6 .1 1"/>
        <geom type="sphere" size=".09" rgba=".3 .3 .3 1"/>
        <geom type="box" size=".5 .5 .5" group="3"/>
        <body name="ram" pos=".4 0 0" quat=".7071068 0 .7071068 0">
          <inertial pos="0 .01 .1" mass="2" diaginertia=".01 .01 .002"/>
          <joint name="reach" type="slide" axis="0 0 1" range="0 .4"
                 armature="2" damping="20" frictionloss="6"/>
          <geom type="ellipsoid" size=".04 .04 .15" pos="0 0 .1" rgba=".7 .7 .7 1"/>
          <site name="tool" pos="0 0 .25"/>
        </body>
      </body>
    </body>
  </worldbody>
</mujoco>
"""
LOG_RATE, FIT_RATE, NOISE = 500.0, 100.0, 0.05


def synthetic_robot(directory: Path, xml: str = ARM) -> Robot:
    """The robot of an MJCF string; two hinges and a slide by default."""
    path = directory / "arm.xml"
    path.write_text(xml)
    return load_robot(path)


def synthetic_result(robot: Robot, seconds: float = 4.0, seed: int = 1) -> IdentificationResult:
    """One fit and one validation run; white residuals of NOISE times the joint's torque RMS."""
    rng = np.random.default_rng(seed)
    base = base_parameters(robot.chain)
    truth = base.values(robot.parameters)
    std = 0.01 * np.abs(truth) + 1e-4
    values = truth + std * rng.standard_normal(base.count)
    runs = [_run(robot, base, truth, name, seconds, rng) for name in ("excitation", "check")]
    noise_std, noise_floor = (NOISE * np.sqrt(np.mean(fit.measured**2, axis=0)) for fit, _ in runs)
    estimate = Estimate(
        base=base,
        values=values,
        covariance=np.diag(std**2),
        noise_std=noise_std,
        condition_number=48.0,
        effective_samples=310.0,
        estimator="wls",
    )
    (fit, fit_recording), (validation, validation_recording) = runs
    return IdentificationResult(
        robot=robot,
        estimate=estimate,
        fits=(fit,),
        validations=(validation,),
        fit_recordings=(fit_recording,),
        validation_recordings=(validation_recording,),
        comparison=Comparison(truth, values - truth, 0.9 * std, noise_floor),
    )


def without_truth(result: IdentificationResult) -> IdentificationResult:
    """As a hardware log gives it: no truth, no reference."""
    recordings = [
        replace(r, reference_position=None, reference_velocity=None, provenance={}, source="hardware")
        for r in (result.fit_recordings[0], result.validation_recordings[0])
    ]
    return replace(
        result,
        comparison=None,
        fit_recordings=(recordings[0],),
        validation_recordings=(recordings[1],),
    )


def _run(
    robot: Robot, base: BaseParameters, truth: np.ndarray, name: str, seconds: float, rng: np.random.Generator
) -> tuple[TorqueFit, Recording]:
    time = np.arange(0.0, seconds, 1 / LOG_RATE)
    q, dq, ddq = _motion(robot, time, rng)
    torque = regressor(robot.chain, q, dq, ddq, base.columns) @ truth
    scale = np.sqrt(np.mean(torque**2, axis=0))
    recording = Recording(
        robot=robot.name,
        joint_names=robot.joint_names,
        sample_rate=LOG_RATE,
        source="synthetic",
        time=time,
        position=q,
        torque=torque + NOISE * scale * rng.standard_normal(torque.shape),
        reference_position=q + 0.004 * np.sin(3 * time)[:, None],
        reference_velocity=dq,
        provenance={"scenario": "synthetic.yaml", "seed": 1},
    )
    every = slice(None, None, round(LOG_RATE / FIT_RATE))
    predicted = torque[every]
    measured = predicted + NOISE * scale * rng.standard_normal(predicted.shape)
    used = np.abs(dq[every]) > 0.02
    residual = np.where(used, measured - predicted, 0.0)
    counts = used.sum(axis=0)
    rms = np.sqrt(np.sum(residual**2, axis=0) / counts)
    relative = rms / np.sqrt(np.sum(np.where(used, measured, 0.0) ** 2, axis=0) / counts)
    fit = TorqueFit(name, time[every], q[every], dq[every], measured, predicted, used, rms, relative, rms)
    return fit, recording


def _motion(
    robot: Robot, time: np.ndarray, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A sum of three sines a joint inside half of its range, with exact derivatives."""
    lower = np.where(np.isfinite(robot.limits.lower), robot.limits.lower, -1.5)
    upper = np.where(np.isfinite(robot.limits.upper), robot.limits.upper, 1.5)
    q, dq, ddq = (np.zeros((len(time), robot.joints)) for _ in range(3))
    q += (lower + upper) / 2
    for harmonic in (1, 2, 3):
        w = 2 * np.pi * 0.25 * harmonic
        amplitude = (upper - lower) / 14 * rng.uniform(0.5, 1.0, robot.joints)
        phase = rng.uniform(0, 2 * np.pi, robot.joints)
        angle = w * time[:, None] + phase
        q += amplitude * np.sin(angle)
        dq += amplitude * w * np.cos(angle)
        ddq -= amplitude * w**2 * np.sin(angle)
    return q, dq, ddq
