"""The corrected simulator: the model as given, re-identified, with every named effect written into it."""

import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from identification.base_parameters import base_parameters
from identification.errors import InputError
from identification.parameters import ARMATURE, GROUPS, INERTIAL, OFFSET, PER_JOINT, pseudo_inertia
from identification.physical_consistency import nearest_consistent
from testbench.effects import effect
from testbench.effects.base import Injection
from testbench.effects.mjcf_form import write_effects
from testbench.model_file import write_model
from testbench.robot import Robot, load_robot

from ..decision.findings import Diagnosis, NamedEffect
from ..fit.normal_equations import Fit
from ..model.hypothesis import Design
from .corrected_model import corrected_model

Array = NDArray[np.float64]

# Smallest eigenvalue of a pseudo-inertia as a share of its largest, for a model that MuJoCo takes.
SMALLEST_EIGENVALUE = 1e-9
# An offset that is not this many standard deviations from zero is not worth a place in the model.
OFFSET_DEVIATIONS = 3.0
# MuJoCo's largest, of a constraint whose solimpfriction is not set.
IMPEDANCE = 0.95
AXES = ("x", "y", "z")


def write_corrected(diagnosis: Diagnosis, path: str | Path) -> tuple[str, ...]:
    """Write corrected.xml, whole or not at all; the sentences say what it cannot carry.

    Parameters that no real arm could have are replaced by the nearest that one could. Raises InputError
    for a model that cannot carry the parameters.
    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    standard = consistent(diagnosis.robot, diagnosis.parameters, *diagnosis.final)
    wanted = corrections(diagnosis)
    with tempfile.TemporaryDirectory(prefix=".corrected", dir=path.parent) as folder:
        robot = robot_with(diagnosis.robot, standard, Path(folder))
        kept, refused = _written(robot, wanted, path)
    model = corrected_model(diagnosis)
    late = model.lag.seconds + model.final_timing
    if abs(late) >= 0.5 * diagnosis.prepared.sample_time:
        when = f"{1e3 * abs(late):.2g} ms {'late' if late > 0 else 'early'}"
        kept += (
            f"the logged torque is {when} against the positions: this belongs to the log, not to the robot",
        )
    for joint in np.flatnonzero(model.coulomb_smoothing).tolist():
        width, name = model.coulomb_smoothing[joint], model.chain.joint_names[joint]
        unit = "m/s" if model.chain.is_slide[joint] else "rad/s"
        law = f"fc tanh(v / {width:.2g} {unit})"
        kept += (f"friction of {name} is soft near rest, {law}; MuJoCo's frictionloss jumps",)
    if model.coulomb_lead > 0:
        constant = 2 * model.coulomb_lead / IMPEDANCE
        kept += (
            f"friction changes sign {1e3 * model.coulomb_lead:.1f} ms ahead of the joints: "
            f'frictionloss does with solreffriction="{constant:.2g} 1", which the file leaves as given',
        )
    return kept + refused


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


def corrections(diagnosis: Diagnosis) -> tuple[Injection, ...]:
    """Every named effect and every offset of the final fit as injections, strongest effect first."""
    hypothesis, fitted = diagnosis.final
    offsets = diagnosis.parameters.reshape(-1, PER_JOINT)[:, OFFSET]
    std = np.sqrt(np.maximum(np.diag(fitted.covariance), 0.0))[OFFSET : hypothesis.parameters - 1 : PER_JOINT]
    wanted = []
    left = {int(joint) for joint in np.flatnonzero(np.abs(offsets) > OFFSET_DEVIATIONS * std)}
    for injection in (injection_of(each) for each in diagnosis.effects):
        # A constant torque is what the two directions' friction differ by.
        if injection.effect == "asymmetric_friction" and injection.joint in left:
            left.remove(injection.joint)
            values = injection.values
            total = values["offset"] + float(offsets[injection.joint])
            injection = replace(injection, values=values | {"offset": total})
        wanted.append(injection)
    for joint in sorted(left):
        values = {"offset": float(offsets[joint]), "viscous_difference": 0.0}
        wanted.append(Injection("asymmetric_friction", joint, values))
    return tuple(wanted)


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


def consistent(robot: Robot, standard: Array, hypothesis: Design, fitted: Fit) -> Array:
    """Standard parameters (14 n,) that a real arm could have: those given, or the nearest in base values.

    hypothesis, fitted: what they were estimated by; its covariance says what is near.
    """
    if _is_consistent(robot, standard):
        return standard
    base = base_parameters(robot.chain, tuple(GROUPS))
    count = hypothesis.parameters - 1
    covariance = base.projection @ fitted.covariance[:count, :count] @ base.projection.T
    values = base.values(standard)
    std = np.sqrt(np.maximum(np.diag(covariance), np.finfo(float).tiny))
    correlation = covariance / np.outer(std, std)
    eigenvalues, vectors = np.linalg.eigh(correlation)
    # Directions that the data fix beyond rounding would make the root singular.
    root = (vectors / np.sqrt(np.maximum(eigenvalues, SMALLEST_EIGENVALUE * eigenvalues[-1]))).T / std
    return nearest_consistent(base, values, root, robot.parameters)


def _is_consistent(robot: Robot, standard: Array) -> bool:
    """Whether every link that has mass has a positive definite pseudo-inertia, and nothing is negative."""
    table, nominal = standard.reshape(-1, PER_JOINT), robot.parameters.reshape(-1, PER_JOINT)
    if np.any(table[:, ARMATURE:OFFSET] < 0):
        return False
    for link, given in zip(table[:, :INERTIAL], nominal[:, :INERTIAL], strict=True):
        if given[-1] == 0:
            if np.any(link != 0):
                return False
            continue
        eigenvalues = np.linalg.eigvalsh(pseudo_inertia(link))
        if eigenvalues[0] <= SMALLEST_EIGENVALUE * eigenvalues[-1]:
            return False
    return True
