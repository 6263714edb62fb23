"""The place at which a force acts on the plant itself, not through the actuator: along an input, or on a body."""

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
        input: the push acts on the joint or tendon that this input moves, in the direction in which its length
            increases: 1 N m about a hinge, 1 N along a slide or a spatial tendon, whatever the actuator's gear, gain
            and dynamics. Or
        body: name of the body on which it acts, with
        force: force [N], along the axes of the world,
        torque: torque [N m], about the axes of the world,
        point: point of action, fixed in the frame of the body [m]; its centre of mass if ``None``.

    Raises:
        SimulationError: on construction, if not exactly one of input and body is given, a vector does not have three
            finite numbers, or neither force nor torque is given for a body.
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
        """Magnitude of the force [N], or of the torque [N m] without a force; 1 if there are both, or an input."""
        sizes = [float(np.linalg.norm(vector)) for vector in (self.force, self.torque) if any(vector)]
        return sizes[0] if len(sizes) == 1 else 1.0

    def unit(self, input_unit: str = "") -> str:
        """Unit of a size times the magnitude, if known; ``input_unit`` is that of the input's command."""
        if self.body is not None:
            return "" if any(self.force) and any(self.torque) else "N" if any(self.force) else "N m"
        return next((unit for unit in ("N m", "N") if f" {input_unit}".endswith(f" {unit}")), "")
