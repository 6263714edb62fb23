"""The selection of inputs, outputs and states of a model for the plant."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Selection:
    """The inputs, outputs and states of a plant, by name; ``None`` selects all of the model.

    Attributes:
        inputs: actuators, in this order; the others keep the control of the operating point.
        outputs: sensors, or single entries ``sensor.0`` of one, in this order; the name of a joint selects its position
            and ``<joint>_rate`` its velocity; ``"joints"`` selects the positions of all joints.
        states: states that are kept, in the order of the model.
        drop: states that are left out, if ``states`` is ``None``.
        spare: whether outputs that show a dropped state are left out, too, as with ``"joints"``.
    """

    inputs: tuple[str, ...] | None = None
    outputs: tuple[str, ...] | str | None = None
    states: tuple[str, ...] | None = None
    drop: tuple[str, ...] = ()
    spare: bool = False
