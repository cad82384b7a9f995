"""mujoco.sysid: Gauss-Newton on the simulated position, with its default optimiser and residual."""

from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np
from mujoco import rollout, sysid
from numpy.typing import NDArray

from identification.output_error.servo_run import ServoRun

from ._servo_case import Case
from ._servo_mujoco import initial_state, servo_spec, start_of

Array = NDArray[np.float64]

# Steps of the simulation a sample.
SUBSTEPS = 2
# Times what is stated, to which gains and limits may go.
GAINS = (0.2, 5.0)
HOW = "armature, damping, frictionloss, kp, kd, torque limit and delay of each joint; default optimiser"


def fitted(case: Case) -> tuple[sysid.ParameterDict, str]:
    """The parameters that the fitted runs ask for."""
    params, gains = _parameters(case), sorted({float(run.kp[0]) for run in case.fitted})
    sequences = []
    for gain in gains:
        runs = [run for run in case.fitted if run.kp[0] == gain]
        spec = _spec(case, runs[0])
        model = spec.compile()
        sequences.append(
            sysid.ModelSequences(
                f"kp_{gain:g}",
                spec,
                [run.name for run in runs],
                [initial_state(model, *start_of(run)) for run in runs],
                [sysid.TimeSeries(_time(run), run.command) for run in runs],
                [sysid.TimeSeries.from_names(_time(run), run.position, model) for run in runs],
            )
        )
    names, longest = case.robot.joint_names, float(case.servo.delay_upper.max())

    def late(
        params: Any, predicted: Any, measured: Any, model: Any, return_all: Any, state: Any = None
    ) -> Any:
        """The toolbox's own residual, the simulated position late by each joint's delay."""
        measured = sysid.signal_modifier.apply_delayed_ts_window(measured, predicted, -longest, 0.0)
        delays = {f"{name}_position": float(params[f"{name}_delay"].value[0]) for name in names}
        predicted = sysid.apply_resample_and_delay(predicted, measured.times, 0.0, delays)
        missed = sysid.weighted_diff(predicted.data, measured.data, model)
        return sysid.normalize_residual(missed, measured.data), predicted, measured

    residual = sysid.build_residual_fn(models_sequences=sequences, modify_residual=late)
    found, _ = sysid.optimize(params.move_off_bounds(), residual, verbose=False)
    return found, HOW


def predicted(case: Case, params: sysid.ParameterDict, run: ServoRun) -> Array:
    """Position (N, n) of a run by what was found."""
    model = sysid.apply_param_modifiers(params, _spec(case, run))
    command = sysid.TimeSeries(_time(run), run.command).resample(target_dt=model.opt.timestep)
    start = initial_state(model, *start_of(run))
    _, sensed = rollout.rollout(model, mujoco.MjData(model), start, command.data[:-1])
    simulated = np.vstack([start_of(run)[0], sensed[0]])
    time, fine = _time(run), command.times[: len(simulated)]
    out = np.empty_like(run.position)
    for joint, name in enumerate(case.robot.joint_names):
        out[:, joint] = np.interp(time - params[f"{name}_delay"].value[0], fine, simulated[:, joint])
    return out


def _time(run: ServoRun) -> Array:
    return np.arange(len(run.position)) / run.rate


def _spec(case: Case, run: ServoRun) -> Any:
    return servo_spec(case.robot, case.servo, run.kp, run.kd, 1 / (SUBSTEPS * run.rate))


def _parameters(case: Case) -> sysid.ParameterDict:
    """Armature, damping and friction from zero to PACE's bounds, gains and limit to times as stated."""
    params, model, bounds = sysid.ParameterDict(), case.robot.model, case.bounds
    for joint, name in enumerate(case.robot.joint_names):

        def of_joint(field: str, name: str = name) -> Callable[[Any, Any], None]:
            def modify(spec: Any, parameter: Any) -> None:
                # Damping is a polynomial of the speed; its first coefficient is the viscous one.
                value = parameter.value[0]
                setattr(spec.joint(name), field, [value, 0, 0] if field == "damping" else value)

            return modify

        def kp(spec: Any, parameter: Any, name: str = name) -> None:
            actuator = spec.actuator(name)
            sysid.apply_pgain(spec, name, actuator.userdata[0] * parameter.value[0])

        def kd(spec: Any, parameter: Any, name: str = name) -> None:
            actuator = spec.actuator(name)
            sysid.apply_dgain(spec, name, actuator.userdata[1] * parameter.value[0])

        def limit(spec: Any, parameter: Any, name: str = name) -> None:
            spec.actuator(name).forcerange = np.array([-1, 1]) * parameter.value[0]

        for field, value, most in (
            ("armature", model.dof_armature[joint], bounds.armature),
            ("damping", model.dof_damping[joint], bounds.damping),
            ("frictionloss", model.dof_frictionloss[joint], bounds.friction),
        ):
            params.add(sysid.Parameter(f"{name}_{field}", value, 1e-5, most, modifier=of_joint(field)))
        params.add(sysid.Parameter(f"{name}_kp", 1.0, *GAINS, modifier=kp))
        if case.servo.kd[joint] > 0:
            params.add(sysid.Parameter(f"{name}_kd", 1.0, *GAINS, modifier=kd))
        if case.servo.limit_spread[joint] > 0:
            stated = case.servo.limit[joint]
            low, high = GAINS[0] * stated, GAINS[1] * stated
            params.add(sysid.Parameter(f"{name}_limit", stated, low, high, modifier=limit))
        lower, upper = case.servo.delay_lower[joint], case.servo.delay_upper[joint]
        params.add(sysid.Parameter(f"{name}_delay", lower, lower, upper))
    return params
