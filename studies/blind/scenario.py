"""The scenario of a blind study: how many cases of each kind, and what is varied between them."""

from pathlib import Path
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from identification.errors import InputError
from testbench.containment.names import FolderName
from testbench.files import is_file
from testbench.scenario import Fraction, Seconds, first_fault
from testbench.shipped import shipped
from testbench.yaml_file import read_fields

# Kind of a case: number of effects of the catalogue that act in it.
KINDS = {"single": 1, "pair": 2, "triple": 3, "none": 0, "unknown": 0}

Scale = Annotated[float, Field(ge=0, le=10, allow_inf_nan=False)]


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class CasesSection(_Section):
    """Number of cases of each kind. unknown: one effect that is in no catalogue."""

    single: Annotated[int, Field(ge=0, le=10_000)] = 220
    pair: Annotated[int, Field(ge=0, le=10_000)] = 60
    triple: Annotated[int, Field(ge=0, le=10_000)] = 15
    none: Annotated[int, Field(ge=0, le=10_000)] = 60
    unknown: Annotated[int, Field(ge=0, le=10_000)] = 60

    @model_validator(mode="after")
    def _some(self) -> "CasesSection":
        if not sum(self.model_dump().values()):
            raise ValueError("at least one case")
        return self


class RobotSection(_Section):
    """A robot that cases are drawn from. model: relative to the scenario. weight: how often, against others.

    error: scale of the model errors by which the simulated robot itself strays from the model, 0 for none.
    """

    model: Path
    weight: Annotated[float, Field(gt=0, allow_inf_nan=False)] = 1.0
    error: Scale = 0.0


class BackgroundSection(_Section):
    """share: of the cases that have a background. smallest, largest: its scale."""

    share: Fraction = 0.5
    smallest: Scale = 0.5
    largest: Scale = 1.0


class NominalSection(_Section):
    """smallest, largest: scale of CAD's errors in the nominal model.

    links_alone: share of the cases whose model has no friction and no rotors, as a URDF.
    """

    smallest: Scale = 0.3
    largest: Scale = 1.2
    links_alone: Fraction = 0.0


class RunsSection(_Section):
    """Runs that the diagnosis is given, their length and their rates; one more is hidden.

    held: share of the cases whose logs hold a sample now and then.
    """

    fewest: Annotated[int, Field(ge=1, le=20)] = 3
    most: Annotated[int, Field(ge=1, le=20)] = 5
    shortest: Seconds = 8.0
    longest: Seconds = 15.0
    sample_rates: Annotated[tuple[float, ...], Field(min_length=1)] = (500.0, 1000.0, 2000.0)
    physics_timestep: Seconds = 2.5e-4
    held: Fraction = 0.0


class BlindScenario(_Section):
    """A whole study. robots: at least one.

    least_moved: a case is drawn again when one of its effects moves less than this share of the torque at
    every joint.
    """

    name: FolderName
    seed: Annotated[int, Field(ge=0)] = 0
    cases: CasesSection = CasesSection()
    robots: Annotated[tuple[RobotSection, ...], Field(min_length=1)]
    background: BackgroundSection = BackgroundSection()
    nominal: NominalSection = NominalSection()
    runs: RunsSection = RunsSection()
    least_moved: Fraction = 0.002


def load_blind_scenario(path: str | Path, seed: int | None = None) -> BlindScenario:
    """The scenario of a YAML file, models found from it. seed: instead of the file's. Raises InputError."""
    path = shipped(path)
    content = read_fields(path)
    try:
        scenario = BlindScenario.model_validate(content)
    except ValidationError as error:
        raise first_fault(path, BlindScenario, error) from None
    for section, low, high in (
        ("background", "smallest", "largest"),
        ("nominal", "smallest", "largest"),
        ("runs", "fewest", "most"),
        ("runs", "shortest", "longest"),
    ):
        smallest, largest = (getattr(getattr(scenario, section), name) for name in (low, high))
        if largest < smallest:
            raise InputError(path, f"{section}.{high}", f"at least {low}, {smallest:g}", largest)
    robots = []
    for robot in scenario.robots:
        model = path.parent / robot.model
        if not is_file(model):
            raise InputError(path, "robots.model", "an existing MJCF or URDF file", robot.model)
        robots.append(robot.model_copy(update={"model": model}))
    changes: dict[str, Any] = {"robots": tuple(robots)}
    return scenario.model_copy(update=changes if seed is None else changes | {"seed": seed})
