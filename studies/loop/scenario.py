"""The scenario of a closed loop: the robot, what is withheld from the diagnosis, and its first motion."""

from pathlib import Path
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from identification.errors import InputError
from testbench.containment.names import FolderName
from testbench.files import is_file
from testbench.scenario import (
    BackgroundSection,
    EffectSection,
    Hertz,
    ModelErrorSection,
    NoiseSection,
    SimulationSection,
    first_fault,
)
from testbench.shipped import shipped
from testbench.yaml_file import read_fields


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class FirstSection(_Section):
    """The motions of the first round: seeded Fourier series, designed for nothing.

    limit_share: of every limit of the nominal model, that of the position too.
    """

    runs: Annotated[int, Field(ge=1, le=20)] = 2
    harmonics: Annotated[int, Field(ge=3, le=60)] = 5
    base_frequency: Hertz = 0.1
    limit_share: Annotated[float, Field(gt=0, le=1)] = 0.9


class LoopScenario(_Section):
    """A whole loop. model: MJCF or URDF of the true robot, relative to the scenario file.

    effects: what acts and is withheld. rounds: at most so many diagnoses. follow: what later rounds run:
    the proposed motion, or, to hold it against something, a random one within the same limits, or one more
    of the first kind. The other sections are those of ``testbench run``.
    """

    name: FolderName
    model: Path
    seed: Annotated[int, Field(ge=0)] = 0
    rounds: Annotated[int, Field(ge=1, le=20)] = 3
    effects: tuple[EffectSection, ...] = ()
    follow: Literal["proposed", "random", "first"] = "proposed"
    first: FirstSection = FirstSection()
    simulation: SimulationSection = SimulationSection()
    noise: NoiseSection = NoiseSection()
    background: BackgroundSection = BackgroundSection(scale=1.0)
    model_error: ModelErrorSection = ModelErrorSection(scale=1.0)


def load_loop_scenario(path: str | Path, seed: int | None = None) -> LoopScenario:
    """The scenario of a YAML file, its model found. seed: instead of the file's. Raises InputError."""
    path = shipped(path)
    try:
        scenario = LoopScenario.model_validate(read_fields(path))
    except ValidationError as error:
        raise first_fault(path, LoopScenario, error) from None
    model = path.parent / scenario.model
    if not is_file(model):
        raise InputError(path, "model", "an existing MJCF or URDF file", scenario.model)
    changes = {"model": model} | ({} if seed is None else {"seed": seed})
    return scenario.model_copy(update=changes)
