"""The robot as shapes that Rerun draws: its MJCF's geoms once, and where its bodies are over time."""

from collections.abc import Iterator
from typing import Any

import mujoco
import numpy as np
import rerun as rr
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Geoms of higher groups are collision shapes by MuJoCo's convention; its viewer hides them.
VISUAL_GROUPS = 3
DEFAULT_COLOUR = (0.5, 0.5, 0.5, 1.0)
GHOST = (90, 150, 255, 40)
# The ghost is a little larger than the arm, or the two would flicker where they coincide.
GHOST_MARGIN = 0.006
FLOOR_COLOUR = (58, 62, 70)


def log_robot(recording: rr.RecordingStream, root: str, model: Any, ghost: bool = False) -> None:
    """The shapes of every body under ``root``/<body>, in the body's frame; a ghost is translucent.

    A model without visual geoms is drawn as capsules between its bodies' origins.
    """
    has_geoms = any(True for body in range(1, model.nbody) for _ in _geoms(model, body))
    for body in range(0 if not ghost else 1, model.nbody):
        shapes = _geom_shapes(model, body, ghost) if has_geoms or body == 0 else _stick(model, body, ghost)
        for name, shape in shapes:
            recording.log(f"{body_path(root, model, body)}/{name}", shape, static=True)


def log_floor(recording: rr.RecordingStream, path: str, model: Any) -> None:
    """A square floor at the height of the model's first plane, or at zero."""
    planes = np.flatnonzero(np.asarray(model.geom_type) == mujoco.mjtGeom.mjGEOM_PLANE)
    height = float(model.geom_pos[planes[0], 2]) if len(planes) else 0.0
    half, thickness = reach(model), 0.002 * reach(model)
    floor = rr.Boxes3D(
        half_sizes=[[half, half, thickness]],
        centers=[[0.0, 0.0, height - thickness]],
        colors=[FLOOR_COLOUR],
        fill_mode="solid",
    )
    recording.log(path, floor, static=True)


def log_motion(
    recording: rr.RecordingStream, root: str, model: Any, time: Any, position: Array, orientation: Array
) -> None:
    """Poses of the bodies over a time column: position (K, bodies, 3), orientation (K, bodies, 4) wxyz."""
    for body in range(1, model.nbody):
        columns = rr.Transform3D.columns(
            translation=position[:, body], quaternion=orientation[:, body][:, [1, 2, 3, 0]]
        )
        recording.send_columns(body_path(root, model, body), [time], columns)


def body_poses(model: Any, q: Array) -> tuple[Array, Array, Array]:
    """Positions (K, bodies, 3) m and orientations (K, bodies, 4) wxyz of the bodies, tool points (K, 3).

    The tool point is the model's last site, or the origin of its last body where it has none.
    """
    data = mujoco.MjData(model)
    position, orientation = np.empty((len(q), model.nbody, 3)), np.empty((len(q), model.nbody, 4))
    tool = np.empty((len(q), 3))
    for index, sample in enumerate(q):
        data.qpos[:] = sample
        mujoco.mj_kinematics(model, data)
        position[index], orientation[index] = data.xpos, data.xquat
        tool[index] = data.site_xpos[-1] if model.nsite else data.xpos[-1]
    return position, orientation, tool


def reach(model: Any) -> float:
    """Length of the longest stretched branch, m: the distances between its bodies, and to the last site."""
    length = np.zeros(model.nbody)
    for body in range(1, model.nbody):
        length[body] = length[model.body_parentid[body]] + np.linalg.norm(model.body_pos[body])
    if model.nsite:
        length[model.site_bodyid[-1]] += np.linalg.norm(model.site_pos[-1])
    return max(float(length.max()), 0.1)


def body_path(root: str, model: Any, body: int) -> str:
    """Entity path of a body under ``root``."""
    name = model.body(body).name or f"body_{body}"
    return f"{root}/{rr.escape_entity_path_part(name)}"


def _geoms(model: Any, body: int) -> Iterator[int]:
    """The body's geoms that are meant to be seen; floors are drawn apart."""
    start = int(model.body_geomadr[body])
    unseen = (mujoco.mjtGeom.mjGEOM_PLANE, mujoco.mjtGeom.mjGEOM_HFIELD)
    for geom in range(start, start + int(model.body_geomnum[body])):
        if model.geom_group[geom] < VISUAL_GROUPS and model.geom_type[geom] not in unseen:
            yield geom


