"""The parameters of a robot, from its logs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from identification.errors import InputError

from ..blas import single_blas_thread

if TYPE_CHECKING:
    from ..log import Recording
    from ..results import IdentificationResult
    from ..robot import Robot


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
) -> IdentificationResult:
    """The base parameters of a robot with their deviations, and how they predict runs that were not fitted.

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

    Raises:
        InputError: a run is unsound or too short, or in both mappings, or an option has no such value.
    """
    from ..jobs.identify import identify_runs, options_of

    judged = dict(validate or {})
    for name in judged:
        if name in runs:
            raise InputError("identify", "validate", "runs that are not fitted", repr(name))
    options = options_of(estimator, model, differentiation, parameters, cutoff, dead_zone, strict)
    return identify_runs(robot, dict(runs), judged, options, [Path(name) for name in (*runs, *judged)])
