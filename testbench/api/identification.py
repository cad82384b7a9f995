"""The parameters of a robot, from its logs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, overload

from identification.errors import InputError

from ..blas import single_blas_thread
from .drives import identify_position

if TYPE_CHECKING:
    from ..log import Recording
    from ..results import IdentificationResult
    from ..robot import Robot
    from .drives import DriveEstimate, Stated


@overload
def identify(
    robot: Robot,
    runs: Mapping[str, Recording],
    validate: Mapping[str, Recording] | None = None,
    *,
    estimator: str = "wls",
    model: str = "inverse_dynamic",
    differentiation: str = "rloess",
    parameters: Sequence[str] | None = None,
    cutoff: float = 20.0,
    dead_zone: float = 0.02,
    strict: bool = False,
) -> IdentificationResult: ...


@overload
def identify(
    robot: Robot,
    runs: Mapping[str, Recording],
    validate: Mapping[str, Recording] | None = None,
    *,
    drive: Stated,
    fit_share: float = 1.0,
    effects: Sequence[str] = (),
) -> DriveEstimate: ...


@single_blas_thread()
def identify(
    robot: Robot,
    runs: Mapping[str, Recording],
    validate: Mapping[str, Recording] | None = None,
    *,
    estimator: str = "wls",
    model: str = "inverse_dynamic",
    differentiation: str = "rloess",
    parameters: Sequence[str] | None = None,
    cutoff: float = 20.0,
    dead_zone: float = 0.02,
    strict: bool = False,
    drive: Stated | None = None,
    fit_share: float = 1.0,
    effects: Sequence[str] = (),
) -> IdentificationResult | DriveEstimate:
    """The base parameters of a robot with their deviations, and how they predict runs that were not fitted.

    Of a robot that measures no torque (``drive``): its drives, from commanded and measured position.

    Args:
        robot: whose runs these are.
        runs: fitted, by name.
        validate: predicted, not fitted, by name.
        estimator: as ``testbench list`` shows them.
        model: the equations that are fitted, likewise.
        differentiation: likewise.
        parameters: groups among ``inertial``, ``armature``, ``viscous``, ``coulomb``, ``offset``;
            all when None.
        cutoff: Hz, of the low-pass on torque and regressor.
        dead_zone: rad/s; slower samples do not count.
        strict: refuse a motion that leaves a base parameter open, and hold nothing near the model.
        drive: of a robot that measures no torque: a ``StatedDrive``, the YAML file of one, or
            ``position_servo`` where the runs state their gains. No option above goes with it.
        fit_share: of each run without torque that is fitted, from its start; the rest judges.
        effects: without torque, fitted too at every joint: ``load_dependent_friction``,
            ``position_dependent_friction``, ``stribeck_friction``.

    Raises:
        InputError: a run is unsound or too short, or in both mappings, or an option has no such value, or
            not beside the others.
    """
    from ..jobs.identify import identify_runs, options_of

    judged = dict(validate or {})
    for name in judged:
        if name in runs:
            raise InputError("identify", "validate", "runs that are not fitted", repr(name))
    options = options_of(estimator, model, differentiation, parameters, cutoff, dead_zone, strict)
    if drive is not None:
        if options != options_of():
            names = "estimator, parameters, strict or a filter's option"
            raise InputError(
                "identify", names, "runs with torque", "a loop that is simulated, which has none"
            )
        return identify_position(robot, runs, judged, drive, fit_share, effects)
    if fit_share != 1 or effects:
        option = "effects" if effects else "fit_share"
        raise InputError("identify", option, "a drive, and runs without torque", "no drive")
    return identify_runs(robot, dict(runs), judged, options, [Path(name) for name in (*runs, *judged)])
