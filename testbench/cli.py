"""The command line: ``testbench run | excite | simulate | identify | compare | diagnose | ...``.

Exit codes: 0 done, 2 bad input (one line on stderr), 1 a fault of ours. What a command needs is
imported when it is called, so that ``--help`` answers at once.
"""

import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated, Any

from cyclopts import (
    App,
    CoercionError,
    CycloptsError,
    MissingArgumentError,
    Parameter,
    UnknownCommandError,
    UnknownOptionError,
)

from identification.errors import InputError

app = App(
    name="testbench",
    help="Why does the simulator disagree with the robot? Identify an arm from its logs, and see.",
    version_flags=["--version"],
)

# What an option wants that is not a word.
NUMBERS: dict[type | None, str] = {int: "a whole number", float: "a number"}


def _at_least(lowest: int, option: str) -> Callable[[Any, Any], None]:
    """A cyclopts validator."""

    def check(_: Any, value: Any) -> None:
        if value is not None and value < lowest:
            raise InputError("testbench", option, f"a whole number of at least {lowest}", value)

    return check


Jobs = Annotated[
    int | None,
    Parameter(help="worker threads; all cores when not given", validator=_at_least(1, "--jobs")),
]
Seed = Annotated[
    int, Parameter(help="seed of everything random; one seed, one result", validator=_at_least(0, "--seed"))
]
Model = Annotated[Path, Parameter(help="MJCF, or a URDF that MuJoCo reads")]


@app.command
def run(
    scenario: Annotated[Path, Parameter(help="scenario YAML")],
    /,
    *,
    out: Annotated[Path | None, Parameter(help="folder for the results; logs/NAME when not given")] = None,
    seed: Annotated[
        int | None, Parameter(help="instead of the scenario's", validator=_at_least(0, "--seed"))
    ] = None,
    jobs: Jobs = None,
) -> None:
    """Design, simulate, log, identify, compare with the truth, report: the whole chain."""
    from .run import run_scenario

    run_scenario(scenario, out, seed, jobs)


@app.command
def excite(
    *,
    model: Model,
    out: Annotated[Path, Parameter(help="trajectory JSON to write")],
    criterion: Annotated[str, Parameter(help="hadamard, condition or logdet")] = "logdet",
    trajectory: Annotated[str, Parameter(help="kind of motion, see testbench list")] = "fourier",
    harmonics: Annotated[int, Parameter(help="harmonics of the series, or segments of a quintic")] = 5,
    base_frequency: Annotated[float, Parameter(help="Hz; the motion repeats at this rate")] = 0.1,
    starts: Annotated[int, Parameter(help="seeded restarts")] = 3,
    limit_share: Annotated[float, Parameter(help="share of the model's limits to use, 0 to 1")] = 0.9,
    seed: Seed = 0,
    jobs: Jobs = None,
) -> None:
    """Design an excitation within the limits of a model."""
    from identification.excitation.excitation import DesignOptions

    from .excite import excite_model

    options = DesignOptions(
        trajectory=trajectory,
        harmonics=harmonics,
        base_frequency=base_frequency,
        starts=starts,
        limit_share=limit_share,
        seed=seed,
    )
    excite_model(model, out, criterion, options, jobs)


@app.command
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
        str, Parameter(help="pd or pd_with_model_feedforward")
    ] = "pd_with_model_feedforward",
    encoder_bits: Annotated[int, Parameter(help="counts a turn, 2**bits; 0 for an exact encoder")] = 17,
    torque_noise: Annotated[float, Parameter(help="white noise as a share of the torque limit")] = 0.01,
    seed: Seed = 0,
    jobs: Jobs = None,
) -> None:
    """Run the simulated robot along a trajectory and log it."""
    from .simulate import simulate_model
    from .simulation import ControllerOptions, SensorOptions, SimulationOptions

    options = SimulationOptions(
        controller=ControllerOptions(kind=controller),
        sensors=SensorOptions(
            encoder_bits=encoder_bits,
            slide_resolution=1e-6 if encoder_bits else 0.0,
            torque_noise=torque_noise,
        ),
        physics_timestep=2e-4,
    )
    simulate_model(model, trajectory, out, periods, options, effect or (), seed, jobs)


