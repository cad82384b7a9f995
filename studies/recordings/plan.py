"""The plan of a study of recordings: which runs are fitted, which run is predicted, what is known."""

from pathlib import Path
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from identification.errors import InputError
from testbench.files import is_file
from testbench.scenario import first_fault
from testbench.shipped import shipped
from testbench.yaml_file import read_fields

FORM = "runs that are fitted -> the run that is predicted, as in 'A + B -> C'"


class RecordedRobot(BaseModel):
    """One recording. model: file in its folder. splits: of FORM. known: by its owners.

    right, wrong: names as EFFECT or EFFECT:JOINT; wrong may be ``any``.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    model: str
    splits: Annotated[tuple[str, ...], Field(min_length=1)]
    known: str = ""
    right: tuple[str, ...] = ()
    wrong: tuple[str, ...] = ()


class RecordingsPlan(BaseModel):
    """The plan file. recordings: by the name of their folder."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9_.-]+$")]
    recordings: Annotated[dict[str, RecordedRobot], Field(min_length=1)]


class Split(BaseModel):
    """One question: diagnose ``fitted``, predict ``held_out``. All paths exist."""

    model_config = ConfigDict(frozen=True)

    recording: str
    robot: RecordedRobot
    model: Path
    fitted: tuple[Path, ...]
    held_out: Path

    @property
    def key(self) -> str:
        """A name for files, of letters, digits, ``_``, ``+`` and ``-``."""
        return f"{self.recording}-{'+'.join(path.stem for path in self.fitted)}-{self.held_out.stem}"[:200]

    @property
    def title(self) -> str:
        """The split as a reader sees it."""
        fitted = [path.stem for path in self.fitted]
        names = " + ".join(fitted) if len(fitted) <= 3 else f"{fitted[0]} and {len(fitted) - 1} more"
        return f"{names} → {self.held_out.stem}"


def load_plan(path: Path, data: Path) -> list[Split]:
    """The splits of a plan whose recordings are present below ``data``. Raises InputError.

    A recording whose folder is not there is passed over; one of which a file lacks is refused.
    """
    path = shipped(path)
    content = read_fields(path)
    try:
        plan = RecordingsPlan.model_validate(content)
    except ValidationError as error:
        raise first_fault(path, RecordingsPlan, error) from None
    if not data.is_dir():
        raise InputError(data, "--data", "a folder with a folder a recording", "no folder")
    splits = []
    for name, robot in plan.recordings.items():
        folder = data / name
        if folder.is_dir():
            splits += [_split(path, folder, robot, text) for text in robot.splits]
    if not splits:
        raise InputError(data, "--data", f"some of the folders {', '.join(plan.recordings)}", "none of them")
    return splits


def _split(plan: Path, folder: Path, robot: RecordedRobot, text: str) -> Split:
    before, arrow, after = text.partition("->")
    names = [name.strip() for name in before.split("+")]
    held_out = after.strip()
    if not arrow or not held_out or not all(names):
        raise InputError(plan, f"recordings.{folder.name}.splits", FORM, repr(text))
    paths = [folder / f"{name}.h5" for name in (*names, held_out)]
    for path in (*paths, folder / robot.model):
        if path.parent != folder or not is_file(path):
            raise InputError(plan, f"recordings.{folder.name}", "files of that folder", path.name)
    return Split(
        recording=folder.name,
        robot=robot,
        model=folder / robot.model,
        fitted=tuple(paths[:-1]),
        held_out=paths[-1],
    )
