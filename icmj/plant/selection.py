"""Which inputs, outputs and states of a model make the plant."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Selection:
    """Which inputs, outputs and states a plant has, by name; ``None`` means all that the model has.

    Attributes:
        inputs: actuators, in this order; the others hold their control of the operating point.
        outputs: sensors, or single entries ``sensor.0`` of one, in this order; joints stand for their positions and
            ``<joint>_rate`` for their velocities; ``"joints"`` for the positions of all joints.
        states: those kept; in the model's order.
        drop: those left out, where ``states`` is ``None``.
        spare: outputs that show a state left out are left out with it; so it is with ``"joints"``.
    """

    inputs: tuple[str, ...] | None = None
    outputs: tuple[str, ...] | str | None = None
    states: tuple[str, ...] | None = None
    drop: tuple[str, ...] = ()
    spare: bool = False
