"""Robots that measure no torque: their drives, why their position is not the simulated one, predictions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..html_table import html_table

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from diagnosis.servos.findings import ServoDiagnosis, ServoFault
    from identification.output_error.servo_run import ServoRun

    from ..drives.differences import Difference
    from ..drives.identified import Figure
    from ..drives.job import DriveIdentification, PredictedPosition
    from ..drives.stated import StatedDrive
    from ..log import Recording
    from ..robot import Robot

    Array = NDArray[np.float64]
    # As stated, a YAML file that states it, or "position_servo": as the logs state it.
    Stated = StatedDrive | str | Path

# mrad (mm) a rad (m).
MILLI = 1e3


@dataclass(frozen=True)
class DriveEstimate:
    """The drives of a robot as identified from commanded and measured position.

    Attributes:
        details: everything that was found, with the fits behind it.
    """

    details: DriveIdentification

    @property
    def robot(self) -> Robot:
        """The model as given."""
        return self.details.found.robot

    @property
    def sentence(self) -> str:
        """By how much the position error shrinks, on the runs that judge."""
        from ..drives.words import headline

        return headline(self.details.errors)

    @property
    def figures(self) -> tuple[Figure, ...]:
        """Armature, friction, scales of gains, delay of every joint, with deviations and priors."""
        return self.details.found.figures

    @property
    def differences(self) -> tuple[Difference, ...]:
        """The figures that are not as stated, the best evidence first."""
        return self.details.differences

    @property
    def position_rms(self) -> Array:
        """RMS (2, n) rad (m) of the position error as given and as identified, on the runs that judge."""
        import numpy as np

        judged = self.details.errors[-1]
        return np.array([judged.given, judged.identified])

    def _repr_html_(self) -> str:
        """The headline, what the runs leave open, and each joint's figures."""
        from ..drives.words import figure_rows

        headings, rows = figure_rows(self.details.found)
        return html_table(headings, rows, (self.sentence, *self.details.remarks))

    def plot(self) -> Any:
        """The position error of each joint before and after, as a plotly figure."""
        from ..report.run_figures import bars_by_joint

        given, identified = MILLI * self.position_rms
        bars = {"as given": given, "identified": identified}
        return bars_by_joint(bars, self.robot.joint_names, "position RMS, mrad (mm)")


@dataclass(frozen=True)
class DriveDiagnosis:
    """A diagnosis of a robot that measures no torque, and the runs that it is of.

    Attributes:
        details: everything that was found.
        runs: the runs as they were simulated.
    """

    details: ServoDiagnosis
    runs: tuple[ServoRun, ...]

    @property
    def robot(self) -> Robot:
        """The model as given."""
        return self.details.found.robot

    @property
    def verdict(self) -> str:
        """``none``, ``parameters``, ``effect`` or ``unknown``."""
        return self.details.verdict

    @property
    def sentence(self) -> str:
        """The verdict in words."""
        from diagnosis.servos.words import sentence

        return sentence(self.details)

    @property
    def effects(self) -> tuple[ServoFault, ...]:
        """The effects that are stated, the likeliest first: name, joint, probability, parameters."""
        return self.details.effects

    def _repr_html_(self) -> str:
        """The verdict, and each effect with its probability."""
        from diagnosis.servos.words import notes, title

        rows = [(title(each), f"{100 * each.probability:.0f} %") for each in self.effects]
        return html_table(("effect", "probability"), rows, (self.sentence, *notes(self.details)))

    def plot(self) -> Any:
        """The position error of each joint by stage, as a plotly figure."""
        from diagnosis.servos.page import gap_by_joint

        return gap_by_joint(self.details)


@dataclass(frozen=True)
class PositionPrediction:
    """A run's command followed in closed loop, by the model as given and by the identified one.

    Attributes:
        details: both simulations, beside the run.
    """

    details: PredictedPosition

    @property
    def recording(self) -> Recording:
        """The run, on the even grid that the loop is simulated on."""
        return self.details.recording

    @property
    def position(self) -> Array:
        """Position (N, n) rad (m) of the identified loop."""
        return self.details.identified.position

    @property
    def torque(self) -> Array:
        """Torque (N, n) N·m (N) of its drives."""
        return self.details.identified.torque

    def _repr_html_(self) -> str:
        """RMS of each joint's position error by both models."""
        errors = self.details.errors
        given, identified = (MILLI * each for each in (errors.given, errors.identified))
        rows = zip(self.recording.joint_names, given.tolist(), identified.tolist(), strict=True)
        return html_table(("joint", "as given", "identified"), rows, ("Position error, RMS, mrad (mm)",))

    def plot(self) -> Any:
        """Position over time, a panel a joint, as a plotly figure."""
        from ..report.run_figures import by_joint

        positions = {"measured": self.details.measured.position}
        positions |= {"model as given": self.details.given.position, "identified": self.position}
        names, slides = self.recording.joint_names, self.recording.is_slide
        units = tuple("m" if slide else "rad" for slide in slides or (False,) * len(names))
        return by_joint(self.recording.time, positions, names, units)


def stated_drive(drive: Stated) -> StatedDrive:
    """The drive that is stated. Raises InputError for a file that states none."""
    from ..drives.stated import StatedDrive, read_stated
    from ..log import POSITION_SERVO

    if isinstance(drive, StatedDrive):
        return drive
    return StatedDrive() if drive == POSITION_SERVO else read_stated(Path(drive))


def identify_position(
    robot: Robot,
    runs: Mapping[str, Recording],
    judging: Mapping[str, Recording],
    drive: Stated,
    fit_share: float,
    effects: Sequence[str],
) -> DriveEstimate:
    """As ``identify`` of robots that measure no torque."""
    from ..drives.job import identify_servo_runs
    from ..drives.reading import servo_logs

    paths = [Path(name) for name in (*runs, *judging)]
    logs = servo_logs({**runs, **judging}, paths, robot, stated_drive(drive))
    return DriveEstimate(identify_servo_runs(robot, logs[: len(runs)], logs[len(runs) :], fit_share, effects))


def diagnose_position(
    robot: Robot, runs: Mapping[str, Recording], drive: Stated, without: Sequence[str]
) -> DriveDiagnosis:
    """As ``diagnose`` of robots that measure no torque."""
    from diagnosis.servos.job import diagnose_servo_runs

    from ..drives.reading import servo_logs

    stated = stated_drive(drive)
    logs = servo_logs(runs, [Path(name) for name in runs], robot, stated)
    return DriveDiagnosis(diagnose_servo_runs(robot, logs, stated, without), tuple(log.run for log in logs))


def predict_position(
    result: DriveEstimate | DriveDiagnosis | Path, run: Recording, drive: Stated | None
) -> PositionPrediction:
    """As ``predict`` of robots that measure no torque; result: a Path is the folder of one."""
    from ..drives.document import as_read, read_drives
    from ..drives.job import log_for, predicted

    drives = read_drives(result) if isinstance(result, Path) else as_read(result.details.found)
    stated = None if drive is None else stated_drive(drive)
    return PositionPrediction(predicted(drives, log_for(drives, run, Path("run"), "run", stated)))
