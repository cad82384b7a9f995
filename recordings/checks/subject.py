"""A robot's model and its runs as they are checked, and what several checks need of them."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

from testbench.log import Recording
from testbench.robot import Robot

from .convention_search import Candidate, search
from .model_fit import ModelFit
from .samples import Samples, slow_samples


@dataclass(frozen=True, eq=False)
class Subject:
    """robot: the model. recordings: the runs by name, with the model's joints in its order."""

    robot: Robot
    recordings: Mapping[str, Recording]

    @cached_property
    def samples(self) -> Samples | None:
        """Slow samples of all runs; None where they are too short."""
        return slow_samples(list(self.recordings.values()))

    @cached_property
    def fit(self) -> ModelFit | None:
        """The model against the samples; None where the runs are too short."""
        return None if self.samples is None else ModelFit(self.robot, self.samples)

    @cached_property
    def searched(self) -> tuple[Candidate, Candidate] | None:
        """The model's own convention and the likeliest; None where the runs are too short."""
        return None if self.fit is None else search(self.fit)

    def names(self, joints: list[int]) -> tuple[str, ...]:
        """The names of these joints."""
        return tuple(self.robot.joint_names[joint] for joint in joints)
