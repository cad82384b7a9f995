"""A designed motion, and what is known about it."""

from dataclasses import dataclass, field

from ..errors import InputError
from ..parameters import DEFAULT_GROUPS
from .criteria import CriterionValues
from .limits import LimitMargins
from .trajectory import Trajectory


@dataclass(frozen=True)
class DesignOptions:
    """How a motion is designed.

    trajectory: its kind, a name in ``TRAJECTORIES``. harmonics: of the series (segments of a quintic
    path), at least 2. base_frequency: Hz. groups: parameters to excite. starts: random starting points.
    iterations: of the optimiser, at most, a start. limit_share: of the position, velocity, acceleration
    and torque limits that may be used; the rest is the tracking controller's. seed: of the random starts.
    """

    trajectory: str = "fourier"
    harmonics: int = 5
    base_frequency: float = 0.1
    groups: tuple[str, ...] = DEFAULT_GROUPS
    starts: int = 3
    iterations: int = 100
    limit_share: float = 0.95
    seed: int = 0

    def __post_init__(self) -> None:
        for name in ("starts", "iterations"):
            if getattr(self, name) < 1:
                raise InputError("excitation", name, "at least 1", getattr(self, name))
        if not 0 < self.limit_share <= 1:
            raise InputError("excitation", "limit_share", "a share above 0 and up to 1", self.limit_share)


@dataclass(frozen=True)
class Excitation:
    """A motion that keeps the limits, and how informative it is.

    joint_names: n names. trajectory: the motion. criterion: what it was optimised for, None for a
    random motion. values: all criteria, of the whole motion. margins: to the limits given, on the fine grid.
    options: how it was designed. evaluations: of the criterion, over all starts. start_values: the
    criterion each start reached. seconds: wall time; not part of what makes two results equal, and
    None where unknown.
    """

    joint_names: tuple[str, ...]
    trajectory: Trajectory
    criterion: str | None
    values: CriterionValues
    margins: LimitMargins
    options: DesignOptions
    evaluations: int
    start_values: tuple[float, ...]
    seconds: float | None = field(default=None, compare=False)
