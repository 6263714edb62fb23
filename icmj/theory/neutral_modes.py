"""Modes that neither events nor control can change: their kind, their states, and the signals that show them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

NeutralKind = Literal["neutral", "unstable", "offset"]


@dataclass(frozen=True)
class NeutralMode:
    """A mode on which the event sequence does not depend, or (``offset``) that it cannot change.

    Attributes:
        kind: ``neutral``: neither hold error nor control sees it, and it neither grows nor decays;
            ``unstable``: nothing sees it, and it grows;
            ``offset``: the loop sees it but cannot change it; the prediction is for its value zero.
        rates: its eigenvalues μ [1/s], for which φ(Δ) has e^{μΔ} at every Δ.
        states: the plant's states that carry it; where none does, those of the observer, as ``observer's NAME``.
        seen_by: names of the outputs that see it.
        words: one sentence for people.
    """

    kind: NeutralKind
    rates: tuple[complex, ...]
    states: tuple[str, ...]
    seen_by: tuple[str, ...]
    words: str


def describe_mode(
    kind: NeutralKind,
    rates: tuple[complex, ...],
    states: tuple[str, ...],
    seen_by: tuple[str, ...] = (),
    *,
    drifts: bool = False,
) -> NeutralMode:
    """The record with its sentence; ``drifts``: whether one state of the mode drives another, as speed does place."""
    what = ", ".join(states) if len(states) <= 4 else f"{len(states)} states ({', '.join(states[:3])}, …)"
    mu = max(rates, key=lambda rate: (rate.real, rate.imag))
    if kind == "unstable":
        words = f"unobservable unstable mode; the state diverges ({what}, as e^({mu.real:.4g} t))"
    elif kind == "offset":
        words = (
            f"constant offset that the loop measures and cannot change ({what}); "
            "the prediction is for the value zero, and any other value shifts the cycle"
        )
        if mu.imag:
            words = words.replace("constant offset", f"oscillation at {mu.imag:.4g} rad/s")
    else:
        motion = "drifting" if drifts else f"oscillating at {mu.imag:.4g} rad/s" if mu.imag else "constant"
        if seen_by:
            words = (
                f"neutral mode that does not act on the controller and shows in {', '.join(seen_by)} ({what}, {motion})"
                f"; statements on the cycle hold up to a drift of {', '.join(seen_by)}"
            )
        else:
            words = f"unobservable neutral mode ({what}, {motion}); statements on the cycle hold up to this mode"
    return NeutralMode(kind, rates, states, seen_by, words)


def name_carriers(weights: np.ndarray, names: tuple[str, ...]) -> tuple[str, ...]:
    """Names of the entries that carry a mode: those of at least a thousandth of the largest weight."""
    if not len(weights) or not weights.max() > 0:
        return ()
    return tuple(name for name, weight in zip(names, weights, strict=True) if weight >= 1e-3 * weights.max())
