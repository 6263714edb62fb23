"""Feedback of delayed outputs that is switched on and off in their plane: no observer, no hold, two modes.

With readings delayed by t_d, a position θ_Δ and a rate θ'_Δ,

    u = −(P θ_Δ + D θ'_Δ)     where θ_Δ (θ'_Δ − a θ_Δ) > 0 and θ_Δ² + θ'_Δ² > r²
    u = 0                     elsewhere

(Asai et al. 2009, after Bottaro et al. 2008). While feedback is off, the plant moves along its own stable manifold
towards the upright. With ``switches`` false, feedback is always on, which is the continuous delayed controller.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from icmj.base.array import Array, Finite, NonNegative
from icmj.controller.law import Law, expect_positive, find_output
from icmj.controller.layout import Layout
from icmj.controller.realisation import Guard, Mode, Realisation
from icmj.errors import AnalysisError
from icmj.plant.linear_plant import LinearPlant, expect_linear

ON, OFF = 0, 1


def compute_slope(share: float) -> float:
    """Slope a [1/s] of the switching line for which feedback is on in a share ρ of the plane: a = −tan(π(ρ − ½)).

    Args:
        share: between 0 and 1; at 1 it is on throughout, which no slope says.

    Raises:
        AnalysisError: if it is not between them.
    """
    if not 0 < share < 1:
        raise AnalysisError(f"the share of the plane in which feedback is on must be between 0 and 1, got {share}")
    return float(-np.tan(np.pi * (share - 0.5)))


def make_guards(position: Array, rate: Array, slope: float, dead_zone: float) -> tuple[Guard, Guard]:
    """θ (θ' − aθ) and θ² + θ'² − r², of position and rate as rows over the outputs; on where both are positive."""
    across, square = np.outer(position, rate), np.outer(position, position)
    return Guard((across + across.T) / 2 - slope * square), Guard(square + np.outer(rate, rate), -(dead_zone**2))


@dataclass(frozen=True, eq=False)
class SwitchingPD(Law):
    """Delayed proportional and derivative feedback, switched by regions in the plane of the delayed outputs.

    Attributes:
        assumed: the plant, whose inputs and outputs are used by name.
        position: output θ that is fed back.
        rate: output θ' that is fed back.
        P: gain of the position: one number for all inputs, or one for each input, shape (n_u,) [input per output].
        D: gain of the rate: one number for all inputs, or one for each input, shape (n_u,) [input per output].
        delay: t_d [s].
        slope: slope a of the line θ' = aθ that, together with θ = 0, bounds the region where feedback is off [1/s]. If
            it is negative, feedback is off in the second and fourth quadrants except for a wedge.
        dead_zone: size r of (θ, θ') within which feedback is off.
        switches: whether feedback is switched; if not, this is the continuous delayed controller.

    Raises:
        AnalysisError: on construction, if an output does not exist, a number is not finite, the delay is not positive,
            or the dead zone is negative.
    """

    assumed: LinearPlant
    position: str
    rate: str
    P: ArrayLike
    D: ArrayLike
    delay: float
    slope: Finite = 0.0
    dead_zone: NonNegative = 0.0
    switches: bool = True

    def __post_init__(self) -> None:
        expect_linear(self.assumed, "the assumed plant")
        n_u, outputs = self.assumed.n_u, self.assumed.outputs
        for what, name in (("position", self.position), ("rate", self.rate)):
            find_output(outputs, name, what)
        if self.position == self.rate:
            raise AnalysisError(f"position and rate are the same output, {self.rate!r}; name two")
        for letter in ("P", "D"):
            gain = np.asarray(getattr(self, letter), dtype=float)
            if gain.ndim > 1 or (gain.ndim == 1 and len(gain) != n_u) or not np.isfinite(gain).all():
                raise AnalysisError(f"{letter} must be a finite number, or one for each of the {n_u} inputs")
            object.__setattr__(self, letter, np.broadcast_to(gain, (n_u,)).copy())
        expect_positive(self.delay, "delay of the switching controller")
        if not np.isfinite(self.slope):
            raise AnalysisError(f"the slope of the switching line must be finite, got {self.slope}")
        if not (np.isfinite(self.dead_zone) and self.dead_zone >= 0):
            raise AnalysisError(f"the dead zone must be at least 0, got {self.dead_zone}")

    @property
    def plant(self) -> LinearPlant:
        return self.assumed

    kind = "switching"

    def facts(self) -> Mapping[str, Any]:
        return {
            "P": self.P, "D": self.D, "delay": self.delay, "slope": self.slope, "dead_zone": self.dead_zone,
            "position": self.position, "rate": self.rate, "switches": self.switches,
        }  # fmt: skip

    @cached_property
    def realisation(self) -> Realisation:
        n_u, n_y = self.assumed.n_u, self.assumed.n_y
        at, moves = self.assumed.outputs.index(self.position), self.assumed.outputs.index(self.rate)
        S = np.zeros((n_u, n_y))
        S[:, at], S[:, moves] = self.P, self.D
        none = np.zeros((0, 0)), np.zeros((0, n_y)), np.zeros((n_u, 0))
        modes: tuple[Mode, ...] = (Mode("on", *none, S),)
        guards: tuple[Guard, ...] = ()
        table = None
        if self.switches:
            modes = (*modes, Mode("off", *none, np.zeros_like(S)))
            guards = make_guards(np.eye(n_y)[at], np.eye(n_y)[moves], self.slope, self.dead_zone)
            table = np.full((2, 4), OFF)
            table[:, 3] = ON
        return Realisation.of_modes(Layout.of(), modes, taps=(float(self.delay),), guards=guards, table=table)
