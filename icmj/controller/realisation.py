"""The dynamics of a controller, in the form that every simulation and every analysis uses.

A controller has a state a and is always in one of its *modes*. In a mode

    ȧ = M a + N v + …,      u = −K a − S v

where v are its *readings*: the current outputs, or delayed outputs (its taps), with its own commands of the same delays
if it reads them. They are followed by *signals*, which are given functions of time that do not depend on the plant.
Instantaneous changes are described by maps and by functions whose sign changes:

* an *event* sets a := J a, and its *action*, one delay later, sets a := G a. An event occurs when the state reaches a
  face |R_j a| = 1 of an event rule, or at a tick of a clock. With delayed taps a := J a happens at the multiples of a
  *period* instead, and is no event;
* *guards* g_j(v) = vᵀQ_j v + c_j select the mode: for each mode and each pattern of signs, a table gives the next mode.

Observer, hold and event rule are one instance (:mod:`icmj.controller.controller`): a single mode that reads the current
outputs. Feedback of delayed outputs that is switched on and off is another (:mod:`icmj.controller.switching`): two
modes, no state.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from icmj.base.array import Array
from icmj.controller.layout import Layout
from icmj.errors import AnalysisError


@dataclass(frozen=True, eq=False)
class Rates:
    """The terms of a mode's rates: ȧ = A a + B u + N (v − H a), with u the controller's own command.

    Attributes:
        A: dynamics of the controller's models, shape (N_a, N_a).
        B: effect of the command on them, shape (N_a, n_u).
        N: gain of the innovation v − H a, shape (N_a, n_v).
        H: expected readings, shape (n_v, N_a).
    """

    A: Array
    B: Array
    N: Array
    H: Array


@dataclass(frozen=True, eq=False)
class Mode:
    """The dynamics of a controller in one mode: ȧ = M a + N v, u = −K a − S v.

    Attributes:
        name: name of the mode.
        M, N: shapes (N_a, N_a), (N_a, n_v) (for observer and hold eqs. obs, hold).
        K, S: shapes (n_u, N_a), (n_u, n_v) (eq. u).
        rates: the matrices from which M and N are composed, if they are known: M = A − N H − B K.
    """

    name: str
    M: Array
    N: Array
    K: Array
    S: Array
    rates: Rates | None = None


@dataclass(frozen=True, eq=False)
class Guard:
    """A quadratic function of the readings whose sign helps to select the mode: g(v) = vᵀQ v + c.

    Attributes:
        Q: symmetric, shape (n_v, n_v).
        c: the constant.
    """

    Q: Array
    c: float = 0.0

    def __call__(self, v: Array) -> Array:
        """g(v), shape (..., n_v) → (...)."""
        return np.asarray(np.einsum("...i,ij,...j->...", v, self.Q, v) + self.c)


@dataclass(frozen=True, eq=False)
class Realisation:
    """A controller as linear modes with resets of its state a; a simulation needs nothing else of the controller.

    Attributes:
        layout: the segments of a.
        modes: at least one; a run starts in the mode that :meth:`following` gives for mode 0.
        J: a := J a at an event, or every ``period``, shape (N_a, N_a) (eq. imp).
        G: a := G a at the action of an event, ``delay`` later; the identity without a delay.
        R: the event function's faces are |R_j a| = 1, with R_j the rows between ``cuts``; shape (r, N_a) (eq. ED_e).
        cuts: first row of each face, and the number of rows; shape (f + 1,). Without faces there is no event function.
        delay: t_d from an event to its action [s].
        taps: delays of the readings [s]: v = (y(t − τ_1), y(t − τ_2), …), shape (T,), increasing; (0,) for the current
            outputs.
        commands: whether it also reads its own delayed commands: v = (y(t − τ_1), u(t − τ_1), y(t − τ_2), …). They
            may enter its state only: S must be zero.
        period: interval between the resets a := J a of a controller with delayed taps [s]; infinity for none.
        guards: functions whose signs select the mode; they read delayed taps.
        table: the mode that follows, by the present mode and the number Σ_j 2^j [g_j(v) > 0], shape (modes, 2^guards).
        signals: terms a cos(ωt + φ) on [start, end), which enter through the last columns of N; each row is (signal,
            a, ω, φ, start, end), shape (M, 6). A term that ends when it starts is an impulse of area a, which moves
            the state at once.

    Raises:
        AnalysisError: on construction, if taps or period are invalid, guards or commands have no delayed tap to read,
            or a command is computed from another without a state between them.
    """

    layout: Layout
    modes: tuple[Mode, ...]
    J: Array
    G: Array
    R: Array
    cuts: np.ndarray
    delay: float = 0.0
    taps: tuple[float, ...] = (0.0,)
    commands: bool = False
    period: float = np.inf
    guards: tuple[Guard, ...] = ()
    table: np.ndarray | None = None
    signals: Array = field(default_factory=lambda: np.zeros((0, 6)))

    def __post_init__(self) -> None:
        if not self.taps or min(self.taps) < 0 or any(a >= b for a, b in zip(self.taps, self.taps[1:], strict=False)):
            raise AnalysisError(f"the taps of a controller must be rising delays of at least 0 s, got {self.taps}")
        if self.taps[0] == 0 and len(self.taps) > 1:
            raise AnalysisError("a controller reads outputs either as they are or delayed; give a tap of 0 s alone")
        if any(not np.any(guard.Q) for guard in self.guards):
            raise AnalysisError("a guard whose matrix is zero has one sign for ever; leave it out")
        if self.guards and not self.tapped:
            raise AnalysisError("guards choose a mode by delayed readings, and there is no delayed tap")
        if (self.commands or self.period < np.inf) and not self.tapped:
            raise AnalysisError("a controller that reads outputs as they are has neither own commands nor a period")
        if self.commands and any(np.any(mode.S) for mode in self.modes):
            raise AnalysisError("a controller that reads its own commands must have S = 0; let readings move a state")
        if not self.period > 0:
            raise AnalysisError(f"the period of a controller's resets must be positive, got {self.period} s")

    @property
    def tapped(self) -> bool:
        """Whether it only reads delayed outputs, so that its command is known one delay in advance."""
        return self.taps[0] > 0

    def read(self, C: Array, mode: Mode) -> Array:
        """Matrix from (x, a) to the undelayed readings in a mode, for the plant's C; shape (readings, n + N_a)."""
        here = np.hstack([C, np.zeros((len(C), len(mode.M)))])
        if self.commands:
            here = np.vstack([here, np.hstack([np.zeros((len(mode.K), C.shape[1])), -mode.K])])
        return np.tile(here, (len(self.taps), 1))

    @property
    def M(self) -> Array:
        """M of the first mode, which may be the only one."""
        return self.modes[0].M

    @property
    def N(self) -> Array:
        """N of the first mode."""
        return self.modes[0].N

    @property
    def K(self) -> Array:
        """K of the first mode."""
        return self.modes[0].K

    @property
    def rates(self) -> Rates:
        """The matrices from which M and N of the first mode are composed.

        Raises:
            AnalysisError: if the mode does not state the matrices of its rates.
        """
        if self.modes[0].rates is None:
            raise AnalysisError(
                "the controller does not state which outputs its rates are derived from, which this analysis needs"
            )
        return self.modes[0].rates

    def following(self, mode: int, v: Array) -> int:
        """The mode that follows ``mode`` for these readings, shape (n_v,)."""
        return self.chosen(mode, tuple(float(guard(v)) > 0 for guard in self.guards))

    def chosen(self, mode: int, positive: tuple[bool, ...]) -> int:
        """The mode that follows ``mode`` for these signs of the guards."""
        if self.table is None:
            return mode
        return int(self.table[mode, sum(1 << j for j, sign in enumerate(positive) if sign)])
