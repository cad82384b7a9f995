"""What one identification run leaves behind for the summary, the report and the Rerun session."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.band import Bands
from identification.determination import Determination
from identification.estimate import Estimate, TorqueFit
from identification.shrinkage import Shrinkage
from identification.statistics import EssentialParameters, ResidualTests
from recordings.checks.finding import Finding

from .html_table import html_table
from .log import Recording
from .robot import Robot

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Comparison:
    """The estimate held against the ground truth, which only a simulated robot has.

    truth, error: (b,). cramer_rao: (b,) smallest standard deviation any unbiased estimator could
    reach on the same data. noise_floor: (n,) N·m, torque RMS that sensor noise alone leaves after
    the filters, on validation runs (fit runs when there are none).
    """

    truth: Array
    error: Array
    cramer_rao: Array
    noise_floor: Array


@dataclass(frozen=True)
class IdentificationResult:
    """An estimate and everything needed to show it.

    robot: the model it was made with. estimate: parameters. fits, validations: how it predicts
    each run, in the order of fit_recordings and validation_recordings. comparison: with the truth,
    or None where it is unknown. residual_tests: of the torque residual of the fit runs. essential: the base
    parameters that the data cannot do without. Both are None where the equations are not at hand. mended: how
    many samples of all logs were lost on the way, and are interpolated. given: the torque that the model as
    given predicts along the runs of fits and validations. bands, shrinkage, determination: as of
    Identification. log_findings: of the checks of the logs.
    """

    robot: Robot
    estimate: Estimate
    fits: tuple[TorqueFit, ...]
    validations: tuple[TorqueFit, ...]
    fit_recordings: tuple[Recording, ...]
    validation_recordings: tuple[Recording, ...]
    comparison: Comparison | None = None
    residual_tests: ResidualTests | None = None
    essential: EssentialParameters | None = None
    mended: int = 0
    given: tuple[TorqueFit, ...] = ()
    bands: Bands | None = None
    shrinkage: Shrinkage | None = None
    determination: Determination | None = None
    log_findings: tuple[Finding, ...] = ()

    @property
    def needed(self) -> tuple[bool | None, ...]:
        """Whether each base parameter is essential; None where that is not known."""
        count = self.estimate.base.count
        if self.essential is None:
            return (None,) * count
        return tuple(index in self.essential.kept for index in range(count))

    def _repr_html_(self) -> str:
        """The headline, and the torque error of each joint."""
        from .findings import headline, left_open, torque_error

        errors = {"fit": torque_error(self.fits), "validation": torque_error(self.validations)}
        known = {role: error for role, error in errors.items() if error is not None}
        headings = [cell for role in known for cell in (f"{role}, RMS", f"{role}, % of torque")]
        columns = [each.tolist() for error in known.values() for each in (error.rms, 100 * error.relative)]
        rows = zip(self.robot.joint_names, self.robot.units(), *columns, strict=True)
        return html_table(("joint", "unit", *headings), rows, (headline(self), *left_open(self)))

    def plot(self) -> Any:
        """Measured and predicted torque of a run, not a fitted one where there is one, as a plotly figure."""
        from .report.figures import judged_run, torque

        return torque(judged_run(self), self.robot.joint_names, self.robot.units())
