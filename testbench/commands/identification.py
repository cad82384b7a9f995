"""From a model to an estimate: the whole chain, and each of its steps."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from identification.errors import InputError

from .options import (
    AS_LOGGED,
    AS_STATED,
    Chosen,
    Drives,
    Jobs,
    Map,
    Model,
    ScenarioSeed,
    Seed,
    at_least,
    at_least_one,
)


def run(
    scenario: Annotated[Path, Parameter(help="scenario YAML")],
    /,
    *,
    out: Annotated[Path | None, Parameter(help="folder for the results; logs/NAME when not given")] = None,
    seed: ScenarioSeed = None,
    jobs: Jobs = None,
) -> None:
    """Design, simulate, log, identify, compare with the truth, report: the whole chain."""
    from ..jobs.run import run_scenario

    run_scenario(scenario, out, seed, jobs)


def excite(
    *,
    model: Model,
    out: Annotated[Path, Parameter(help="trajectory JSON to write")],
    criterion: Annotated[str, Parameter(help="hadamard, condition or logdet")] = "logdet",
    trajectory: Annotated[str, Parameter(help="kind of motion, see testbench list")] = "fourier",
    harmonics: Annotated[int, Parameter(help="harmonics of the series, or segments of a quintic")] = 5,
    base_frequency: Annotated[float, Parameter(help="Hz; the motion repeats at this rate")] = 0.1,
    starts: Annotated[int, Parameter(help="seeded restarts")] = 3,
    iterations: Annotated[int, Parameter(help="of the optimiser, at most, a start")] = 100,
    limit_share: Annotated[float, Parameter(help="share of the model's limits to use, 0 to 1")] = 0.9,
    velocity_limit: Annotated[
        float | None,
        Parameter(help="rad/s (m/s), of joints whose model rates no speed; 1 rad/s, 0.25 m/s when not given"),
    ] = None,
    clearance: Annotated[
        float | None,
        Parameter(help="m between parts, and to the floor; 0.03, or what there is room for, when not given"),
    ] = None,
    chosen: Chosen = AS_LOGGED,
    seed: Seed = 0,
    jobs: Jobs = None,
) -> None:
    """Design an excitation within the limits of a model."""
    from identification.excitation.excitation import DesignOptions

    from ..jobs.excite import excite_model

    options = DesignOptions(
        trajectory=trajectory,
        harmonics=harmonics,
        base_frequency=base_frequency,
        starts=starts,
        iterations=iterations,
        limit_share=limit_share,
        seed=seed,
    )
    excite_model(model, out, criterion, options, jobs, velocity_limit, clearance, chosen.choice())


def simulate(
    *,
    model: Model,
    trajectory: Annotated[Path, Parameter(help="trajectory JSON, as excite writes it")],
    out: Annotated[Path, Parameter(help="robot-log HDF5 to write")],
    effect: Annotated[
        list[str] | None,
        Parameter(help="NAME[:joint[:key=value,...]], what the model does not say; repeatable", negative=()),
    ] = None,
    periods: Annotated[int, Parameter(help="repetitions of the trajectory")] = 2,
    controller: Annotated[
        str, Parameter(help="pd, pd_with_model_feedforward, or model: the servos of its position actuators")
    ] = "pd_with_model_feedforward",
    bandwidth: Annotated[float, Parameter(help="Hz, of the position loop")] = 6.0,
    encoder_bits: Annotated[int, Parameter(help="counts a turn, 2**bits; 0 for an exact encoder")] = 17,
    torque_noise: Annotated[
        float | None,
        Parameter(help="white noise as a share of the torque limit; 0.01 where there is one when not given"),
    ] = None,
    chosen: Chosen = AS_LOGGED,
    seed: Seed = 0,
    jobs: Jobs = None,
) -> None:
    """Run the simulated robot along a trajectory and log it."""
    from ..jobs.simulate import options_of, simulate_model

    options = options_of(controller, bandwidth, encoder_bits, torque_noise)
    noisy = torque_noise is None
    simulate_model(model, trajectory, out, periods, options, effect or (), seed, jobs, chosen.choice(), noisy)


def identify(
    logs: Annotated[
        list[Path], Parameter(help="robot-logs, or recordings, to fit", consume_multiple=True, negative=())
    ],
    /,
    *,
    model: Model,
    out: Annotated[Path, Parameter(help="folder for estimate.json and report.html")],
    validate: Annotated[
        list[Path] | None,
        Parameter(
            help="logs that are predicted, not fitted",
            consume_multiple=True,
            negative=(),
            validator=at_least_one("--validate"),
        ),
    ] = None,
    estimator: Annotated[str, Parameter(help="see testbench list")] = "wls",
    identification_model: Annotated[
        str, Parameter(help="equations to fit, see models in testbench list")
    ] = "inverse_dynamic",
    differentiation: Annotated[str, Parameter(help="see testbench list")] = "rloess",
    parameters: Annotated[
        list[str] | None,
        Parameter(
            help="inertial armature viscous coulomb offset; all when not given",
            consume_multiple=True,
            negative=(),
            validator=at_least_one("--parameters"),
        ),
    ] = None,
    cutoff: Annotated[
        float, Parameter(help="Hz, low-pass on torque and regressor; less for joints with noisy encoders")
    ] = 20.0,
    dead_zone: Annotated[float, Parameter(help="rad/s; slower samples do not count")] = 0.02,
    map: Map = None,
    strict: Annotated[
        bool, Parameter(help="refuse a motion that leaves a base parameter open, hold nothing", negative=())
    ] = False,
    chosen: Chosen = AS_LOGGED,
    drives: Drives = AS_STATED,
    fit_share: Annotated[
        float, Parameter(help="of each log without torque that is fitted; the rest of it judges")
    ] = 1.0,
    effect: Annotated[
        list[str] | None,
        Parameter(
            help="without torque, fitted too; repeatable: load_dependent_friction, "
            "position_dependent_friction, stribeck_friction",
            negative=(),
        ),
    ] = None,
    write_model: Annotated[
        Path | None, Parameter(help="MJCF to write: the model as identified, physically consistent")
    ] = None,
    seed: Annotated[
        int, Parameter(help="taken, as everywhere; nothing here is random", validator=at_least(0, "--seed"))
    ] = 0,
    jobs: Annotated[
        int | None,
        Parameter(help="taken, as everywhere; the kernels use all cores", validator=at_least(1, "--jobs")),
    ] = None,
) -> None:
    """Identify a robot's base parameters from its logs and validate them on others."""
    from ..containment.folder import results_folder
    from ..jobs.identify import identify_logs, options_of
    from ..runs import first_look

    options = options_of(
        estimator, identification_model, differentiation, parameters, cutoff, dead_zone, strict
    )
    stated, choice = drives.stated(), chosen.choice()
    look = first_look(logs[0], model, choice, map)
    if stated is not None or look.servo:
        from ..drives.job import identify_servo_logs

        if options != options_of():
            names = "--estimator, --parameters, --strict or a filter's option"
            raise InputError(
                "testbench", names, "logs with torque", "a loop that is simulated, which has none"
            )

        with results_folder(out, ("estimate.json",)):
            identify_servo_logs(
                model,
                logs,
                validate or [],
                out,
                stated,
                fit_share,
                effect or (),
                write_model,
                map,
                choice,
                look.joint_names,
            )
        return
    if fit_share != 1 or effect:
        option = "--effect" if effect else "--fit-share"
        raise InputError("testbench", option, "logs without torque, or --drive", "logs with torque")
    with results_folder(out, ("estimate.json", "report.html")):
        identify_logs(model, logs, validate or [], out, options, write_model, map, choice, look.joint_names)
