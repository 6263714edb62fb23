"""The other controllers: the continuous predictor, and feedback of delayed outputs.

The continuous predictor controller: observer, predictor and feedback all the time, over a delay.

What is commanded now, v(t), acts t_d later: u(t) = v(t − t_d). The observer knows what acts, the predictor what is
under way (Gawthrop, Loram, Lakie and Gollee 2011):

    ẋ_o = Â x_o + B̂ u + L (y − Ĉ x_o)
    p   = e^{Â t̂} x_o + ∫_{t−t̂}^{t} e^{Â(t−s)} B̂ v(s) ds,      v = −k̂ p

with t̂ the delay that it assumes. With an exact model p(t) = x(t + t_d) but for the observer's error, and the poles are
those of Â − B̂k̂ and Â − LĈ alone, whatever the delay (Manitius and Olbrot 1979: finite spectrum assignment).

It is run as it acts, t_d later: x_o and p are those of t − t_d, whose readings and commands are taps, and the integral
is over the commands that acted in the last t̂. The equation ṗ = (Â − B̂k̂) p + … that follows from it leaves a
difference between p and the integral to itself, which grows with the plant's own modes. So p follows it for t̂ at a
time, and is then taken from the integral anew: z, with ż = Â z + B̂ u, has been 0 that long ago.

Continuous feedback of delayed outputs with proportional, integral and derivative gains, and of the torque itself.

With readings delayed by t_d, a position θ_Δ and a rate θ'_Δ, and with force feedback f,

    e = w θ_Δ − f,      τ f' = −f + G T,      u = −(K_P e + K_I ∫e dt + K_D e')

This is the feedback of Peterka's models of stance: a neural controller K_P + K_I/s + K_D s, a sensory weight w, and
positive force feedback through the slow low-pass G/(τs + 1), which shifts where a person leans so that less torque is
needed. T is the command itself, as it is, or an output of the plant that shows the torque of its muscles, delayed as
the others. Two states, one mode.

Feedback of delayed outputs that is switched on and off in their plane: no observer, no hold, two modes.

With readings delayed by t_d, a position θ_Δ and a rate θ'_Δ,

    u = −(P θ_Δ + D θ'_Δ)     where θ_Δ (θ'_Δ − a θ_Δ) > 0 and θ_Δ² + θ'_Δ² > r²
    u = 0                     elsewhere

(Asai et al. 2009, after Bottaro et al. 2008). While feedback is off, the plant moves along its own stable manifold
towards the upright. With ``switches`` false, feedback is always on, which is the continuous delayed controller.

Switched delayed feedback of several joints: channels, each of which is switched in its own plane.

A channel reads a position θ and a rate θ', each an output or a sum of outputs with weights, and commands one input,

    u = −(P θ_Δ + D θ'_Δ)

where it is on, as :mod:`icmj.controller.delayed` says of one; a channel that does not switch is on throughout. With
m channels that switch there are 2^m modes. The *virtual pendulum* is one channel: position and rate are those of the
line from the ankle to the centre of mass, sums over the joints, and the torque acts at the ankle.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import Annotated, Any, Literal

import numpy as np
from annotated_types import Len
from numpy.typing import ArrayLike

from icmj.base.array import MOST_ENTRIES, RELATIVE_ROUNDING, Array, Finite, NonNegative, Positive
from icmj.controller.controller import Law
from icmj.controller.design import GROWTH, Delay, Design
from icmj.controller.realisation import Guard, Layout, Mode, Realisation
from icmj.controller.setpoint import Setpoint
from icmj.errors import AnalysisError
from icmj.plant.linear_plant import LinearPlant, expect_linear

Combination = str | Annotated[Mapping[str, Finite], Len(1, MOST_ENTRIES)]
"""The name of an output, or the weights of several outputs by name."""


@dataclass(frozen=True, eq=False)
class PredictorController(Law):
    """The continuous predictor controller, for a delay; without a delay, use :class:`icmj.Continuous`.

    Before t = 0 its commands are zero, and its readings are the outputs at t = 0. Its observer starts at zero, t_d
    before t = 0.

    Attributes:
        design: gains k̂ and L for the assumed plant.
        delay: the actual delay t_d and the delay that the predictor assumes.
        setpoint: the set-point r(t) that it follows. A change is known when it occurs and takes effect t_d later.
            ``None`` if r is always 0.

    Raises:
        AnalysisError: on construction, if a part has the wrong class, there is no delay, the set-point belongs to
            another model, or the model is so unstable over the assumed delay that a prediction would have no correct
            digit.
    """

    design: Design
    delay: Delay
    setpoint: Setpoint | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.design, Design):
            raise AnalysisError(f"the controller's design is a {type(self.design).__name__}; expected a Design")
        if not isinstance(self.delay, Delay):
            raise AnalysisError(f"the controller's delay is a {type(self.delay).__name__}; expected a Delay")
        if not self.delay:
            raise AnalysisError(
                "the predictor controller predicts over a delay, and there is none; give one, or take Continuous()"
            )
        fastest = float(np.linalg.eigvals(self.plant.A).real.max(initial=0.0))
        if fastest * self.delay.predicted > GROWTH:
            raise AnalysisError(
                f"no prediction over a delay of {self.delay.predicted:g} s: the model grows "
                f"e^{fastest * self.delay.predicted:.3g}-fold in it, which leaves no "
                "significant digit; assume a shorter delay"
            )
        if self.setpoint and not isinstance(self.setpoint, Setpoint):
            raise AnalysisError(f"the controller's setpoint is a {type(self.setpoint).__name__}; expected a Setpoint")
        if self.setpoint and len(self.setpoint.x_ss) != self.plant.n:
            raise AnalysisError("the set-point's steady states are not of the controller's model; make it for that one")

    @property
    def plant(self) -> LinearPlant:
        """The plant of its design."""
        return self.design.plant

    @property
    def kind(self) -> Literal["predictor"]:
        """``predictor``."""
        return "predictor"

    def facts(self) -> Mapping[str, Any]:
        """The delays and the gains."""
        k, L = self.design.k, self.design.L
        return {"delay": self.delay.t_d, "assumed_delay": self.delay.predicted, "k": k, "L": L}

    @property
    def E(self) -> Array:
        """e^{Â t̂}, shape (n̂, n̂)."""
        from scipy.linalg import expm

        return np.asarray(expm(self.plant.A * self.delay.predicted))

    @cached_property
    def realisation(self) -> Realisation:
        """The realisation, with the state (x_o, p, z) and the set-point delayed by t_d."""
        design, (A, B, C), k, L = self.design, (self.plant.A, self.plant.B, self.plant.C), self.design.k, self.design.L
        t_d, assumed, r = self.delay.t_d, self.delay.predicted, self.setpoint
        n, n_u, n_y, R = len(A), B.shape[1], len(C), len(r.names) if r else 0
        same = abs(assumed - t_d) <= RELATIVE_ROUNDING * t_d
        predicts = same or assumed > RELATIVE_ROUNDING * t_d  # else p is x_o
        taps = (t_d,) if same or not predicts else tuple(sorted((assumed, t_d)))
        layout = Layout.of(x_o=n, **({"p": n, "z": n} if predicts else {}), **({"r": R} if R else {}))
        each, size = n_y + n_u, layout.size
        o, p = layout["x_o"], layout["p" if predicts else "x_o"]
        K, M, N, J = np.zeros((n_u, size)), np.zeros((size, size)), np.zeros((size, each * len(taps) + R)), np.eye(size)
        K[:, p] = k
        if r:
            K[:, layout["r"]] = -r.gain(k)
            N[layout["r"], -R:] = np.eye(R)
        then = each * taps.index(t_d)
        read, acted = slice(then, then + n_y), slice(then + n_y, then + each)
        M[o, o], N[o, read], N[o, acted] = design.A_o, L, B
        if predicts:
            z, E = layout["z"], self.E
            M[p] = -B @ K
            M[z] = M[p]
            M[p, p], M[p, o], M[z, z], N[p, read] = A + M[p, p], -E @ L @ C, A, E @ L
            if not same:  # else what leaves the integral is what the observer takes up
                gone = each * taps.index(assumed) + n_y
                N[p, acted], N[p, gone : gone + n_u] = E @ B, -E @ B
            J[p], J[z] = 0, 0
            J[p, o], J[p, z] = E, np.eye(n)
        signals = np.zeros((0, 6))
        if r:  # as long after it as the command acts
            signals = r.terms + t_d * np.array([0, 0, 0, 0, 1, 1])
            signals[:, 3] -= r.terms[:, 2] * t_d
        mode = Mode("predictor", M, N, K, np.zeros((n_u, N.shape[1])))
        return Realisation(
            layout, (mode,), J, np.eye(size), np.zeros((0, size)), np.zeros(1, dtype=int), taps=taps, commands=True,
            period=assumed if predicts else np.inf, signals=signals,
        )  # fmt: skip


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
        inputs, outputs = self.assumed.inputs, self.assumed.outputs
        named = {"position": self.position, "rate": self.rate} | ({"force": self.force} if self.force else {})
        for what, name in named.items():
            if name not in outputs:
                raise AnalysisError(f"the {what} is the output {name!r}; the plant's outputs are {', '.join(outputs)}")
        if len(set(named.values())) < len(named):
            raise AnalysisError(f"the same output serves twice among {', '.join(named)}; name different ones")
        if (self.input and self.input not in inputs) or (not self.input and len(inputs) > 1):
            raise AnalysisError(f"name the input that is controlled, one of {', '.join(inputs)}")
        for letter in ("P", "I", "D", "weight", "force_gain"):
            if not np.isfinite(getattr(self, letter)):
                raise AnalysisError(f"{letter} must be a finite number, got {getattr(self, letter)}")
        for what, value in (("delay", self.delay), ("time constant of the force feedback", self.force_time)):
            if not (np.isfinite(value) and value > 0):
                raise AnalysisError(f"the {what} of the delayed PID controller must be positive, got {value} s")
        if not self.force and self.D * self.force_gain >= self.force_time:
            raise AnalysisError(
                f"force feedback of the command with D G/τ = {self.D * self.force_gain / self.force_time:g} has no "
                "answer; it must be below 1: take a longer time constant or a smaller gain"
            )

    @property
    def plant(self) -> LinearPlant:
        return self.assumed

    @property
    def kind(self) -> Literal["delayed-pid"]:
        return "delayed-pid"

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
        acts = self.assumed.inputs.index(self.input) if self.input else 0
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
        return Realisation(
            layout, (Mode("on", M, N, K, S),), np.eye(layout.size), np.eye(layout.size), np.zeros((0, layout.size)),
            np.zeros(1, dtype=int), taps=(float(self.delay),),
        )  # fmt: skip


ON, OFF = 0, 1


def slope_of(share: float) -> float:
    """Slope a [1/s] of the switching line for which feedback is on in a share ρ of the plane: a = −tan(π(ρ − ½)).

    Args:
        share: between 0 and 1; at 1 it is on throughout, which no slope says.

    Raises:
        AnalysisError: if it is not between them.
    """
    if not 0 < share < 1:
        raise AnalysisError(f"the share of the plane in which feedback is on must be between 0 and 1, got {share}")
    return float(-np.tan(np.pi * (share - 0.5)))


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
            if name not in outputs:
                raise AnalysisError(f"the {what} is the output {name!r}; the plant's outputs are {', '.join(outputs)}")
        if self.position == self.rate:
            raise AnalysisError(f"position and rate are the same output, {self.rate!r}; name two")
        for letter in ("P", "D"):
            gain = np.asarray(getattr(self, letter), dtype=float)
            if gain.ndim > 1 or (gain.ndim == 1 and len(gain) != n_u) or not np.isfinite(gain).all():
                raise AnalysisError(f"{letter} must be a finite number, or one for each of the {n_u} inputs")
            object.__setattr__(self, letter, np.broadcast_to(gain, (n_u,)).copy())
        if not (np.isfinite(self.delay) and self.delay > 0):
            raise AnalysisError(f"the delay of the switching controller must be positive, got {self.delay} s")
        if not np.isfinite(self.slope):
            raise AnalysisError(f"the slope of the switching line must be finite, got {self.slope}")
        if not (np.isfinite(self.dead_zone) and self.dead_zone >= 0):
            raise AnalysisError(f"the dead zone must be at least 0, got {self.dead_zone}")

    @property
    def plant(self) -> LinearPlant:
        return self.assumed

    @property
    def kind(self) -> Literal["switching"]:
        return "switching"

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
            # θ (θ' − a θ), and how far out; on where both are positive
            away, Q = np.zeros((n_y, n_y)), np.zeros((n_y, n_y))
            Q[at, moves] = Q[moves, at] = 0.5
            Q[at, at] = -self.slope
            away[at, at] = away[moves, moves] = 1.0
            modes = (*modes, Mode("off", *none, np.zeros_like(S)))
            guards = (Guard(Q), Guard(away, -(self.dead_zone**2)))
            table = np.full((2, 4), OFF)
            table[:, 3] = ON
        return Realisation(
            Layout.of(), modes, np.zeros((0, 0)), np.zeros((0, 0)), np.zeros((0, 0)), np.zeros(1, dtype=int),
            taps=(float(self.delay),), guards=guards, table=table,
        )  # fmt: skip


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
                if name not in outputs:
                    raise AnalysisError(
                        f"the {what} is of output {name!r}; the plant's outputs are {', '.join(outputs)}"
                    )
                row[outputs.index(name)] = weight
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
        inputs = self.assumed.inputs
        if not self.channels:
            raise AnalysisError("a switching controller needs at least one channel")
        if sum(channel.switches for channel in self.channels) > MOST:
            raise AnalysisError(f"at most {MOST} channels can switch; let the others be on throughout")
        for channel in self.channels:
            channel.rows(self.assumed.outputs)
            if (channel.input and channel.input not in inputs) or (not channel.input and len(inputs) > 1):
                raise AnalysisError(f"name the input of each channel, one of {', '.join(inputs)}")
        if not (np.isfinite(self.delay) and self.delay > 0):
            raise AnalysisError(f"the delay of the switching controller must be positive, got {self.delay} s")

    @property
    def plant(self) -> LinearPlant:
        return self.assumed

    @property
    def kind(self) -> Literal["switching"]:
        return "switching"

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
            S[self.assumed.inputs.index(self._called(channel))] = channel.P * position + channel.D * rate
            feedback.append(S)
            if channel.switches:
                # θ (θ' − a θ), and how far out; on where all are positive
                across = np.outer(position, rate)
                mine = [Guard((across + across.T) / 2 - channel.slope * np.outer(position, position))]
                if channel.dead_zone:
                    far = np.outer(position, position) + np.outer(rate, rate)
                    mine.append(Guard(far, -(channel.dead_zone**2)))
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
        return Realisation(
            Layout.of(), tuple(modes), np.zeros((0, 0)), np.zeros((0, 0)), np.zeros((0, 0)), np.zeros(1, dtype=int),
            taps=(float(self.delay),), guards=tuple(guards), table=table,
        )  # fmt: skip
