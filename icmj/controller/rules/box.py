"""The box rule: an event when any single component of the hold error passes its own threshold.

E = max_j (e_j²/threshold_j²) − 1, with a face for each output or state, so that their units may differ.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from icmj.base.array import Array, NonNegative, Positive, Positives
from icmj.controller.design import Design
from icmj.controller.trigger import EventRule, Faces, check_delta_min
from icmj.errors import AnalysisError


@dataclass(frozen=True, eq=False)
class BoxTrigger(EventRule):
    """The rule of an event when |e_i| > threshold_i for any i, for output errors e = Ĉe_hp or state errors e = e_hp.

    E = max_i (e_i²/threshold_i²) − 1, without a unit. Every component is a face of its own. This rule is therefore
    suitable if outputs have different units or different precision.

    Attributes:
        threshold: one for each output or state [its unit], shape (n_y,) or (n̂,); or one number for all.
        on: ``output`` or ``state``.
        delta_min: shortest open-loop interval Δ_min [s]; no event occurs earlier than this after the previous one.

    Raises:
        AnalysisError: on construction, if a threshold is not positive or Δ_min negative.
    """

    threshold: Array
    on: Literal["output", "state"] = "output"
    delta_min: float = 1e-3

    def __post_init__(self) -> None:
        threshold = np.array(self.threshold, dtype=float)
        if threshold.ndim > 1 or not threshold.size or not (np.isfinite(threshold).all() and (threshold > 0).all()):
            raise AnalysisError(f"box thresholds must be positive, one for each {self.on}; got {threshold.tolist()}")
        if self.on not in ("output", "state"):
            raise AnalysisError(f"a box is on the 'output' or the 'state' errors, not on {self.on!r}")
        check_delta_min(self.delta_min)
        object.__setattr__(self, "threshold", threshold)

    @property
    def size(self) -> float:
        """The largest threshold."""
        return float(self.threshold.max())

    def resized(self, size: float) -> BoxTrigger:
        return replace(self, threshold=self.threshold * (size / self.size))

    def faces(self, design: Design) -> Faces:
        rows = design.plant.C if self.on == "output" else np.eye(design.plant.n)
        if self.threshold.ndim and len(self.threshold) != len(rows):
            raise AnalysisError(f"the box has {len(self.threshold)} thresholds for {len(rows)} {self.on}s")
        R = rows / np.broadcast_to(self.threshold, (len(rows),))[:, None]
        return Faces(R, np.arange(len(R) + 1))

    def facts(self) -> Mapping[str, Any]:
        return {"threshold": self.threshold, "on": self.on, "delta_min": self.delta_min}


def from_keys(
    design: Design,
    on: Literal["output", "state"] = "output",
    threshold: Positive | Positives | None = None,
    delta_min: NonNegative = 1e-3,
) -> BoxTrigger:
    """The rule of a run file.

    Args:
        design: of the controller.
        on: whether the box rule compares outputs or states.
        threshold: threshold of the box rule, required for it: one for all, or a list with one for each [unit of each].
        delta_min: Δ_min [s].
    """
    assert threshold is not None
    return BoxTrigger(np.array(threshold), on, delta_min)


RULE = BoxTrigger