def _geom_shapes(model: Any, body: int, ghost: bool) -> Iterator[tuple[str, Any]]:
    """Name and archetype of each visible geom of a body, in the body's frame."""
    for geom in _geoms(model, body):
        pose = {"quaternions": [model.geom_quat[geom][[1, 2, 3, 0]]]}
        look = {"colors": [_colour(model, geom, ghost)], "fill_mode": "solid"}
        centre = model.geom_pos[geom]
        size = model.geom_size[geom] + (GHOST_MARGIN * reach(model) if ghost else 0.0)
        name = model.geom(geom).name or f"geom_{geom}"
        shape: Any
        match int(model.geom_type[geom]):
            case mujoco.mjtGeom.mjGEOM_BOX:
                shape = rr.Boxes3D(half_sizes=[size], centers=[centre], **pose, **look)
            case mujoco.mjtGeom.mjGEOM_SPHERE:
                shape = rr.Ellipsoids3D(half_sizes=[[size[0]] * 3], centers=[centre], **look)
            case mujoco.mjtGeom.mjGEOM_ELLIPSOID:
                shape = rr.Ellipsoids3D(half_sizes=[size], centers=[centre], **pose, **look)
            case mujoco.mjtGeom.mjGEOM_CYLINDER:
                shape = rr.Cylinders3D(
                    lengths=[2 * size[1]], radii=[size[0]], centers=[centre], **pose, **look
                )
            case mujoco.mjtGeom.mjGEOM_CAPSULE:
                # Rerun's capsule starts at its origin, MuJoCo's is centred on it.
                start = centre - _rotate(model.geom_quat[geom], np.array([[0.0, 0.0, size[1]]]))[0]
                shape = rr.Capsules3D(
                    lengths=[2 * size[1]], radii=[size[0]], translations=[start], **pose, **look
                )
            case mujoco.mjtGeom.mjGEOM_MESH:
                shape = _mesh(model, geom, ghost)
            case _:
                continue
        yield rr.escape_entity_path_part(name), shape


def _mesh(model: Any, geom: int, ghost: bool) -> rr.Mesh3D:
    """A mesh geom in its body's frame, corners repeated so that each face keeps its own normals."""
    mesh = int(model.geom_dataid[geom])
    faces = slice(model.mesh_faceadr[mesh], model.mesh_faceadr[mesh] + model.mesh_facenum[mesh])
    corners = model.mesh_vertadr[mesh] + model.mesh_face[faces].ravel()
    normals = model.mesh_normaladr[mesh] + model.mesh_facenormal[faces].ravel()
    quaternion = model.geom_quat[geom]
    return rr.Mesh3D(
        vertex_positions=model.geom_pos[geom] + _rotate(quaternion, model.mesh_vert[corners]),
        vertex_normals=_rotate(quaternion, model.mesh_normal[normals]),
        albedo_factor=_colour(model, geom, ghost),
    )


def _stick(model: Any, body: int, ghost: bool) -> Iterator[tuple[str, Any]]:
    """Capsules from a body's origin to those of its children, and to the tool from the last one."""
    ends = [model.body_pos[child] for child in range(1, model.nbody) if model.body_parentid[child] == body]
    if not ends and model.nsite and model.site_bodyid[-1] == body:
        ends = [model.site_pos[-1]]
    colour = GHOST if ghost else (150, 155, 165, 255)
    radius = 0.04 * reach(model)
    yield "joint", rr.Ellipsoids3D(half_sizes=[[1.3 * radius] * 3], colors=[colour], fill_mode="solid")
    for index, end in enumerate(ends):
        length = float(np.linalg.norm(end))
        if length == 0:
            continue
        quaternion = np.empty(4)
        mujoco.mju_quatZ2Vec(quaternion, np.asarray(end, dtype=np.float64))
        yield (
            f"link_{index}",
            rr.Capsules3D(
                lengths=[length],
                radii=[radius],
                translations=[[0.0, 0.0, 0.0]],
                quaternions=[quaternion[[1, 2, 3, 0]]],
                colors=[colour],
                fill_mode="solid",
            ),
        )


def _colour(model: Any, geom: int, ghost: bool) -> tuple[int, ...]:
    """RGBA of 0 to 255; the material's where the geom itself has none."""
    if ghost:
        return GHOST
    rgba = model.geom_rgba[geom]
    material = int(model.geom_matid[geom])
    if material >= 0 and np.allclose(rgba, DEFAULT_COLOUR):
        rgba = model.mat_rgba[material]
    return tuple(round(255 * float(value)) for value in rgba)


def _rotate(quaternion: Array, vectors: Array) -> Array:
    """Vectors (K, 3) turned by a quaternion wxyz."""
    matrix = np.empty(9)
    mujoco.mju_quat2Mat(matrix, np.asarray(quaternion, dtype=np.float64))
    return np.asarray(vectors, dtype=np.float64) @ matrix.reshape(3, 3).T
