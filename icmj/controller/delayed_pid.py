"""Continuous feedback of delayed outputs with proportional, integral and derivative gains, and of the torque itself.

With readings delayed by t_d, a position θ_Δ and a rate θ'_Δ, and with force feedback f,

    e = w θ_Δ − f,      τ f' = −f + G T,      u = −(K_P e + K_I ∫e dt + K_D e')

This is the feedback of Peterka's models of stance: a neural controller K_P + K_I/s + K_D s, a sensory weight w, and
positive force feedback through the slow low-pass G/(τs + 1), which shifts where a person leans so that less torque is
needed. T is the command itself, as it is, or an output of the plant that shows the torque of its muscles, delayed as
the others. Two states, one mode.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from icmj.base.array import Finite, Positive
from icmj.controller.law import Law, expect_positive, find_input, find_output
from icmj.controller.layout import Layout
from icmj.controller.realisation import Mode, Realisation
from icmj.errors import AnalysisError
from icmj.plant.linear_plant import LinearPlant, expect_linear


@dataclass(frozen=True, eq=False)
class DelayedPID(Law):
    """Delayed proportional, integral and derivative feedback to one input, with feedback of its torque.

    Attributes:
        assumed: the plant, whose inputs and outputs are used by name.
        position: output θ that is fed back.
        rate: output θ' that is fed back.
        P: gain K_P of the position [input per output].
        D: gain K_D of the rate [input per output].
        delay: t_d [s].
        I: gain K_I of the integral [input per output and second].
        weight: sensory weight w of position and rate.
        input: input that is commanded; may be left out if the plant has only one input.
        force: output T that the force feedback G/(τs + 1) reads with the delay; by default the command itself.
        force_gain: gain G of the force feedback [position per unit of T]. With 0 there is no force feedback.
        force_time: time constant τ of the force feedback [s].

    Raises:
        AnalysisError: on construction, if an input or output does not exist, a number is not finite, the delay or the
            time constant is not positive, or the command would depend on itself in a loop.
    """

    assumed: LinearPlant
    position: str
    rate: str
    P: Finite
    D: Finite
    delay: float
    I: Finite = 0.0
    weight: Finite = 1.0
    input: str = ""
    force: str = ""
    force_gain: Finite = 0.0
    force_time: Positive = 1.0

    def __post_init__(self) -> None:
        expect_linear(self.assumed, "the assumed plant")
        outputs = self.assumed.outputs
        named = {"position": self.position, "rate": self.rate} | ({"force": self.force} if self.force else {})
        for what, name in named.items():
            find_output(outputs, name, what)
        if len(set(named.values())) < len(named):
            raise AnalysisError(f"the same output serves twice among {', '.join(named)}; name different ones")
        find_input(self.assumed, self.input, "the input that is controlled")
        for letter in ("P", "I", "D", "weight", "force_gain"):
            if not np.isfinite(getattr(self, letter)):
                raise AnalysisError(f"{letter} must be a finite number, got {getattr(self, letter)}")
        expect_positive(self.delay, "delay of the delayed PID controller")
        expect_positive(self.force_time, "time constant of the force feedback of the delayed PID controller")
        if not self.force and self.D * self.force_gain >= self.force_time:
            raise AnalysisError(
                f"force feedback of the command with D G/τ = {self.D * self.force_gain / self.force_time:g} has no "
                "answer; it must be below 1: take a longer time constant or a smaller gain"
            )

    @property
    def plant(self) -> LinearPlant:
        return self.assumed

    kind = "delayed-pid"

    def facts(self) -> Mapping[str, Any]:
        found: dict[str, Any] = {
            "P": self.P, "I": self.I, "D": self.D, "delay": self.delay, "weight": self.weight,
            "position": self.position, "rate": self.rate,
        }  # fmt: skip
        if self.force_gain:
            found |= {"force": self.force or "command", "force_gain": self.force_gain, "force_time": self.force_time}
        return found

    @cached_property
    def realisation(self) -> Realisation:
        n_u, outputs = self.assumed.n_u, self.assumed.outputs
        theta, omega = outputs.index(self.position), outputs.index(self.rate)
        acts = find_input(self.assumed, self.input)
        # states: the integral of e, then f
        G, pace = self.force_gain, 1 / self.force_time
        M, N = np.array([[0.0, -1.0], [0.0, -pace]]), np.zeros((2, len(outputs)))
        K, S = np.zeros((n_u, 2)), np.zeros((n_u, len(outputs)))
        N[0, theta] = self.weight
        K[acts] = self.I, self.D * pace - self.P
        S[acts, theta], S[acts, omega] = self.P * self.weight, self.D * self.weight
        if self.force:
            torque = outputs.index(self.force)
            N[1, torque] = G * pace
            S[acts, torque] = -self.D * G * pace
        else:  # e' has a part of u itself
            own = 1 - self.D * G * pace
            K, S = K / own, S / own
            M[1], N[1] = M[1] - G * pace * K[acts], -G * pace * S[acts]
        # what nothing reads would stay in the loop as a root at zero
        kept = [state for state, read in enumerate((self.I, G)) if read]
        M, N, K = M[np.ix_(kept, kept)], N[kept], K[:, kept]
        layout = Layout.of(**{("integral", "force")[state]: 1 for state in kept})
        return Realisation.of_modes(layout, (Mode("on", M, N, K, S),), taps=(float(self.delay),))
