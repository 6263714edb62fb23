"""Activation dynamics of muscles: a lag between the command of an input and its action."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace

import numpy as np

from icmj.base.array import Positive
from icmj.errors import ModelError
from icmj.plant.linear_plant import LinearPlant

Each = Positive | Mapping[str, Positive]
"""A number for all inputs, or one for each input that it names."""

Lag = tuple[float] | tuple[float, float]
"""Parameters of one lag: τ [s] of the first order; ω₀ [rad/s] and ζ of the second."""


@dataclass(frozen=True)
class Activation:
    """Activation dynamics: a lag of unit gain between the command u of an input and the activation a that acts there.

    The first order is τ ȧ = u − a, the second order is ä + 2ζω₀ ȧ + ω₀² a = ω₀² u. The states of the input ``ankle``
    are called ``ankle_act`` or, for the second order, ``ankle_act0`` for ȧ and ``ankle_act1`` for a. The unit of a is
    that of the command.

    Attributes:
        order: order of the lag: 1 is ``1/(τs + 1)``, 2 is ``ω₀²/(s² + 2ζω₀s + ω₀²)``; 0 is none where the assumed plant
            has one.
        time_constant: time constant τ [s]. For the second order it is 1/ω₀. This and the following are one number for
            all inputs, or one number for each input by name; inputs that are not named have no lag.
        frequency: natural frequency ω₀ of the second order, instead of a time constant [rad/s].
        damping_ratio: damping ratio ζ of the second order (default: 1, critically damped).

    Raises:
        ModelError: on construction, if the keys do not define a lag of this order, or a number is not positive.
    """

    order: int
    time_constant: Each | None = None
    frequency: Each | None = None
    damping_ratio: Each | None = None

    def __post_init__(self) -> None:
        if isinstance(self.order, bool) or self.order not in (0, 1, 2):
            raise ModelError(f"activation: order must be 0, 1 or 2, got {self.order}")
        given = [field.name for field in fields(self)[1:] if getattr(self, field.name) is not None]
        allowed = {0: (), 1: ("time_constant",), 2: ("time_constant", "frequency", "damping_ratio")}[self.order]
        for name in given:
            if name not in allowed:
                raise ModelError(f"activation: a lag of order {self.order} has no {name}")
            value = getattr(self, name)
            if isinstance(value, Mapping) and not value:
                raise ModelError(f"activation: {name} names no input")
            for number in value.values() if isinstance(value, Mapping) else (value,):
                if not 0 < float(number) < np.inf:
                    raise ModelError(f"activation: {name} must be a positive number, got {number}")
        if self.order and (self.time_constant is None) == (self.frequency is None):
            ways = "a time_constant [s]" if self.order == 1 else "either a time_constant [s] or a frequency [rad/s]"
            raise ModelError(f"activation: give a lag of order {self.order} {ways}")
        named = self._pace
        if isinstance(self.damping_ratio, Mapping) and isinstance(named, Mapping):
            for name in self.damping_ratio:
                if name not in named:
                    raise ModelError(f"activation: damping_ratio names {name!r}, which is given no lag")

    @property
    def _pace(self) -> Each | None:
        return self.time_constant if self.frequency is None else self.frequency

    def lags(self, inputs: Sequence[str]) -> tuple[Lag | None, ...]:
        """The parameters of the lag of each of the ``inputs``; ``None`` for an input without a lag.

        Raises:
            ModelError: if it names what is no input.
        """
        for value in (self._pace, self.damping_ratio):
            for name in value if isinstance(value, Mapping) else ():
                if name not in inputs:
                    raise ModelError(f"activation: no input {name!r}; there are {', '.join(inputs)}")
        return tuple(self._lag(name) for name in inputs)

    def _lag(self, name: str) -> Lag | None:
        pace = _of(self._pace, name)
        if pace is None:
            return None
        if self.order == 1:
            return (pace,)
        return (pace if self.frequency is not None else 1 / pace, _of(self.damping_ratio, name) or 1.0)

    def before(self, plant: LinearPlant) -> LinearPlant:
        """The linear plant with this lag between its commands and its inputs.

        The states of the lag follow those of the plant. Pushes act on the plant itself, after the lag.

        Raises:
            ModelError: if it names what is no input of the plant.
            AnalysisError: if a state of the plant has the name of an activation.
        """
        lags = self.lags(plant.inputs)
        sizes = [0 if lag is None else len(lag) for lag in lags]
        n, size = plant.n, plant.n + sum(sizes)
        A, B, C = np.zeros((size, size)), np.zeros((size, plant.n_u)), np.zeros((plant.n_y, size))
        A[:n, :n], B[:n], C[:, :n] = plant.A, plant.B, plant.C
        states, units, at = list(plant.states), list(plant.state_units), n
        for j, (lag, of) in enumerate(zip(lags, plant.inputs, strict=True)):
            if lag is None:
                continue
            unit = plant.input_units[j]
            last = at + len(lag) - 1  # the activation itself
            A[:n, last], B[:n, j] = plant.B[:, j], 0.0
            if len(lag) == 1:
                A[at, at], B[at, j] = -1 / lag[0], 1 / lag[0]
            else:
                omega, zeta = lag
                A[at, at], A[at, last], A[last, at] = -2 * zeta * omega, -omega * omega, 1.0
                B[at, j] = omega * omega
            states += activation_names(of, len(lag))
            units += [unit and f"{unit}/s", unit][-len(lag) :]
            at = last + 1
        none = np.zeros((size - n, plant.n_u))
        pushes = {push: np.append(effect, none[:, 0]) for push, effect in plant.pushes.items()}
        return replace(
            plant, A=A, B=B, C=C, B_d=np.vstack([plant.B_d, none]), pushes=pushes, states=tuple(states),
            state_units=tuple(units),
        )  # fmt: skip


def activation_names(of: str, size: int) -> list[str]:
    """Names of the activations of the input ``of``."""
    return [f"{of}_act"] if size == 1 else [f"{of}_act{i}" for i in range(size)]


def is_activation(state: str, inputs: Sequence[str]) -> bool:
    """Whether a state has the name of an activation of one of the inputs."""
    return any(state in (*activation_names(of, 1), *activation_names(of, 2)) for of in inputs)


def _of(value: Each | None, name: str) -> float | None:
    found = value.get(name) if isinstance(value, Mapping) else value
    return None if found is None else float(found)
