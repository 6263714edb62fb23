"""What another threshold changes in a prediction: sizes, in proportion; no time, no eigenvalue, no verdict."""

from __future__ import annotations

from dataclasses import replace

from icmj.theory.orbit import Orbit
from icmj.theory.prediction import Prediction

_SIZES = ("gamma", "x_bar", "X", "y", "u", "e_hp", "y_peak", "u_peak", "x_peak", "y_range", "u_range", "x_range")


def scaled(prediction: Prediction, factor: float) -> Prediction:
    """The prediction for a threshold that is ``factor`` times as large; the loop is linear (eq. gamma)."""
    return replace(
        prediction,
        gamma=None if prediction.gamma is None else prediction.gamma * factor,
        amplitude=None if prediction.amplitude is None else prediction.amplitude * factor,
        orbit=None if prediction.orbit is None else _scaled(prediction.orbit, factor),
    )


def _scaled(orbit: Orbit, factor: float) -> Orbit:
    sizes = {name: getattr(orbit, name) * factor for name in _SIZES}
    drift = None if orbit.drift is None else orbit.drift * factor
    return replace(orbit, E=orbit.E * factor**2, drift=drift, **sizes)
