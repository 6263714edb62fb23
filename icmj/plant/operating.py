"""The rule that gives an operating point from the pose and the control of a keyframe."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

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
