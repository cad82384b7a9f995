"""A robot as its MJCF (or URDF) describes it: names, limits, chain and ground truth."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from identification.chain import Chain, chain_from_model
from identification.errors import InputError

from .containment.child import contained
from .containment.model import EXPECTED, require_readable, require_sound_model
from .files import require_file
from .html_table import html_table
from .model_reading.limits import Limits, model_limits
from .model_reading.reading import Choice, Source, read_model
from .shipped import shipped
from .unmodelled_forces import unmodelled_forces

Array = NDArray[np.float64]

# Name of the custom text by which a model says which of its forces effects put there.
EFFECTS_WRITTEN = "effects_written"
# Forces that a refusal names.
NAMED_FORCES = 3


@dataclass(frozen=True)
class Robot:
    """A model on disk and what was read from it.

    name: the model's own. source: the file, and what of it is the robot. model: compiled MuJoCo model.
    chain: kinematics. parameters: (14 links,) standard parameters of the model itself. limits: joint limits.
    notes: sentences on what of the file was held still, ignored, left out or changed.
    """

    name: str
    source: Source
    model: mujoco.MjModel
    chain: Chain
    parameters: Array
    limits: Limits
    notes: tuple[str, ...] = ()

    @property
    def path(self) -> Path:
        """The model's file."""
        return self.source.path

    @property
    def described(self) -> str:
        """The file's name, and in brackets what of it is not the robot as it is."""
        return f"{self.path.name} ({'; '.join(self.notes)})" if self.notes else self.path.name

    def spec(self) -> Any:
        """The robot as an MjSpec of its own, read anew: what was held still has no joint in it."""
        return read_model(self.source).spec

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Joint names, base to tip."""
        return self.chain.joint_names

    @property
    def joints(self) -> int:
        """Number of joints."""
        return self.chain.joints

    def units(self) -> tuple[str, ...]:
        """Unit of each joint's torque: N·m for a hinge, N for a slide."""
        return tuple("N" if slide else "N·m" for slide in self.chain.is_slide)

    def _repr_html_(self) -> str:
        """Each joint's limits."""
        limits = self.limits
        shown = (limits.lower, limits.upper, limits.velocity, limits.acceleration, limits.torque)
        rows = zip(self.joint_names, *(each.tolist() for each in shown), self.units(), strict=True)
        headings = ("joint", "from, rad (m)", "to", "speed, rad/s", "acceleration, rad/s²", "torque", "unit")
        return html_table(headings, rows, (f"{self.name}: {self.described}",))


def load_robot(path: str | Path, choice: Choice | None = None, logged: Sequence[str] | None = None) -> Robot:
    """Read an MJCF or a URDF.

    choice: which joints move. logged: the joints of the logs at hand, which move where choice names none. All
    others are held still where the model's keyframe or zero has them, and their mass counts. Where neither
    names any, all move but a gripper's.

    Joint limits come from ``range`` and ``actuatorfrcrange`` (or the ``ctrlrange``/``forcerange``
    of a motor on the joint), rated speeds from a URDF's ``<limit velocity>``. What neither format has a
    field for comes from ``<custom><numeric name="velocity_limit" data="..."/>`` and ``acceleration_limit``,
    rad/s and rad/s², one value a joint. Forces that identification does not know are left out of a corrected
    simulator, with a note; any other model that has some is refused. A model that is not there may be one of
    those shipped. Raises InputError.
    """
    path = shipped(path)
    require_file(path, "model", "an existing MJCF or URDF file")
    source = Source(path, choice or Choice(), None if logged is None else tuple(logged))
    if path.suffix == ".xacro":
        # It has Python in it, and reads any file: for its owner to run, not for us.
        expected = f"a URDF: run xacro first (xacro {path.name} > {path.stem})"
        raise InputError(path, "model", expected, "a .xacro, which is a program")
    require_readable(path)
    packages = {name: str(folder) for name, folder in source.choice.packages.items()}
    asked = source.choice.joints, source.choice.fix_base, packages, source.logged
    contained("testbench.robot:_try", path, "model", EXPECTED, *asked)
    read = read_model(source)
    model = read.model
    try:
        chain, parameters = chain_from_model(model)
        notes = read.notes + _forces_left_out(model)
        limits = model_limits(model, read.rated)
    except InputError as error:
        raise error.located(path) from None
    name = model.names[: model.names.index(b"\0")].decode() or path.stem
    return Robot(name, source, model, chain, parameters, limits, notes)


def print_notes(robot: Robot) -> None:
    """Print a line on each thing of the model's file that was held still, ignored, left out or changed."""
    for note in robot.notes:
        print(f"{robot.path.name}: {note}")


def _forces_left_out(model: mujoco.MjModel) -> tuple[str, ...]:
    """A sentence on the forces of a corrected simulator that nothing here reckons with; none for none.

    Raises InputError for a model of which diagnose has not written them.
    """
    found = unmodelled_forces(model)
    if not found:
        return ()
    got = ", ".join(found[:NAMED_FORCES])
    if len(found) > NAMED_FORCES:
        got += f" and {len(found) - NAMED_FORCES} more"
    if mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_TEXT, EFFECTS_WRITTEN) >= 0:
        return (f"a corrected simulator: its {got} act in MuJoCo and are left out here",)
    expected = "rigid bodies with joint springs, armature, damping, frictionloss and gravity"
    raise InputError("model", "forces", expected, f"{got}; take it out of the model, simulate has --effect")


def _try(
    name: str,
    joints: tuple[str, ...] | None,
    fix_base: bool,
    packages: Mapping[str, str],
    logged: tuple[str, ...] | None,
) -> None:
    """Read a model to see whether that can be done: MuJoCo crashes on some. Raises InputError."""
    folders = {package: Path(folder) for package, folder in packages.items()}
    read = read_model(Source(Path(name), Choice(joints, fix_base, folders), logged))
    require_sound_model(Path(name), read.model)
