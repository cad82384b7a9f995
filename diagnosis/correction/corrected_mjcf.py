"""The corrected simulator: the model as given, re-identified, with every named effect written into it.

Of what was fitted it has as much as left-out runs keep of all joints at once, since one set of parameters and
one law an effect must do for all. Its links and rotors are those of a robot that could exist.
"""

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from identification.base_parameters import base_parameters
from identification.errors import InputError
from identification.parameters import GROUPS, OFFSET, PER_JOINT, VISCOUS
from identification.physical_consistency import consistent_standard_parameters
from testbench.effects import effect
from testbench.effects.asymmetric_friction import DESCRIPTION
from testbench.effects.base import Injection
from testbench.effects.mjcf_form import write_effects
from testbench.model_file import write_model
from testbench.robot import Robot, load_robot

from ..decision.findings import Diagnosis, NamedEffect
from ..fit.normal_equations import Fit, fitted_to, standard_values
from ..model.base_regressor import BaseRegressor
from ..model.candidate import Candidate
from ..model.hypothesis import Design
from .corrected_model import corrected_model
from .file_error import FileError, file_error

Array = NDArray[np.float64]

# An offset that is not this many standard deviations from zero is not worth a place in the model.
OFFSET_DEVIATIONS = 3.0
# MuJoCo's largest, of a constraint whose solimpfriction is not set.
IMPEDANCE = 0.95
AXES = ("x", "y", "z")
# A constant torque is what the two directions' friction differ by.
CONSTANT = DESCRIPTION.name


@dataclass(frozen=True)
class Simulator:
    """A corrected simulator: standard parameters (14 n,) of a robot that could exist, and its effects."""

    standard: Array
    effects: tuple[Injection, ...]


@dataclass(frozen=True)
class Written:
    """A corrected.xml that was written. lacks: sentences on what it cannot carry. error: along the logs."""

    lacks: tuple[str, ...]
    error: FileError


def write_corrected(diagnosis: Diagnosis, path: str | Path) -> Written:
    """Write corrected.xml, whole or not at all, with the files that it refers to beside it.

    Raises InputError for a model that cannot carry the parameters.
    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    wanted = corrected_simulator(diagnosis)
    with tempfile.TemporaryDirectory(prefix=".corrected", dir=path.parent) as folder:
        robot = robot_with(diagnosis.robot, wanted.standard, Path(folder))
        carried, refused = _written(robot, wanted.effects, path)
    lacks = carried + refused + _lacking(diagnosis)
    if uncounted := sorted({each.effect for each in wanted.effects if _runs_in_time(each)}):
        lacks += (f"its torque error takes no account of {', '.join(uncounted)}, which MuJoCo runs in time",)
    return Written(lacks, file_error(diagnosis, path))


def _runs_in_time(injection: Injection) -> bool:
    """Whether a file has it where inverse dynamics has none: as more joints, or torque that comes later."""
    description = effect(injection.effect).DESCRIPTION
    return description.of_transmission or description.late


def _lacking(diagnosis: Diagnosis) -> tuple[str, ...]:
    """Sentences on what of the diagnosis is no effect that an MJCF could have."""
    model, said = corrected_model(diagnosis), []
    late = model.lag.seconds + model.final_timing
    if abs(late) >= 0.5 * diagnosis.prepared.sample_time:
        when = f"{1e3 * abs(late):.2g} ms {'late' if late > 0 else 'early'}"
        said.append(
            f"the logged torque is {when} against the positions: this belongs to the log, not to the robot"
        )
    for joint in np.flatnonzero(model.coulomb_smoothing).tolist():
        width, name = model.coulomb_smoothing[joint], model.chain.joint_names[joint]
        unit = "m/s" if model.chain.is_slide[joint] else "rad/s"
        law = f"fc tanh(v / {width:.2g} {unit})"
        said.append(f"friction of {name} is soft near rest, {law}; MuJoCo's frictionloss jumps")
    if model.coulomb_lead > 0:
        constant = 2 * model.coulomb_lead / IMPEDANCE
        said.append(
            f"friction changes sign {1e3 * model.coulomb_lead:.1f} ms ahead of the joints: "
            f'frictionloss does with solreffriction="{constant:.2g} 1", which the file leaves as given'
        )
    unnamed = {each.place for each in diagnosis.final[0].accepted if not _is_reported(each, diagnosis)}
    if unnamed and diagnosis.kept.effects.any():
        said.append(f"what was fitted and has no name ({len(unnamed)}), which predictions include")
    return tuple(said)


def _written(
    robot: Robot, wanted: Sequence[Injection], path: Path
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Write as many of the effects as one MJCF can hold, strongest first; sentences for all others."""
    try:
        return write_effects(robot, wanted, path), ()
    except InputError:
        kept: list[Injection] = []
        refused = []
        for injection in wanted:
            try:
                write_effects(robot, [*kept, injection], path)
                kept.append(injection)
            except InputError as error:
                where = "" if injection.joint is None else f" of {robot.joint_names[injection.joint]}"
                refused.append(f"{injection.effect}{where}: not in the model beside the others: {error.got}")
        return write_effects(robot, kept, path), tuple(refused)


def reidentified_simulator(diagnosis: Diagnosis) -> Simulator:
    """The model with re-identified parameters and offsets, and no effects."""
    model = corrected_model(diagnosis)
    standard = model.nominal + model.kept.parameters_whole * (model.parameters - model.nominal)
    return _simulator(diagnosis.robot, standard, diagnosis.parameters_only, ())


