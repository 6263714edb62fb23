"""An event rule from user code as a log stores it: its numbers and its origin."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, is_dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from icmj.base.array import Array
from icmj.controller.trigger.trigger import EventRule, Faces, Trigger
from icmj.work.own_code import Fact, digest_of, plain, reference_of

if TYPE_CHECKING:
    from icmj.controller.design import Design


@dataclass(frozen=True, eq=False)
class RecordedRule(EventRule):
    """The faces of a rule, without its code.

    Attributes:
        R, cuts, unit: its faces for the design that it had; see :class:`icmj.controller.trigger.trigger.Faces`.
        threshold: its size.
        delta_min: shortest open-loop interval Δ_min [s].
        reference: ``module:name`` of its class.
        sha256: digest of the source file; "" if there was none.
        parameters: parameters of the rule, by name: the fields of its dataclass.
        told: the settings that the rule reported, by their usual names.
    """

    R: Array
    cuts: Array
    unit: float
    threshold: float
    delta_min: float = 0.0
    reference: str = ""
    sha256: str = ""
    parameters: Mapping[str, Fact] = field(default_factory=dict)
    told: Mapping[str, Fact] = field(default_factory=dict)

    @property
    def size(self) -> float:
        return self.threshold

    def resized(self, size: float) -> RecordedRule:
        ratio = size / self.threshold
        # the unit of E is 1, or that of the threshold squared
        return replace(self, R=self.R / ratio, unit=self.unit * (1.0 if self.unit == 1 else ratio**2), threshold=size)

    def faces(self, design: Design) -> Faces:
        return Faces(self.R, self.cuts.astype(int), self.unit)

    def facts(self) -> Mapping[str, Any]:
        return {"rule": self.reference, **self.told, "delta_min": self.delta_min}


def recorded(rule: Trigger, design: Design) -> Trigger:
    """A trigger as a log keeps it: itself, but for a rule that is not of icmj."""
    if not isinstance(rule, EventRule) or type(rule).__module__.startswith(f"{__package__}."):
        return rule
    faces = rule.faces(design)
    parameters: dict[str, Any] = {f.name: getattr(rule, f.name) for f in fields(rule)} if is_dataclass(rule) else {}
    return RecordedRule(
        faces.R,
        np.asarray(faces.cuts),
        float(faces.unit),
        float(rule.size),
        float(rule.delta_min),
        reference_of(rule),
        digest_of(rule),
        {name: plain(value) for name, value in parameters.items()},
        {name: plain(value) for name, value in rule.facts().items() if name != "delta_min"},
    )
