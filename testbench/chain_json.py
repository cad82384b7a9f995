"""A chain as JSON values: what a document that predicts needs of a robot's joints and frames."""

from typing import Any

import numpy as np

from identification.chain import Chain
from identification.followers import Followers

ARRAYS = ("rotation", "translation", "gravity", "springs")
OF_TREE = ("parent", "is_slide", "rotation", "translation", "leader", "ratio", "offset", "place")


def chain_document(chain: Chain) -> dict[str, Any]:
    """The chain as lists and names."""
    return {
        "joint_names": list(chain.joint_names),
        "parent": chain.parent.tolist(),
        "is_slide": chain.is_slide.tolist(),
        **{name: getattr(chain, name).tolist() for name in ARRAYS},
        **_followers_document(chain.followers),
    }


def _followers_document(full: Followers | None) -> dict[str, Any]:
    """The full tree where joints follow others, else nothing."""
    if full is None:
        return {}
    return {
        "followers": {"names": list(full.names)} | {name: getattr(full, name).tolist() for name in OF_TREE}
    }


def read_chain(document: Any) -> Chain:
    """The inverse of ``chain_document``; without parents a document is of a serial arm, as of no followers.

    Raises KeyError, TypeError or ValueError for anything else.
    """
    joints = len(document["joint_names"])
    chain = Chain(
        joint_names=tuple(document["joint_names"]),
        parent=np.array(document.get("parent", range(-1, joints - 1)), dtype=np.int64),
        is_slide=np.array(document["is_slide"], dtype=bool),
        **{name: np.array(document[name], dtype=np.float64) for name in ARRAYS},
        followers=_read_followers(document.get("followers"), joints),
    )
    shapes = ((joints, 3, 3), (joints, 3), (3,), (joints, 4))
    for name, shape in zip(ARRAYS, shapes, strict=True):
        values = getattr(chain, name)
        if values.shape != shape or not np.isfinite(values).all():
            raise ValueError(f"{name} of shape {values.shape} instead of {shape}, or not finite")
    if chain.is_slide.shape != (joints,):
        raise ValueError(f"is_slide of shape {chain.is_slide.shape} instead of {(joints,)}, or not finite")
    return chain


def _read_followers(document: Any, joints: int) -> Followers | None:
    """The inverse of ``_followers_document``. Raises KeyError, TypeError or ValueError for anything else."""
    if document is None:
        return None
    kinds = {"parent": np.int64, "leader": np.int64, "place": np.int64, "is_slide": bool}
    read = {name: np.array(document[name], dtype=kinds.get(name, np.float64)) for name in OF_TREE}
    links = joints + len(document["names"])
    for name, values in read.items():
        shape = (links, *{"rotation": (3, 3), "translation": (3,)}.get(name, ()))
        if values.shape != shape or not np.isfinite(values).all():
            raise ValueError(f"followers {name} of shape {values.shape} instead of {shape}, or not finite")
    if sorted(read["place"]) != list(range(links)) or not np.isin(read["leader"], range(joints)).all():
        raise ValueError("followers place and leader: of every link")
    if np.any(read["parent"] < -1) or np.any(read["parent"] >= np.arange(links)):
        raise ValueError("followers parent: every link after its parent")
    return Followers(names=tuple(document["names"]), **read)
