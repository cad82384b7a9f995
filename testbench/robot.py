"""A robot as its MJCF (or URDF) tells it: names, limits, chain and ground truth."""

from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

from identification.chain import Chain, chain_from_model
from identification.errors import InputError

from .files import require_file
from .model_reading.limits import VELOCITY, Limits, model_limits, rated_by_numerics
from .model_reading.urdf import urdf_numerics, urdf_root, urdf_speeds
from .unmodelled_forces import unmodelled_forces

Array = NDArray[np.float64]

# Name of the custom text by which a model says which of its forces effects put there.
EFFECTS_WRITTEN = "effects_written"
# Forces that a refusal names.
NAMED_FORCES = 3


@dataclass(frozen=True)
class Robot:
    """A model on disk and what was read from it.

    name: the MJCF's model name. path: the file. model: compiled MuJoCo model.
    chain: kinematics. parameters: (14 n,) standard parameters of the model itself.
    limits: joint limits.
    """

    name: str
    path: Path
    model: mujoco.MjModel
    chain: Chain
    parameters: Array
    limits: Limits

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


def load_robot(path: str | Path) -> Robot:
    """Read an MJCF, or a URDF that MuJoCo reads.

    Joint limits come from ``range`` and ``actuatorfrcrange`` (or the ``ctrlrange``/``forcerange``
    of a motor on the joint), rated speeds from a URDF's ``<limit velocity>``. What neither format has a
    field for comes from ``<custom><numeric name="velocity_limit" data="..."/>`` and ``acceleration_limit``,
    rad/s and rad/s², one value a joint. Raises InputError, also for forces that would be ignored.
    """
    path = Path(path)
    require_file(path, "model", "an existing MJCF or URDF file")
    try:
        _leave_no_log_file()
        model = mujoco.MjModel.from_xml_path(str(path))
    except (ValueError, mujoco.FatalError) as error:
        raise InputError(path, "model", "XML that MuJoCo loads", str(error)) from None
    try:
        chain, parameters = chain_from_model(model)
        _require_known_forces(model)
        limits = model_limits(model, _rated(model, path))
    except InputError as error:
        raise error.located(path) from None
    name = model.names[: model.names.index(b"\0")].decode() or path.stem
    return Robot(name, path, model, chain, parameters, limits)


def _require_known_forces(model: mujoco.MjModel) -> None:
    """Raise InputError for a model with forces that nothing here reckons with."""
    found = unmodelled_forces(model)
    if not found:
        return
    got = ", ".join(found[:NAMED_FORCES])
    if len(found) > NAMED_FORCES:
        got += f" and {len(found) - NAMED_FORCES} more"
    if mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_TEXT, EFFECTS_WRITTEN) >= 0:
        raise InputError("model", "forces", "the model that this corrected simulator was made from", got)
    expected = "rigid bodies with joint springs, armature, damping, frictionloss and gravity"
    raise InputError("model", "forces", expected, f"{got}; take it out of the model, simulate has --effect")


def _leave_no_log_file() -> None:
    """Keep MuJoCo's warnings on stderr alone; it would also write MUJOCO_LOG.TXT where the user stands."""
    config = mujoco.MjLogConfig.get()
    config.logto_file = False
    mujoco.MjLogConfig.set(config)


def _rated(model: mujoco.MjModel, path: Path) -> dict[str, dict[str, float]]:
    """Rated speeds and accelerations by joint: a URDF's own, and those of custom numerics before them."""
    joints = tuple(model.joint(joint).name for joint in range(model.njnt))
    root = urdf_root(path)
    if root is None:
        return rated_by_numerics(_numerics(model), joints)
    speeds = {VELOCITY: urdf_speeds(root)}
    return speeds | rated_by_numerics(urdf_numerics(root), joints)


def _numerics(model: mujoco.MjModel) -> dict[str, Array]:
    starts, sizes = model.numeric_adr, model.numeric_size
    return {
        model.numeric(index).name: np.array(model.numeric_data[starts[index] : starts[index] + sizes[index]])
        for index in range(model.nnumeric)
    }
