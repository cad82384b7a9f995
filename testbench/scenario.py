"""The scenario file: one YAML that says what is simulated, identified and compared.

Numbers are in SI units at the joint. A value may also be written with its unit, such as
``0.1 Hz``; any other unit than the one named here is refused.
"""

import copy
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, get_args

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError

from identification.errors import InputError
from identification.parameters import DEFAULT_GROUPS

from .containment.names import FolderName, require_free
from .containment.shape import require_shape
from .model_reading.reading import Choice
from .shipped import shipped
from .yaml_file import read_fields

# Files that a run leaves in its folder, where the variants' folders are.
WRITTEN = ("estimate.json", "excitation.json", "fit.h5", "nominal.xml", "report.html", "session.rrd")


def _quantity(unit: str) -> BeforeValidator:
    """Accept a bare number, or a string of a number and exactly this unit."""

    def check(value: object) -> object:
        if not isinstance(value, str):
            return value
        number, _, given = value.strip().partition(" ")
        if given.strip() != unit:
            raise ValueError(f"a number in {unit}")
        return number

    return BeforeValidator(check)


Hertz = Annotated[float, _quantity("Hz"), Field(gt=0, allow_inf_nan=False)]
Seconds = Annotated[float, _quantity("s"), Field(gt=0, allow_inf_nan=False)]
Radians = Annotated[float, _quantity("rad"), Field(ge=0, allow_inf_nan=False)]
RadiansPerSecond = Annotated[float, _quantity("rad/s"), Field(ge=0, allow_inf_nan=False)]
Fraction = Annotated[float, Field(ge=0, le=1, allow_inf_nan=False)]


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, strict=False)


class ExcitationSection(_Section):
    """The excitation to design. starts: seeded restarts; limit_share: of the model's limits used.

    velocity_limit: rad/s (m/s), of joints whose model rates no speed, null for a cautious one. clearance: m
    between parts, and to the floor, null for what the robot has room for.
    """

    trajectory: Literal["fourier", "modified_fourier", "harmonic_sines", "quintic"] = "fourier"
    criterion: Literal["hadamard", "condition", "logdet"] = "logdet"
    harmonics: Annotated[int, Field(ge=3, le=50)] = 5
    base_frequency: Hertz = 0.1
    starts: Annotated[int, Field(ge=1, le=1000)] = 3
    limit_share: Annotated[float, Field(gt=0, le=1)] = 0.9
    velocity_limit: Annotated[float, _quantity("rad/s"), Field(gt=0, allow_inf_nan=False)] | None = None
    clearance: Annotated[float, _quantity("m"), Field(ge=0, allow_inf_nan=False)] | None = None


class ValidationSection(_Section):
    """Runs that are not fitted: seeded Fourier series within the same limits, not optimised."""

    runs: Annotated[int, Field(ge=0, le=100)] = 2
    harmonics: Annotated[int, Field(ge=3, le=50)] = 5
    base_frequency: Hertz = 0.1


class SimulationSection(_Section):
    """How the robot is driven.

    periods: repetitions of the excitation; the controller's kind, rate and bandwidth.
    """

    periods: Annotated[int, Field(ge=1, le=10_000)] = 2
    controller: Literal["pd", "pd_with_model_feedforward", "model"] = "pd_with_model_feedforward"
    control_rate: Hertz = 1000.0
    bandwidth: Hertz = 6.0
    physics_timestep: Seconds = 2e-4


class NoiseSection(_Section):
    """What the sensors add.

    encoder_bits: counts a turn, 2**bits (null: exact). slide_resolution: m, of a slide joint's
    encoder. position: white noise, rad (m). torque: standard deviation as a share of the torque
    limit. torque_correlation_time: s, 0 for white. torque_bias: as a share of the torque limit.
    torque_delay: s that the torque channel lags the position.
    """

    encoder_bits: Annotated[int, Field(ge=4, le=40)] | None = 17
    slide_resolution: Annotated[float, _quantity("m"), Field(ge=0, allow_inf_nan=False)] = 1e-6
    position: Radians = 0.0
    torque: Fraction = 0.01
    torque_correlation_time: Annotated[float, _quantity("s"), Field(ge=0, allow_inf_nan=False)] = 0.0
    torque_bias: Annotated[float, Field(ge=-1, le=1, allow_inf_nan=False)] = 0.0
    torque_delay: Annotated[float, _quantity("s"), Field(ge=0, le=0.1, allow_inf_nan=False)] = 0.0


class IdentificationSection(_Section):
    """How the logs become parameters; names as ``testbench list`` shows them."""

    model: str = "inverse_dynamic"
    estimator: str = "wls"
    differentiation: str = "rloess"
    parameters: tuple[str, ...] = DEFAULT_GROUPS
    cutoff: Hertz = 20.0
    dead_zone: RadiansPerSecond = 0.02


class EffectSection(_Section):
    """One unmodelled effect of the simulated robot; names and parameters as in docs/effects.md.

    joint, into: a joint's name, or its number from 1. law: null for the effect's first. values: SI;
    what is left out is the middle of the typical range.
    """

    effect: str
    joint: str | int | None = None
    into: str | int | None = None
    law: str | None = None
    values: dict[str, Annotated[float, Field(allow_inf_nan=False)]] = {}


class BackgroundSection(_Section):
    """Small imperfections of every joint, drawn by seed; they bring their own sensors. scale: 0 for none."""

    scale: Annotated[float, Field(ge=0, le=10, allow_inf_nan=False)] = 0.0


