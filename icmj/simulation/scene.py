"""The moving body for the eye: its geoms and where they are at every row of a run."""

from __future__ import annotations

from dataclasses import dataclass

from icmj.base.array import Array


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
        bodies: names, length nb (body 0 is the world).
        geoms: visual geoms.
        xpos, xquat: body positions [m] and orientations (wxyz), shapes (N, nb, 3), (N, nb, 4).
        com: whole-body centre of mass [m], shape (N, 3).
        magnified_xpos, magnified_xquat, magnified_com: the same with the sway magnified.
        magnification: the factor.
    """

    bodies: tuple[str, ...]
    geoms: tuple[Geom, ...]
    xpos: Array
    xquat: Array
    com: Array
    magnified_xpos: Array
    magnified_xquat: Array
    magnified_com: Array
    magnification: float
