"""What of a model becomes the plant: its inputs, outputs and states, and the rule for its operating point."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal


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


OperatingKind = Literal["as given", "static control", "balance", "found"]


@dataclass(frozen=True)
class OperatingRule:
    """The rule that completes the operating point: which values a keyframe gives, and which follow from rest.

    Attributes:
        kind: ``as given``: pose, velocity, activation and control are those of the keyframe. ``static control``: the
            pose is that of the keyframe, and controls and activations are those that hold it. ``balance``: the joints
            in ``free`` may move, too. ``found``: as given if the plant is at rest there, otherwise balance.
        free: names of the joints that may move; all if empty.
        pose: positions of hinge and slide joints, instead of those of the keyframe [rad, m].

    If the solution is not unique, the forces of the actuators differ as little as possible from those of the keyframe's
    controls or, without such controls, from zero.
    """

    kind: OperatingKind = "as given"
    free: tuple[str, ...] = ()
    pose: Mapping[str, float] = field(default_factory=dict)