@app.command
def identify(
    logs: Annotated[list[Path], Parameter(help="robot-log files to fit", consume_multiple=True, negative=())],
    /,
    *,
    model: Model,
    out: Annotated[Path, Parameter(help="folder for estimate.json and report.html")],
    validate: Annotated[
        list[Path] | None,
        Parameter(help="logs that are predicted, not fitted", consume_multiple=True, negative=()),
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
        ),
    ] = None,
    cutoff: Annotated[float, Parameter(help="Hz, low-pass on torque and regressor")] = 20.0,
    dead_zone: Annotated[float, Parameter(help="rad/s; slower samples do not count")] = 0.02,
    write_model: Annotated[
        Path | None, Parameter(help="MJCF to write: the model as identified, physically consistent")
    ] = None,
    seed: Annotated[
        int, Parameter(help="taken, as everywhere; nothing here is random", validator=_at_least(0, "--seed"))
    ] = 0,
    jobs: Annotated[
        int | None,
        Parameter(help="taken, as everywhere; the kernels use all cores", validator=_at_least(1, "--jobs")),
    ] = None,
) -> None:
    """Identify a robot's base parameters from its logs and validate them on others."""
    from identification.models import Preprocessing
    from identification.parameters import GROUPS
    from identification.pipeline import IdentificationOptions

    from .identify import identify_logs

    groups = tuple(GROUPS) if parameters is None else tuple(parameters)
    preprocessing = Preprocessing(cutoff, differentiation, dead_zone, identification_model)
    options = IdentificationOptions(estimator, groups, preprocessing)
    identify_logs(model, logs, validate or [], out, options, write_model)


@app.command
def diagnose(
    logs: Annotated[list[Path], Parameter(help="robot-log files", consume_multiple=True, negative=())],
    /,
    *,
    model: Model,
    out: Annotated[Path, Parameter(help="folder for diagnosis.json, corrected.xml and report.html")],
    without: Annotated[
        list[str] | None,
        Parameter(help="effects to leave out of the catalogue", consume_multiple=True, negative=()),
    ] = None,
    seed: Seed = 0,
    jobs: Jobs = None,
) -> None:
    """Say why simulator and robot differ: where, which effect, how far it shrinks, what to do next."""
    from diagnosis.job import diagnose_logs
    from diagnosis.report import print_summary

    print_summary(*diagnose_logs(model, logs, out, without or (), seed, jobs))


@app.command
def predict(
    log: Annotated[Path, Parameter(help="robot-log whose motion to predict along")],
    /,
    *,
    diagnosis: Annotated[Path, Parameter(help="folder that diagnose has written")],
    out: Annotated[Path, Parameter(help="HDF5 to write")],
) -> None:
    """Predict the torque along a log's motion by the corrected model; the log's torque is not read."""
    from diagnosis.predict import predict as predict_torque

    predict_torque(diagnosis, log, out)


@app.command
def loop(
    scenario: Annotated[Path, Parameter(help="loop scenario YAML")],
    /,
    *,
    out: Annotated[
        Path, Parameter(help="folder for rounds, loop.json and report.html; a second call resumes")
    ],
    seed: Annotated[
        int | None, Parameter(help="instead of the scenario's", validator=_at_least(0, "--seed"))
    ] = None,
    jobs: Jobs = None,
) -> None:
    """Close the loop on a simulated robot: diagnose, run the proposed motion, diagnose again."""
    from diagnosis.loop.job import close_loop

    close_loop(scenario, out, seed, jobs)


@app.command
def compare(
    question: Annotated[str, Parameter(help="criteria, estimators, differentiation or trajectories")],
    scenario: Annotated[
        Path | None, Parameter(help="scenario YAML; scenarios/compare_QUESTION.yaml when not given")
    ] = None,
    /,
    *,
    out: Annotated[Path, Parameter(help="folder for cases, CSV and report.html; a second call resumes")],
    jobs: Annotated[
        int | None,
        Parameter(help="processes; all cores when not given", validator=_at_least(1, "--jobs")),
    ] = None,
    scheduler: Annotated[
        str | None, Parameter(help="address of a Dask scheduler whose workers run the cases")
    ] = None,
    seed: Annotated[
        int | None, Parameter(help="instead of the scenario's", validator=_at_least(0, "--seed"))
    ] = None,
) -> None:
    """Compare every choice over seeds and noise levels; resumable, in parallel."""
    from .compare import compare as run_comparison

    run_comparison(question, scenario, out, jobs, scheduler, seed)


@app.command(name="list")
def list_names(*, json: Annotated[bool, Parameter(help="for machines", negative=())] = False) -> None:
    """What can be chosen: models, estimators, differentiation, trajectories, criteria, effects."""
    from .catalogue import print_catalogue

    print_catalogue(json)


effects = App(name="effects", help="Effects that a model leaves out: put them into MJCF, or document them.")
app.command(effects)


