"""Diagnoses with known answers, put together from a simulated arm without searching for the answer."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from diagnosis.correction.closed_loop_gap import forward_gap, gap_as_given
from diagnosis.correction.forward_gap import ForwardGap
from diagnosis.data.preparation import prepare
from diagnosis.data.run import Prepared
from diagnosis.decision.findings import Diagnosis, Gap, NamedEffect, RankedCandidate
from diagnosis.fit.linearisation import first_linearised
from diagnosis.fit.normal_equations import fit
from diagnosis.held_out.shrinkage import everything
from diagnosis.model.base_regressor import BaseRegressor
from diagnosis.model.candidate import Candidate
from diagnosis.model.candidates import candidate
from diagnosis.model.hypothesis import design
from diagnosis.residual.localisation import where
from diagnosis.residual.noise import noise
from diagnosis.residual.spectrum import above_band
from identification.excitation.design import DesignOptions, random_excitation
from studies.blind.outside import OUTSIDE
from testbench.effects import effect
from testbench.effects.base import Injection
from testbench.log import Recording
from testbench.robot import Robot
from testbench.simulation import Reference, SensorOptions, SimulationOptions, sample_reference, simulate

from .once import once_per_robot

RATE = 1000.0
NOT_READ = (
    "velocity",
    "torque_command",
    "temperature",
    "reference_position",
    "reference_velocity",
    "reference_acceleration",
)


def simulated_runs(
    robot: Robot, injections: Sequence[Injection], runs: int = 2, noise: float = 0.002, seed: int = 3
) -> dict[str, Recording]:
    """Runs of random motions, 18-bit encoders and white torque noise; effects may be in no catalogue."""
    work = _simulated if injections else _healthy_runs
    recordings = work(robot, tuple(injections), runs, noise, seed)
    return {f"run_{index + 1}": recording for index, recording in enumerate(recordings)}


@once_per_robot
def _references(robot: Robot, runs: int, seed: int) -> list[Reference]:
    references = []
    for index in range(runs):
        options = DesignOptions(harmonics=(5, 12, 8)[index % 3], base_frequency=0.2, seed=seed + index)
        motion = random_excitation(robot.chain, robot.parameters, robot.limits, options).trajectory
        references.append(sample_reference(motion, RATE))
    return references


def _simulated(
    robot: Robot, injections: tuple[Injection, ...], runs: int, noise: float, seed: int
) -> tuple[Recording, ...]:
    options = SimulationOptions(
        sensors=SensorOptions(encoder_bits=18, slide_resolution=1e-6, torque_noise=noise),
        physics_timestep=5e-4,
        effects=injections,
    )
    return simulate(robot, _references(robot, runs, seed), options, seed=seed, beside=OUTSIDE)


# Most tests start from runs without an effect.
_healthy_runs = once_per_robot(_simulated)


def measured_only(run: Recording) -> Recording:
    """The run with position and torque alone."""
    return replace(run, **dict.fromkeys(NOT_READ))


def diagnosed(
    robot: Robot,
    recordings: Mapping[str, Recording],
    named: Sequence[tuple[str, int | None, int | None]],
    confusable: tuple[str, ...] = (),
    hidden: tuple[tuple[str, int | None], ...] = (),
) -> Diagnosis:
    """The diagnosis that names these effects, each with its family's best member."""
    prepared = first_linearised(prepare(robot, recordings))
    only = design(BaseRegressor(prepared))
    only_fit = fit(only)
    chosen: list[Candidate] = []
    for name, joint, into in named:
        chosen.append(_best(prepared, chosen, name, joint, into))
    final = design(BaseRegressor(prepared), chosen)
    final_fit = fit(final)
    effects = []
    for index, (each, own) in enumerate(zip(chosen, final.parts, strict=True)):
        values, covariance = final_fit.values[own], np.zeros((each.count + len(each.family.refine),) * 2)
        covariance[: each.count, : each.count] = final_fit.covariance[own, own]
        quantities = each.family.parameters(each.member, values, covariance)
        place = (each.family.joint, each.family.into)
        others = confusable if index == 0 else ()
        effects.append(
            NamedEffect(each.family.effect, *place, 0.93 - 0.1 * index, quantities, each, others, 0.6)
        )

    def rms(residuals: Sequence[np.ndarray]) -> np.ndarray:
        return np.sqrt(np.mean(np.concatenate(residuals) ** 2, axis=0))

    gap = exact_gap(
        rms([np.where(u, g, 0.0) for u, g in zip(only.used, only.gap, strict=True)]),
        rms(only_fit.held_out),
        rms(final_fit.held_out),
        0.9 * rms(final_fit.held_out),
    )
    gap = replace(gap, unseen=~noise(BaseRegressor(prepared)).seen, above=above_band(prepared))
    ranked = [RankedCandidate(e.effect, e.joint, e.into, e.probability, 240.0) for e in effects]
    ranked += [
        RankedCandidate(name, effects[0].joint if effects else 0, None, 0.02, 12.0 - index, "explains less")
        for index, name in enumerate((*confusable, "torque_saturation", "cable_spring"))
    ]
    return Diagnosis(
        robot=robot,
        verdict="effect" if effects else "parameters",
        sentence="The simulator lacks " + " and ".join(e.effect for e in effects) if effects else "It fits.",
        effects=tuple(effects),
        ranked=tuple(ranked),
        where=where(prepared, (only, only_fit), gap.noise_floor),
        gap=gap,
        prepared=prepared,
        parameters_only=(only, only_fit),
        final=(final, final_fit),
        kept=everything(robot.joints),
        not_observable=hidden,
        notes=("a note",),
    )


def exact_gap(nominal: np.ndarray, parameters: np.ndarray, effects: np.ndarray, floor: np.ndarray) -> Gap:
    """A gap of errors (n,) that are known exactly, with nothing above the band."""
    intervals = np.stack([[each, each] for each in (nominal, parameters, effects)])
    return Gap(
        nominal, parameters, effects, floor, intervals, np.zeros(len(floor), bool), np.zeros(len(floor))
    )


def _best(
    prepared: Prepared, before: Sequence[Candidate], name: str, joint: int | None, into: int | None
) -> Candidate:
    family = effect(name).signature([run.logged for run in prepared.runs], joint, into)
    tried = [candidate(prepared, family, member) for member in family.members]
    if len(tried) == 1:
        return tried[0]

    def left(each: Candidate) -> float:
        residual = np.concatenate(fit(design(BaseRegressor(prepared), [*before, each])).residual)
        return float(np.sum(np.log(np.sum(residual**2, axis=0))))

    return min(tried, key=left)


def in_closed_loop(answer: Diagnosis, runs: Mapping[str, Recording]) -> ForwardGap | None:
    """The gap in closed loop at all stages, by one thread."""
    return forward_gap(answer, runs, gap_as_given(answer.robot, runs, 1), 1)
