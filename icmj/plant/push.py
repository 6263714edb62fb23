"""Where a force acts on the plant itself, past command, input gain and actuator: along an input, or on a body."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from icmj.errors import SimulationError

Vector = tuple[float, float, float]
ZERO: Vector = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Push:
    """A generalised force of size 1.

    Attributes:
        input: along what this input moves, where its length grows: 1 N m about a hinge, 1 N along a slide or a spatial
            tendon, whatever the actuator's gear, gain and dynamics are. Or
        body: on the body of this name:
        force: [N], along the axes of the world.
        torque: [N m], about the axes of the world.
        point: where the force acts, fixed in the body's frame [m]; the body's centre of mass if ``None``.

    Raises:
        SimulationError: on construction, if there is not exactly one of input and body, a vector is not one of three
            finite numbers, or a body is pushed by nothing.
    """

    input: str | None = None
    body: str | None = None
    force: Vector = ZERO
    torque: Vector = ZERO
    point: Vector | None = None

    def __post_init__(self) -> None:
        if (self.input is None) == (self.body is None):
            raise SimulationError("a push acts on an input or on a body; give one of the two")
        for name in ("force", "torque", "point"):
            given: Sequence[float] | None = getattr(self, name)
            if given is None:
                continue
            vector = tuple(float(part) for part in given)
            if len(vector) != 3 or not np.isfinite(vector).all():
                raise SimulationError(f"push on {self.where!r}: {name} {list(vector)}: expected three finite numbers")
            object.__setattr__(self, name, vector)
        acts = any(self.force) or any(self.torque)
        if self.input is not None and (acts or self.point is not None):
            raise SimulationError(
                f"push on input {self.input!r}: force, torque and point are those of a push on a body"
            )
        if self.body is not None and not acts:
            raise SimulationError(f"push on body {self.body!r}: give it a force [N], a torque [N m], or both")

    @property
    def where(self) -> str:
        """The name of what is pushed."""
        return self.input if self.input is not None else str(self.body)

    @property
    def magnitude(self) -> float:
        """Of the force [N], or of the torque [N m] where there is no force; 1 where there are both, or an input."""
        sizes = [float(np.linalg.norm(vector)) for vector in (self.force, self.torque) if any(vector)]
        return sizes[0] if len(sizes) == 1 else 1.0

    def unit(self, input_unit: str = "") -> str:
        """Of a size times the magnitude, where it is known; ``input_unit`` is that of the input's command."""
        if self.body is not None:
            return "" if any(self.force) and any(self.torque) else "N" if any(self.force) else "N m"
        return next((unit for unit in ("N m", "N") if f" {input_unit}".endswith(f" {unit}")), "")
