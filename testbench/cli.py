"""The command line: ``testbench run | excite | simulate | identify | list | view``.

Exit codes: 0 done, 2 bad input (one line on stderr), 1 a fault of ours. What a command needs is
imported when it is called, so that ``--help`` answers at once.
"""

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

from cyclopts import App, CycloptsError, Parameter

from identification.errors import InputError

app = App(
    name="testbench",
    help="Why does the simulator disagree with the robot? Identify an arm from its logs, and see.",
    version_flags=["--version"],
)

Jobs = Annotated[int | None, Parameter(help="worker threads; all cores when not given")]
Seed = Annotated[int | None, Parameter(help="seed of everything random")]
Model = Annotated[Path, Parameter(help="MJCF, or a URDF that MuJoCo reads")]


@app.command
def run(
    scenario: Annotated[Path, Parameter(help="scenario YAML")],
    *,
    out: Annotated[Path | None, Parameter(help="folder for the results; logs/NAME when not given")] = None,
    seed: Seed = None,
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
    harmonics: Annotated[int, Parameter(help="harmonics of the Fourier series")] = 5,
    base_frequency: Annotated[float, Parameter(help="Hz")] = 0.1,
    starts: Annotated[int, Parameter(help="seeded restarts")] = 3,
    limit_share: Annotated[float, Parameter(help="share of the model's limits to use, 0 to 1")] = 0.9,
    seed: Seed = None,
    jobs: Jobs = None,
) -> None:
    """Design an excitation within the limits of a model."""
    from .run import excite_model

    excite_model(model, out, criterion, harmonics, base_frequency, starts, limit_share, seed or 0, jobs)


@app.command
def simulate(
    *,
    model: Model,
    trajectory: Annotated[Path, Parameter(help="trajectory JSON, as excite writes it")],
    out: Annotated[Path, Parameter(help="robot-log HDF5 to write")],
    periods: Annotated[int, Parameter(help="repetitions of the trajectory")] = 2,
    controller: Annotated[
        str, Parameter(help="pd or pd_with_model_feedforward")
    ] = "pd_with_model_feedforward",
    encoder_bits: Annotated[int, Parameter(help="counts a turn, 2**bits; 0 for an exact encoder")] = 17,
    torque_noise: Annotated[float, Parameter(help="white noise as a share of the torque limit")] = 0.01,
    seed: Seed = None,
    jobs: Jobs = None,
) -> None:
    """Run the simulated robot along a trajectory and log it."""
    from .run import simulate_model

    simulate_model(
        model, trajectory, out, periods, controller, encoder_bits or None, torque_noise, seed or 0, jobs
    )


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
    dead_zone: Annotated[float, Parameter(help="rad/s; slower samples do not count")] = 0.05,
    seed: Seed = None,
    jobs: Jobs = None,
) -> None:
    """Identify a robot's base parameters from its logs and validate them on others."""
    from .identify import identify_logs

    identify_logs(model, logs, validate or [], out, estimator, differentiation, parameters, cutoff, dead_zone)


@app.command(name="list")
def list_names(*, json: Annotated[bool, Parameter(help="for machines")] = False) -> None:
    """What can be chosen: models, estimators, differentiation, trajectories, criteria, effects."""
    from .catalogue import print_catalogue

    print_catalogue(json)


@app.command
def view(directory: Annotated[Path, Parameter(help="folder that run has written")]) -> None:
    """Open a recorded Rerun session."""
    from .view import view as open_session

    open_session(directory)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the program and exit with its code."""
    tokens = list(sys.argv[1:] if arguments is None else arguments)
    try:
        app(tokens, exit_on_error=False, print_error=False, result_action="return_value")
    except CycloptsError as error:
        _complain(f"testbench: {' '.join(str(error).split())}")
    except InputError as error:
        _complain(str(error))
    except KeyboardInterrupt:
        print("testbench: interrupted; what was finished is kept", file=sys.stderr)
        sys.exit(130)


def _complain(line: str) -> None:
    print(line, file=sys.stderr)
    sys.exit(2)
