"""Triggers, which determine when the controller takes new feedback.

Each rule is a module here: a frozen dataclass that inherits from :class:`EventRule` and defines its faces.
"""

from icmj.controller.trigger.box import BoxTrigger
from icmj.controller.trigger.quadratic import EventTrigger, as_weight, output_weight
from icmj.controller.trigger.recorded import RecordedRule, recorded
from icmj.controller.trigger.trigger import ClockTrigger, Continuous, EventRule, Faces, Trigger, expect_rule

TRIGGERS: tuple[type[Trigger], ...] = (EventTrigger, BoxTrigger, ClockTrigger, Continuous, RecordedRule)
"""Every kind of trigger, as logs and command line know them."""

__all__ = [
    "TRIGGERS",
    "BoxTrigger",
    "ClockTrigger",
    "Continuous",
    "EventRule",
    "EventTrigger",
    "Faces",
    "RecordedRule",
    "Trigger",
    "as_weight",
    "expect_rule",
    "output_weight",
    "recorded",
]