def corrected_simulator(diagnosis: Diagnosis) -> Simulator:
    """The model with the reported effects and the parameters that go with them; re-identified without any."""
    model, kept = corrected_model(diagnosis), diagnosis.kept
    if not diagnosis.effects or kept.effects_whole == 0:
        return reidentified_simulator(diagnosis)
    by = _by_reported(diagnosis)
    with_effects = standard_values(diagnosis.prepared, by[1].values)
    parameters = model.nominal + kept.parameters_whole * (model.parameters - model.nominal)
    standard = parameters + kept.effects_whole * (with_effects - parameters)
    named = tuple(injection_of(_shrunk(diagnosis, each)) for each in diagnosis.effects)
    return _simulator(diagnosis.robot, _beside(standard, named), by, named)


def _by_reported(diagnosis: Diagnosis) -> tuple[Design, Fit]:
    """The fit whose parameters go with the reported effects alone.

    Where more was fitted than is reported, parameters are fitted again to what the reported effects leave:
    those of the whole fit make up for laws that the file lacks.
    """
    hypothesis, fitted = diagnosis.final
    fits = list(zip(hypothesis.accepted, hypothesis.parts, strict=True))
    kept = [(each, part) for each, part in fits if _is_reported(each, diagnosis)]
    if len(kept) == len(fits):
        return diagnosis.final
    runs = [
        replace(
            run, torque=run.torque - sum(each.columns[index] @ fitted.values[part] for each, part in kept)
        )
        for index, run in enumerate(diagnosis.prepared.runs)
    ]
    return fitted_to(BaseRegressor(replace(diagnosis.prepared, runs=tuple(runs))), [])


def _simulator(
    robot: Robot, standard: Array, by: tuple[Design, Fit], effects: tuple[Injection, ...]
) -> Simulator:
    """The nearest simulator that could exist. by: what the standard parameters (14 n,) were estimated by."""
    hypothesis, fitted = by
    base = base_parameters(robot.chain, tuple(GROUPS))
    count = hypothesis.timing
    covariance = base.projection @ fitted.covariance[:count, :count] @ base.projection.T
    nearest = consistent_standard_parameters(base, base.values(standard), covariance, robot.parameters)
    offsets = nearest.reshape(-1, PER_JOINT)[:, OFFSET]
    std = np.sqrt(np.maximum(np.diag(fitted.covariance), 0.0))[OFFSET:count:PER_JOINT]
    return Simulator(nearest, _with_offsets(effects, offsets, np.abs(offsets) > OFFSET_DEVIATIONS * std))


def _beside(standard: Array, effects: Sequence[Injection]) -> Array:
    """Standard parameters (14 n,) without the viscous friction that the effects' own laws have of it."""
    table = standard.reshape(-1, PER_JOINT).copy()
    for injection in effects:
        name = effect(injection.effect).DESCRIPTION.viscous
        for joint in (injection.joint, injection.into) if name else ():
            if joint is not None:
                table[joint, VISCOUS] = max(table[joint, VISCOUS] - injection.values[name], 0.0)
    return table.ravel()


def _with_offsets(
    effects: Sequence[Injection], offsets: Array, worth: NDArray[np.bool_]
) -> tuple[Injection, ...]:
    """The effects, strongest first, and each joint's offset that is worth a place, (n,) N·m."""
    wanted, left = [], set(np.flatnonzero(worth).tolist())
    for injection in effects:
        if injection.effect == CONSTANT and injection.joint in left:
            left.remove(injection.joint)
            values = injection.values
            total = values["offset"] + float(offsets[injection.joint])
            wanted.append(replace(injection, values=values | {"offset": total}))
        else:
            wanted.append(injection)
    for joint in sorted(left):
        values = {"offset": float(offsets[joint]), "viscous_difference": 0.0}
        wanted.append(Injection(CONSTANT, joint, values))
    return tuple(wanted)


def _shrunk(diagnosis: Diagnosis, named: NamedEffect) -> NamedEffect:
    """The effect with as much of its torque as is kept of all joints at once."""
    share, member, family = diagnosis.kept.effects_whole, named.candidate.member, named.candidate.family
    if share == 1:
        return named
    size = member.count + len(family.refine)
    coefficients = share * diagnosis.coefficients(named)
    return replace(named, parameters=family.parameters(member, coefficients, np.zeros((size, size))))


def _is_reported(candidate: Candidate, diagnosis: Diagnosis) -> bool:
    return any(each.candidate.member is candidate.member for each in diagnosis.effects)


def injection_of(named: NamedEffect) -> Injection:
    """A named effect as the simulator takes it, every value inside its bounds."""
    values: dict[str, float] = {}
    for key, quantity in named.parameters.items():
        value = quantity.value
        if key == "intervals" and isinstance(value, tuple):
            values |= {"start": value[0], "duration": value[1] - value[0]}
        elif isinstance(value, tuple):
            values |= {f"{key}_{axis}": part for axis, part in zip(AXES, value, strict=True)}
        else:
            values[key] = value
    description = effect(named.effect).DESCRIPTION
    return Injection(
        effect=named.effect,
        joint=named.joint,
        values={
            parameter.name: float(np.clip(values[parameter.name], parameter.lower, parameter.upper))
            for parameter in description.parameters
            if parameter.name in values
        },
        law=named.law,
        into=named.into,
    )


def robot_with(robot: Robot, standard: Array, folder: Path) -> Robot:
    """The robot with other standard parameters (14 n,), from a file written to ``folder``."""
    path = folder / f"{robot.path.stem}.xml"
    write_model(robot, standard, path)
    return replace(load_robot(path), name=robot.name)