@effects.command(name="write")
def write_effects(
    *,
    model: Model,
    effect: Annotated[list[str], Parameter(help="NAME[:joint[:key=value,...]]; repeatable", negative=())],
    out: Annotated[Path, Parameter(help="MJCF to write")],
) -> None:
    """Write a model that plain MuJoCo runs with the effects; says what MJCF cannot carry."""
    from .effects_page import write_effects_model

    for sentence in write_effects_model(model, effect, out):
        print(sentence)


@effects.command
def page(
    *,
    model: Model,
    out: Annotated[Path, Parameter(help="Markdown to write; pictures go to the folder of its name")],
    joint: Annotated[int, Parameter(help="number from 1 of the joint that is shown")] = 2,
    jobs: Jobs = None,
) -> None:
    """Simulate every effect and write the catalogue's page with measured pictures."""
    from .effects_page import write_effects_page

    write_effects_page(model, out, joint, jobs)


blind = App(name="blind", help="Withheld effects: sealed cases, and how often the diagnosis finds them.")
app.command(blind)

BlindScenario = Annotated[Path, Parameter(help="blind scenario YAML")]
ScenarioSeed = Annotated[
    int | None, Parameter(help="instead of the scenario's", validator=_at_least(0, "--seed"))
]
Processes = Annotated[
    int | None, Parameter(help="processes; all cores when not given", validator=_at_least(1, "--jobs"))
]


@blind.command(name="make")
def blind_make(
    scenario: BlindScenario,
    /,
    *,
    out: Annotated[
        Path, Parameter(help="folder for cases/, sealed/ and manifest.json; a second call resumes")
    ],
    seed: ScenarioSeed = None,
    jobs: Processes = None,
) -> None:
    """Draw and simulate cases, and seal their answers."""
    from diagnosis.blind.jobs import make

    make(scenario, out, seed, jobs)


@blind.command(name="score")
def blind_score(
    cases: Annotated[Path, Parameter(help="folder that blind make has written")],
    /,
    *,
    diagnoses: Annotated[Path, Parameter(help="folder with case_0001/diagnosis.json and so on")],
    out: Annotated[Path, Parameter(help="folder for score.json, cases.csv and report.html")],
) -> None:
    """Open the sealed answers and score the diagnoses."""
    from diagnosis.blind.jobs import score

    score(cases, diagnoses, out)


@blind.command(name="study")
def blind_study(
    scenario: BlindScenario,
    /,
    *,
    out: Annotated[Path, Parameter(help="folder for results and scores; a second call resumes")],
    without: Annotated[
        str | None, Parameter(help="effect to leave out of the catalogue; same: each single case's own")
    ] = None,
    keep_logs: Annotated[bool, Parameter(help="keep the cases, to diagnose them again", negative=())] = False,
    seed: ScenarioSeed = None,
    jobs: Processes = None,
) -> None:
    """Make, diagnose and score every case of a scenario; resumable, in parallel."""
    from diagnosis.blind.study import study

    study(scenario, out, seed, jobs, keep_logs, without)


@app.command
def view(directory: Annotated[Path, Parameter(help="folder that run has written")], /) -> None:
    """Open a recorded Rerun session."""
    from .view import view as open_session

    open_session(directory)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the program and exit with its code."""
    tokens = list(sys.argv[1:] if arguments is None else arguments)
    try:
        app(tokens, exit_on_error=False, print_error=False, result_action="return_value")
    except CycloptsError as error:
        _complain(str(_usage(error)))
    except InputError as error:
        _complain(str(error))
    except KeyboardInterrupt:
        print("testbench: interrupted; what was finished is kept", file=sys.stderr)
        sys.exit(130)


def _usage(error: CycloptsError) -> InputError:
    """A fault of the arguments in the form of every other fault."""
    if isinstance(error, UnknownCommandError):
        names = sorted(name for name in app if not name.startswith("-"))
        return InputError("testbench", "command", "a command", repr((error.unused_tokens or [""])[0]), names)
    if isinstance(error, UnknownOptionError):
        got = error.token.keyword or error.token.value
        return InputError("testbench", "option", "an option that --help shows", got)
    if isinstance(error, CoercionError) and error.token is not None:
        expected = NUMBERS.get(error.target_type, "a valid value")
        return InputError("testbench", error.token.keyword or "argument", expected, repr(error.token.value))
    if isinstance(error, MissingArgumentError) and error.argument is not None:
        return InputError("testbench", error.keyword or error.argument.name, "a value", "none")
    return InputError("testbench", "arguments", "what --help shows", str(error))


def _complain(line: str) -> None:
    print(line, file=sys.stderr)
    sys.exit(2)