class ModelErrorSection(_Section):
    """A nominal model drawn around the robot's, which the controller knows. scale: of CAD's errors."""

    scale: Annotated[float, Field(ge=0, le=10, allow_inf_nan=False)] = 0.0


class RecordedSection(_Section):
    """A robot's own runs, compared beside the simulated ones where the files exist. Paths as ``model``.

    model: its nominal model. halves: two logs, each fitted to predict the other.
    """

    model: Path
    halves: tuple[Path, Path]


class ComparisonSection(_Section):
    """What ``testbench compare`` repeats. The scenario and its variants are the levels it is done at.

    level: name of the scenario's own. repetitions: seeds. choices: what is compared, everything when empty.
    difference_starts: designs of each criterion with finite-difference gradients.
    """

    level: str = "default"
    repetitions: Annotated[int, Field(ge=1, le=1000)] = 5
    choices: tuple[str, ...] = ()
    difference_starts: Annotated[int, Field(ge=0, le=100)] = 2
    recorded: RecordedSection | None = None


class Scenario(_Section):
    """A whole scenario. model: MJCF or URDF, relative to the scenario file.

    joints: that move, null for all but a gripper's; the others are held still. fix_base: hold a floating
    base. packages: folders of ROS packages by name, relative to the scenario file.

    variants: name to the fields that differ; each is run beside the scenario itself.
    """

    name: FolderName
    model: Path
    joints: tuple[str, ...] | None = None
    fix_base: bool = False
    packages: dict[str, Path] = {}
    seed: Annotated[int, Field(ge=0)] = 0
    excitation: ExcitationSection = ExcitationSection()
    simulation: SimulationSection = SimulationSection()
    noise: NoiseSection = NoiseSection()
    effects: tuple[EffectSection, ...] = ()
    background: BackgroundSection = BackgroundSection()
    model_error: ModelErrorSection = ModelErrorSection()
    validation: ValidationSection = ValidationSection()
    identification: IdentificationSection = IdentificationSection()
    comparison: ComparisonSection = ComparisonSection()

    @property
    def choice(self) -> Choice:
        """Which part of the model is the robot."""
        return Choice(self.joints, self.fix_base, self.packages)


def load_scenario(path: str | Path) -> tuple[Scenario, dict[str, Scenario]]:
    """The scenario of a YAML file, and its variants by name.

    Raises InputError naming the file, the field, what was expected and what came.
    """
    path = shipped(path)
    content = read_fields(path, flags=("fix_base",))
    variants = content.pop("variants", None) or {}
    if not isinstance(variants, dict) or not all(isinstance(v, dict) for v in variants.values()):
        raise InputError(path, "variants", "a mapping of names to fields", repr(variants)[:80])
    scenario = _validated(path, "", content)
    names = require_shape(path, dict[FolderName, Any], {str(name): 0 for name in variants}, "variants.")
    require_free(names, WRITTEN, path, "variants")
    out = {}
    for name, changes in variants.items():
        named = {"name": f"{content.get('name', '')}-{name}"}
        out[str(name)] = _validated(path, f"variants.{name}.", _merged(content, changes | named))
    return scenario, out


def _merged(base: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """``base`` with ``changes`` laid over it, section by section."""
    merged = copy.deepcopy(dict(base))
    for key, value in changes.items():
        if isinstance(value, dict) and isinstance(merged.get(key), dict):
            merged[key] = _merged(merged[key], value)
        else:
            merged[key] = value
    return merged


def _validated(path: Path, prefix: str, content: Mapping[str, Any]) -> Scenario:
    try:
        scenario = Scenario.model_validate(content)
    except ValidationError as error:
        raise first_fault(path, Scenario, error, prefix) from None
    packages = {name: (path.parent / folder).resolve() for name, folder in scenario.packages.items()}
    for name, folder in packages.items():
        if not folder.is_dir():
            raise InputError(path, f"{prefix}packages.{name}", "an existing folder", folder)
    update: dict[str, Any] = {"model": path.parent / scenario.model, "packages": packages}
    recorded = scenario.comparison.recorded
    if recorded is not None:
        places = {
            "model": path.parent / recorded.model,
            "halves": [path.parent / log for log in recorded.halves],
        }
        found = recorded.model_copy(update=places)
        update["comparison"] = scenario.comparison.model_copy(update={"recorded": found})
    return scenario.model_copy(update=update)


def first_fault(path: Path, model: type[BaseModel], error: ValidationError, prefix: str = "") -> InputError:
    """The first fault of validating a file against ``model``, in one line. prefix: of the field's name."""
    fault = error.errors()[0]
    location = [str(part) for part in fault["loc"]]
    field = prefix + ".".join(location)
    if fault["type"] == "extra_forbidden":
        section: Any = model
        for part in fault["loc"][:-1]:
            # A number is a place in a list, whose annotation is tuple[section, ...].
            section = get_args(section)[0] if isinstance(part, int) else section.model_fields[part].annotation
        return InputError(path, field, "a known field", repr(location[-1]), section.model_fields)
    if fault["type"] == "missing":
        return InputError(path, field, "a value", "nothing")
    expected = fault["msg"].removeprefix("Value error, ").removeprefix("Input should be ")
    return InputError(path, field, expected, repr(fault["input"])[:80])
