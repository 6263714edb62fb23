"""The place at which a force acts on the plant itself, not through the actuator.

It acts along an input, on a body, or on all bodies, as their support surface moves: seen from a surface that moves,
gravity turns, and every mass has the force of its inertia.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from icmj.errors import SimulationError

Vector = tuple[float, float, float]
ZERO: Vector = (0.0, 0.0, 0.0)
Surface = Literal["translation", "gravity", "turning"]


def vector(values: Sequence[float] | np.ndarray) -> Vector:
    """Three numbers."""
    x, y, z = (float(value) for value in values)
    return x, y, z


@dataclass(frozen=True)
class Push:
    """A generalised force of size 1.

    Attributes:
        input: the push acts on the joint or tendon that this input moves, in the direction in which its length
            increases: 1 N m about a hinge, 1 N along a slide or a spatial tendon, whatever the actuator's gear, gain
            and dynamics. Give one of ``input``, ``body`` and ``surface``.
        body: name of the body on which it acts.
        force: force on the body [N], along the axes of the world.
        torque: torque on the body [N m], about the axes of the world.
        point: point of action, fixed in the frame of the body [m]; its centre of mass if ``None``.
        surface: motion of the support surface, to first order; all coordinates are relative to the surface.
            ``translation``: an acceleration of 1 m/s² along ``axis``; ``gravity``: a tilt of 1 rad about ``axis``,
            which changes the direction of gravity; ``turning``: an angular acceleration of 1 rad/s² about the line
            along ``axis`` through ``point`` (the origin of the world if ``None``).
        axis: direction of a translation, or axis of a rotation by the right-hand rule; of length 1.

    Raises:
        SimulationError: on construction, if not exactly one of input, body and surface is given, a vector does not have
            three finite numbers, or neither force nor torque is given for a body.
    """

    input: str | None = None
    body: str | None = None
    force: Vector = ZERO
    torque: Vector = ZERO
    point: Vector | None = None
    surface: Surface | None = None
    axis: Vector = ZERO

    def __post_init__(self) -> None:
        if (self.input, self.body, self.surface).count(None) != 2:
            raise SimulationError("a push acts on an input, on a body or by the surface; give one of them")
        for name in ("force", "torque", "point", "axis"):
            given: Sequence[float] | None = getattr(self, name)
            if given is None:
                continue
            vector = tuple(float(part) for part in given)
            if len(vector) != 3 or not np.isfinite(vector).all():
                raise SimulationError(f"push on {self.where!r}: {name} {list(vector)}: expected three finite numbers")
            object.__setattr__(self, name, vector)
        acts = any(self.force) or any(self.torque)
        if self.surface is not None:
            if self.surface not in get_args(Surface) or acts:
                raise SimulationError(
                    f"surface {self.surface!r}: expected translation, gravity or turning, without force"
                )
            length = float(np.linalg.norm(self.axis))
            if length == 0:
                raise SimulationError(f"surface {self.surface!r}: its axis has no direction")
            object.__setattr__(self, "axis", tuple(part / length for part in self.axis))
            return
        if self.input is not None and (acts or self.point is not None):
            raise SimulationError(
                f"push on input {self.input!r}: force, torque and point are those of a push on a body"
            )
        if self.body is not None and not acts:
            raise SimulationError(f"push on body {self.body!r}: give it a force [N], a torque [N m], or both")

    @property
    def where(self) -> str:
        """The name of what is pushed."""
        if self.surface is not None:
            return f"surface {'tilt' if self.surface == 'gravity' else self.surface}"
        return self.input if self.input is not None else str(self.body)

    @property
    def magnitude(self) -> float:
        """Magnitude of the force [N] or, without a force, of the torque [N m]; 1 if both are given, or an input."""
        sizes = [float(np.linalg.norm(vector)) for vector in (self.force, self.torque) if any(vector)]
        return sizes[0] if len(sizes) == 1 else 1.0

    def unit(self, input_unit: str = "") -> str:
        """Unit of a size times the magnitude, if known; ``input_unit`` is that of the input's command."""
        if self.surface is not None:
            return {"translation": "m/s²", "gravity": "rad", "turning": "rad/s²"}[self.surface]
        if self.body is not None:
            return "" if any(self.force) and any(self.torque) else "N" if any(self.force) else "N m"
        return next((unit for unit in ("N m", "N") if f" {input_unit}".endswith(f" {unit}")), "")
