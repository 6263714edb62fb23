"""Switched delayed feedback of several joints: channels, each of which is switched in its own plane.

A channel reads a position θ and a rate θ', each an output or a sum of outputs with weights, and commands one input,

    u = −(P θ_Δ + D θ'_Δ)

where it is on, as :mod:`icmj.controller.switching` says of one; a channel that does not switch is on throughout. With
m channels that switch there are 2^m modes. The *virtual pendulum* is one channel: position and rate are those of the
line from the ankle to the centre of mass, sums over the joints, and the torque acts at the ankle.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import Annotated, Any

import numpy as np
from annotated_types import Len

from icmj.base.array import MOST_ENTRIES, Array, Finite, NonNegative
from icmj.controller.law import Law, expect_positive, find_input, find_output
from icmj.controller.layout import Layout
from icmj.controller.realisation import Guard, Mode, Realisation
from icmj.controller.switching import SwitchingPD, make_guards
from icmj.errors import AnalysisError
from icmj.plant.linear_plant import LinearPlant, expect_linear

Combination = str | Annotated[Mapping[str, Finite], Len(1, MOST_ENTRIES)]
"""The name of an output, or the weights of several outputs by name."""


MOST = 5  # channels that switch: the table of modes has 8^m entries


@dataclass(frozen=True, eq=False)
class Channel:
    """The feedback of one joint or of the virtual pendulum.

    Attributes:
        position: position that is fed back: an output θ, or weights of several outputs, ``{ ankle = 0.6, hip = 0.3 }``.
        rate: rate that is fed back: an output θ', or weights of several outputs by name.
        P: gain of the position [input per output].
        D: gain of the rate [input per output].
        input: input that is commanded; may be left out if the plant has only one input.
        slope: slope a of the line θ' = aθ that, together with θ = 0, bounds the region where feedback is off [1/s].
        dead_zone: size r of (θ, θ') within which feedback is off.
        switches: whether feedback is switched; if not, it is always on.

    Raises:
        AnalysisError: on construction, if a number is not finite, or the dead zone negative.
    """

    position: Combination
    rate: Combination
    P: Finite
    D: Finite
    input: str = ""
    slope: Finite = 0.0
    dead_zone: NonNegative = 0.0
    switches: bool = True

    def __post_init__(self) -> None:
        for what in ("P", "D", "slope", "dead_zone"):
            if not np.isfinite(getattr(self, what)):
                raise AnalysisError(f"{what} of a channel must be a finite number, got {getattr(self, what)}")
        if self.dead_zone < 0:
            raise AnalysisError(f"the dead zone of a channel must be at least 0, got {self.dead_zone}")

    def rows(self, outputs: tuple[str, ...]) -> tuple[Array, Array]:
        """Position and rate as rows over the outputs, shapes (n_y,).

        Raises:
            AnalysisError: if an output does not exist, or position and rate are the same.
        """
        found = []
        for what, said in (("position", self.position), ("rate", self.rate)):
            row = np.zeros(len(outputs))
            for name, weight in ({said: 1.0} if isinstance(said, str) else said).items():
                row[find_output(outputs, name, what)] = weight
            if not (np.isfinite(row).all() and row.any()):
                raise AnalysisError(f"the weights of a channel's {what} must be finite, and not all zero")
            found.append(row)
        position, rate = found
        if np.linalg.matrix_rank(np.stack(found)) < 2:
            raise AnalysisError("position and rate of a channel are the same combination of outputs; give two")
        return position, rate


@dataclass(frozen=True, eq=False)
class SwitchingChannels(Law):
    """Delayed feedback of several channels, each switched by regions in the plane of its own delayed outputs.

    Attributes:
        assumed: the plant, whose inputs and outputs are used by name.
        channels: at least one channel; the commands of several channels to the same input are added.
        delay: t_d [s].

    Raises:
        AnalysisError: on construction, if a channel does not fit the plant, too many channels are switched, or the
            delay is not positive.
    """

    assumed: LinearPlant
    channels: tuple[Channel, ...]
    delay: float

    def __post_init__(self) -> None:
        expect_linear(self.assumed, "the assumed plant")
        if not self.channels:
            raise AnalysisError("a switching controller needs at least one channel")
        if sum(channel.switches for channel in self.channels) > MOST:
            raise AnalysisError(f"at most {MOST} channels can switch; let the others be on throughout")
        for channel in self.channels:
            channel.rows(self.assumed.outputs)
            find_input(self.assumed, channel.input, "the input of each channel")
        expect_positive(self.delay, "delay of the switching controller")

    @property
    def plant(self) -> LinearPlant:
        return self.assumed

    kind = SwitchingPD.kind

    def facts(self) -> Mapping[str, Any]:
        each = {what: np.array([getattr(c, what) for c in self.channels]) for what in ("P", "D", "slope", "dead_zone")}
        return each | {"delay": self.delay, "channels": ", ".join(self._called(c) for c in self.channels)}

    def _called(self, channel: Channel) -> str:
        return channel.input or self.assumed.inputs[0]

    @cached_property
    def realisation(self) -> Realisation:
        n_u, outputs = self.assumed.n_u, self.assumed.outputs
        feedback, guards, bits = [], list[Guard](), list[list[int]]()
        for channel in self.channels:
            position, rate = channel.rows(outputs)
            S = np.zeros((n_u, len(outputs)))
            S[find_input(self.assumed, channel.input)] = channel.P * position + channel.D * rate
            feedback.append(S)
            if channel.switches:
                mine = make_guards(position, rate, channel.slope, channel.dead_zone)[: 2 if channel.dead_zone else 1]
                bits.append([len(guards) + i for i in range(len(mine))])
                guards += mine
        none = np.zeros((0, 0)), np.zeros((0, len(outputs))), np.zeros((n_u, 0))
        modes, ways = [], list(product((True, False), repeat=len(bits)))
        for way in ways:
            on = iter(way)
            acts = [next(on) if channel.switches else True for channel in self.channels]
            names = [f"{self._called(c)} {'on' if a else 'off'}" for c, a in zip(self.channels, acts, strict=True)]
            S = np.sum([S for S, a in zip(feedback, acts, strict=True) if a] or [np.zeros_like(feedback[0])], axis=0)
            modes.append(Mode(", ".join(names) if len(names) > 1 else names[0].split()[-1], *none, S))
        table = None
        if guards:
            signs = range(1 << len(guards))
            row = [ways.index(tuple(all(sign >> bit & 1 for bit in mine) for mine in bits)) for sign in signs]
            table = np.tile(row, (len(modes), 1))
        taps = (float(self.delay),)
        return Realisation.of_modes(Layout.of(), tuple(modes), taps=taps, guards=tuple(guards), table=table)
