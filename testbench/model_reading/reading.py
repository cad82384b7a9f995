"""A model's file, read to the robot in it: an MjSpec with the robot's joints alone."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from identification.errors import InputError
from identification.followers import followed
from identification.joint_names import joint_label

from .assets import compiled_mjcf
from .limits import VELOCITY, rated_at_leaders, rated_by_numerics, write_numerics
from .locking import lock
from .selection import WEIGHTLESS, select
from .urdf import Urdf, compiled_urdf, read_urdf, xml_root

Array = NDArray[np.float64]

EXPECTED = "XML that MuJoCo loads"


@dataclass(frozen=True)
class Choice:
    """What of a model's file is the robot, as the user says.

    joints: names of the joints that move, None for those of the logs, or those that ``select`` finds.
    fix_base: hold a floating base. packages: folders of ROS packages by name.
    """

    joints: tuple[str, ...] | None = None
    fix_base: bool = False
    packages: Mapping[str, Path] = field(default_factory=dict)


@dataclass(frozen=True)
class Source:
    """A model's file, what the user chose of it, and the joints that a log has, None where there is none.

    Logged joints move where the model has them all; else it is the log's reader that complains.
    """

    path: Path
    choice: Choice = Choice()
    logged: tuple[str, ...] | None = None


@dataclass(frozen=True)
class Reading:
    """What a file was read to.

    spec: MjSpec of the robot. model: it compiled. rated: speeds and accelerations as ``model_limits`` takes
    them. notes: sentences on what was held still, ignored, left out or changed.
    """

    spec: Any
    model: Any
    rated: dict[str, dict[str, float]]
    notes: tuple[str, ...]


def read_model(source: Source) -> Reading:
    """The robot in a file. Raises InputError for what MuJoCo cannot load and what is no robot."""
    path = source.path
    try:
        spec, whole, urdf, notes = _whole(source)
    except (ValueError, mujoco.FatalError) as error:
        raise InputError(path, "model", EXPECTED, str(error)) from None
    names = tuple(joint_label(whole, joint) for joint in range(whole.njnt))
    try:
        asked = source.choice.joints
        if asked is None and set(source.logged or ()) <= set(names):
            asked = source.logged
        leaders = frozenset() if urdf is None else urdf.leaders
        selection = select(whole, asked, source.choice.fix_base, leaders)
        notes += lock(spec, whole, selection)
        kept = tuple(names[joint] for joint in selection.kept)
        found = followed(whole)
        led = {names[each]: (names[found[each].leader], found[each].ratio) for each in selection.following}
        rated = rated_at_leaders(_rated(whole, urdf, names, kept), led)
        write_numerics(spec, rated, kept)
    except InputError as error:
        raise error.located(path) from None
    try:
        model = spec.compile()
    except (ValueError, mujoco.FatalError) as error:
        raise InputError(path, "model", "a robot whose other joints can be held still", str(error)) from None
    try:
        _require_masses(model)
    except InputError as error:
        raise error.located(path) from None
    return Reading(spec, model, rated, notes)


def _whole(source: Source) -> tuple[Any, Any, Urdf | None, tuple[str, ...]]:
    """The whole file: MjSpec, MjModel, what a URDF has beside, and sentences."""
    root = xml_root(source.path)
    if root is None or root.tag != "robot":
        spec, model, notes = compiled_mjcf(source.path)
        return spec, model, None, notes
    try:
        urdf = read_urdf(root, source.path, source.choice.packages)
    except InputError as error:
        raise error.located(source.path) from None
    spec, model, notes = compiled_urdf(urdf)
    return spec, model, urdf, urdf.notes + notes


def _require_masses(model: Any) -> None:
    """Raise InputError for a joint that moves nothing that has a mass."""
    for joint in range(model.njnt):
        body = int(model.jnt_bodyid[joint])
        if model.body_subtreemass[body] < WEIGHTLESS and model.body_mass[body] > 0:
            expected = (
                f"mass and inertia, as nothing that {joint_label(model, joint)} moves has any; "
                "--joints with the others alone holds it"
            )
            raise InputError("model", f"inertial of {model.body(body).name}", expected, "none")


def _rated(
    model: Any, urdf: Urdf | None, names: tuple[str, ...], kept: tuple[str, ...]
) -> dict[str, dict[str, float]]:
    """Rated speeds and accelerations by joint: a URDF's own, and those of custom numerics before them.

    names: all joints; kept: the robot's. Numerics have a value for each of either.
    """
    numerics = _numerics(model) if urdf is None else urdf.numerics
    of_all = {name: values for name, values in numerics.items() if len(values) == len(names)}
    of_kept = {name: values for name, values in numerics.items() if name not in of_all}
    rated = {} if urdf is None else {VELOCITY: urdf.speeds}
    return rated | rated_by_numerics(of_all, names) | rated_by_numerics(of_kept, kept)


def _numerics(model: Any) -> dict[str, Array]:
    starts, sizes = model.numeric_adr, model.numeric_size
    return {
        model.numeric(index).name: np.array(model.numeric_data[starts[index] : starts[index] + sizes[index]])
        for index in range(model.nnumeric)
    }
