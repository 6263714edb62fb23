"""The moving body for display: its geoms and their poses over a run."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from icmj.base.array import Array

FRAME = 0.02  # s between two poses: a screen shows no more


@dataclass(frozen=True, eq=False)
class Geom:
    """One visual geom: body index, MuJoCo's type name, size, pose in its body (quaternion wxyz), colour 0–1."""

    name: str
    body: int
    type: str
    size: Array
    pos: Array
    quat: Array
    rgba: Array


@dataclass(frozen=True, eq=False)
class Scene:
    """The moving body in world coordinates, for the 3D replay.

    Attributes:
        t: times of the poses [s], shape (N,).
        bodies: names, length nb (body 0 is the world).
        geoms: visual geoms.
        xpos, xquat: body positions [m] and orientations (wxyz), shapes (N, nb, 3), (N, nb, 4).
        com: whole-body centre of mass [m], shape (N, 3).
        magnified_xpos, magnified_xquat, magnified_com: the same with the sway magnified.
        magnification: the factor.
        target, magnified_target: the skeleton of the posture that the set-point asks for, as line segments from body to
            body [m], shape (N, M, 2, 3); ``None`` without a set-point.
    """

    t: Array
    bodies: tuple[str, ...]
    geoms: tuple[Geom, ...]
    xpos: Array
    xquat: Array
    com: Array
    magnified_xpos: Array
    magnified_xquat: Array
    magnified_com: Array
    magnification: float
    target: Array | None = None
    magnified_target: Array | None = None


def select_frames(t: Array) -> np.ndarray:
    """Indices of the rows to show as frames, one in every :data:`FRAME` seconds, and the last."""
    picked = np.unique(np.floor(t / FRAME + 1e-6), return_index=True)[1]
    return np.union1d(picked, len(t) - 1)
