"""A chain as JSON values: what a document that predicts needs of a robot's joints and frames."""

from typing import Any

import numpy as np

from identification.chain import Chain

ARRAYS = ("rotation", "translation", "gravity", "springs")


def chain_document(chain: Chain) -> dict[str, Any]:
    """The chain as lists and names."""
    return {
        "joint_names": list(chain.joint_names),
        "parent": chain.parent.tolist(),
        "is_slide": chain.is_slide.tolist(),
        **{name: getattr(chain, name).tolist() for name in ARRAYS},
    }


def read_chain(document: Any) -> Chain:
    """The inverse of ``chain_document``; a document without parents is of a serial arm.

    Raises KeyError, TypeError or ValueError for anything else.
    """
    joints = len(document["joint_names"])
    chain = Chain(
        joint_names=tuple(document["joint_names"]),
        parent=np.array(document.get("parent", range(-1, joints - 1)), dtype=np.int64),
        is_slide=np.array(document["is_slide"], dtype=bool),
        **{name: np.array(document[name], dtype=np.float64) for name in ARRAYS},
    )
    shapes = ((joints, 3, 3), (joints, 3), (3,), (joints, 4))
    for name, shape in zip(ARRAYS, shapes, strict=True):
        values = getattr(chain, name)
        if values.shape != shape or not np.isfinite(values).all():
            raise ValueError(f"{name} of shape {values.shape} instead of {shape}, or not finite")
    if chain.is_slide.shape != (joints,):
        raise ValueError(f"is_slide of shape {chain.is_slide.shape} instead of {(joints,)}, or not finite")
    return chain
