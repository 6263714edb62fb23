"""How an operating point is found from the pose and the control that a keyframe gives."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

OperatingKind = Literal["as given", "static control", "balance", "found"]


@dataclass(frozen=True)
class OperatingRule:
    """What of a keyframe stands, and what follows from rest.

    Attributes:
        kind: ``as given``: pose, velocity, activation and control are the keyframe's. ``static control``: the pose is,
            and controls and activations are those that hold it. ``balance``: the joints in ``free`` move, too.
            ``found``: as given where that is at rest, else balance.
        free: joints that may move, by name; all where there is none.
        pose: positions of hinge and slide joints, instead of the keyframe's [rad, m].

    Where there is a choice, what the actuators give departs least from what the keyframe's controls do; where it has
    none, that is the least effort.
    """

    kind: OperatingKind = "as given"
    free: tuple[str, ...] = ()
    pose: Mapping[str, float] = field(default_factory=dict)
