"""The facts of a prediction; see :class:`icmj.theory.prediction.Prediction` for what they mean in full."""

from __future__ import annotations

from operator import attrgetter

import numpy as np

from icmj.base.fact import Fact

PREDICTION = (
    Fact("delta_crit", "critical interval Δ_crit", "s", "critical open-loop interval", attrgetter("delta_crit")),
    Fact("eigenvalue", "eigenvalue there", "",
         "eigenvalue on the unit circle at Δ_crit, +1 or −1; empty if there is none", attrgetter("eigenvalue"),
         "eigenvalue"),
    Fact("cycle", "cycle predicted", "", "whether a limit cycle is predicted", attrgetter("cycle"), "truth"),
    Fact("period", "period", "s", "period of the predicted cycle", attrgetter("period")),
    Fact("verdict", "verdict on the orbit", "",
         "on the predicted orbit: attracting, repelling, not admissible or none", attrgetter("verdict"), "text"),
    Fact("multiplier", "largest multiplier of the event-driven orbit", "",
         "magnitude of the largest multiplier of the predicted orbit under the event rule",
         lambda of: None if of.multipliers is None else np.abs(of.multipliers).max(initial=0.0), figures=4, record="",
         logged=""),
    Fact("gamma", "γ", "", "size of the critical mode at the events of the predicted orbit", attrgetter("gamma")),
    Fact("state_feedback_stable", "continuous state feedback on the actual plant", "",
         "whether continuous state feedback is stable on the actual plant", attrgetter("state_feedback_stable"),
         "truth", answers=("stable", "unstable"), record=""),
    Fact("observer_feedback_stable", "continuous observer feedback on the actual plant", "",
         "whether continuous observer feedback is stable on the actual plant", attrgetter("observer_feedback_stable"),
         "truth", answers=("stable", "unstable"), record=""),
    Fact("amplitude", "peak of each output", "", "largest magnitude of each output over a period",
         attrgetter("amplitude"),
         "outputs", figures=4, column="peak"),
)  # fmt: skip
"""In the order of a sweep's columns."""
