"""Joints that follow one sine, along which laws of the position and inertia are collinear."""

import numpy as np

from identification.single_sine import sine_frequency

from .run import Prepared


def one_sine(prepared: Prepared) -> frozenset[int]:
    """The joints that move in these runs by one sine in each of them."""
    moved = prepared.moved
    return frozenset(
        joint
        for joint in np.flatnonzero(moved.any(axis=0)).tolist()
        if all(
            sine_frequency(run.time, run.q[:, joint]) is not None
            for run, own in zip(prepared.runs, moved, strict=True)
            if own[joint]
        )
    )
