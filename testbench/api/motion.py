"""Motions designed to excite a robot, and the simulated robot along them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..blas import single_blas_thread
from ..html_table import html_table
from .notes import note

if TYPE_CHECKING:
    from identification.excitation.excitation import Excitation

    from ..jobs.excite import DesignRoom
    from ..log import Recording
    from ..robot import Robot

# Hz, of the samples of a plot.
PLOT_RATE = 200.0


@dataclass(frozen=True)
class Motion:
    """A designed motion.

    Attributes:
        robot: for which it was designed.
        excitation: the trajectory, its criteria and its peaks.
        room: the limits and the clearance that it keeps, and what the model did not settle.
    """

    robot: Robot
    excitation: Excitation
    room: DesignRoom

    def _repr_html_(self) -> str:
        """Each joint's peaks beside their limits."""
        from ..jobs.excite import PEAK_HEADINGS, peak_rows

        values, kept = self.excitation.values, self.excitation.margins.kept
        above = (
            f"{self.excitation.trajectory.duration:.3g} s, condition number {values.condition_number:.3g}, "
            f"limits {'kept' if kept else 'not kept'}",
            *self.room.notes,
        )
        return html_table(PEAK_HEADINGS, peak_rows(self.robot, self.excitation, self.room), above)

    def plot(self) -> Any:
        """Position, velocity and acceleration over one period, as a plotly figure."""
        import numpy as np

        from ..report.run_figures import by_quantity

        trajectory = self.excitation.trajectory
        time = np.arange(0.0, trajectory.duration, 1 / PLOT_RATE)
        labels = ("position, rad (m)", "velocity, rad/s (m/s)", "acceleration, rad/s² (m/s²)")
        values = dict(zip(labels, trajectory.evaluate(time), strict=True))
        return by_quantity(time, values, self.robot.joint_names)


@single_blas_thread()
def excite(
    robot: Robot,
    *,
    criterion: str = "logdet",
    trajectory: str = "fourier",
    harmonics: int = 5,
    base_frequency: float = 0.1,
    starts: int = 3,
    iterations: int = 100,
    limit_share: float = 0.9,
    velocity_limit: float | None = None,
    clearance: float | None = None,
    seed: int = 0,
) -> Motion:
    """A motion within the robot's limits that excites its parameters best.

    Args:
        robot: that is to move.
        criterion: ``logdet``, ``hadamard`` or ``condition``.
        trajectory: kind of motion, as ``testbench list`` shows them.
        harmonics: of the series, or segments of a quintic.
        base_frequency: Hz; the motion repeats at this rate.
        starts: seeded restarts.
        iterations: of the optimiser, at most, a start.
        limit_share: of the limits that may be used, 0 to 1.
        velocity_limit: rad/s (m/s), of joints whose model rates no speed.
        clearance: m between parts and to the floor; as there is room for when None.
        seed: of the starts; one seed, one motion.

    Raises:
        InputError: an option is out of range, or no motion keeps the limits.
    """
    from identification.excitation.excitation import DesignOptions

    from ..jobs.excite import designed

    options = DesignOptions(
        trajectory=trajectory,
        harmonics=harmonics,
        base_frequency=base_frequency,
        starts=starts,
        iterations=iterations,
        limit_share=limit_share,
        seed=seed,
    )
    return Motion(robot, *designed(robot, criterion, options, None, velocity_limit, clearance))


@single_blas_thread()
def simulate(
    robot: Robot,
    motion: Motion | str | Path,
    *,
    effects: Sequence[str] = (),
    periods: int = 2,
    controller: str = "pd_with_model_feedforward",
    bandwidth: float = 6.0,
    encoder_bits: int = 17,
    torque_noise: float | None = None,
    seed: int = 0,
) -> Recording:
    """The log of the simulated robot along a motion; with its truth, which no identification reads.

    Args:
        robot: that moves.
        motion: designed, or the file of one.
        effects: as ``NAME[:joint[:key=value,...]]``; what the robot has and its model lacks.
        periods: repetitions of the motion.
        controller: ``pd``, ``pd_with_model_feedforward`` or ``model``, the servos of its position actuators.
        bandwidth: Hz, of the position loop.
        encoder_bits: 2**bits counts a turn; 0 for an exact encoder.
        torque_noise: share of the torque limit; 0.01 where there is one when None.
        seed: of all noise; one seed, one log.

    Raises:
        InputError: an effect or an option is impossible, or the loop ran away.
    """
    from ..jobs.simulate import motion_for, options_of, simulate_along

    if isinstance(motion, Motion):
        trajectory, source = motion.excitation.trajectory, Path("motion")
    else:
        source = Path(motion)
        trajectory = motion_for(robot, source)
    options = options_of(controller, bandwidth, encoder_bits, torque_noise)
    recording, lines = simulate_along(
        robot, trajectory, source, periods, options, effects, seed, None, torque_noise is None
    )
    note(lines)
    return recording
