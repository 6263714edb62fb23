"""A controller as a hybrid linear system, the form that every simulation and every analysis uses.

A controller has a state a and is always in one of its *modes*, in each of which ȧ = M a + N v and u = −K a − S v. Its
*readings* v are the current outputs, outputs of a given delay ago (its taps, zero included), or both, with its own
commands of the same delays if it reads them; they are followed by *signals*, which are given functions of time that do
not depend on the plant. An *event* sets a := J a, may enter another mode, and its *action*, one delay later, sets
a := G a. It occurs when the state reaches a face |R_j a| = 1 of the event rule, or at a tick of a clock; without events
a := J a may occur at the multiples of a *period*. *Guards* g_j(w) = wᵀQ_j w + c_j of w = (v, a) select the mode: for
each mode and each pattern of their signs a table gives the next. It is the direction and the memory of a guard: what
that does depends on the mode in which it changes its sign. What comes first at one instant is stated in
docs/simulation.md. Observer, hold and event rule are one instance (:mod:`icmj.controller.controller`), feedback of
delayed outputs that is switched on and off is another (:mod:`icmj.controller.switching`).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from numbers import Real
from typing import Any

import numpy as np

from icmj.base.array import RELATIVE_ROUNDING, Array, as_naturals, real
from icmj.base.text import one_line
from icmj.controller.layout import Layout
from icmj.errors import AnalysisError

_MOST_GUARDS = 16  # a table has a column for each pattern of their signs


def _expect_matrix(given: Array, what: str, shape: tuple[int, ...]) -> Array:
    """The matrix, of floats; a size of −1 in ``shape`` is any.

    Raises:
        AnalysisError: if it has another shape, or an entry that is not a finite real number.
    """
    matrix = given if isinstance(given, np.ndarray) and given.dtype == float else real(given, what, AnalysisError)
    if matrix.ndim != len(shape) or any(size not in (-1, is_) for is_, size in zip(matrix.shape, shape, strict=True)):
        sizes = ", ".join("any" if size < 0 else str(size) for size in shape)
        raise AnalysisError(f"{what} has the shape {matrix.shape}; expected ({sizes})")
    if not np.isfinite(matrix).all():
        raise AnalysisError(f"{what} has an entry that is not finite")
    return matrix


def _expect_number(given: object, what: str, low: float) -> float:
    """A finite number of ``low`` or more.

    Raises:
        AnalysisError: if it is another.
    """
    if isinstance(given, bool) or not isinstance(given, Real) or not low <= float(given) < np.inf:
        raise AnalysisError(f"{what} is {one_line(repr(given), 60)}; expected a finite number of at least {low:g}")
    return float(given)


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

    Raises:
        AnalysisError: on construction, if a matrix has another shape, or an entry that is not a finite number.
    """

    name: str
    M: Array
    N: Array
    K: Array
    S: Array
    rates: Rates | None = None

    def __post_init__(self) -> None:
        S = _expect_matrix(self.S, f"S of mode {self.name!r}", (-1, -1))
        N = _expect_matrix(self.N, f"N of mode {self.name!r}", (-1, S.shape[1]))
        M = _expect_matrix(self.M, f"M of mode {self.name!r}", (len(N), len(N)))
        K = _expect_matrix(self.K, f"K of mode {self.name!r}", (len(S), len(N)))
        for name, matrix in (("M", M), ("N", N), ("K", K), ("S", S)):
            object.__setattr__(self, name, matrix)


@dataclass(frozen=True, eq=False)
class Guard:
    """A quadratic function of readings and state whose sign helps to select the mode: g(w) = wᵀQ w + c, w = (v, a).

    Attributes:
        Q: symmetric, shape (n_v + N_a, n_v + N_a), or (n_v, n_v) if the readings alone decide.
        c: the constant.

    Raises:
        AnalysisError: on construction, if Q is zero or not symmetric, or a number is not finite.
    """

    Q: Array
    c: float = 0.0

    def __post_init__(self) -> None:
        Q = _expect_matrix(self.Q, "the matrix of a guard", (-1, -1))
        if Q.shape[0] != Q.shape[1] or np.abs(Q - Q.T).max(initial=0) > RELATIVE_ROUNDING * np.abs(Q).max(initial=0):
            raise AnalysisError("the matrix of a guard must be symmetric; take the mean of it and its transpose")
        if not Q.any():
            raise AnalysisError("a guard whose matrix is zero has one sign for ever; leave it out")
        object.__setattr__(self, "Q", Q)
        object.__setattr__(self, "c", _expect_number(self.c, "the constant of a guard", -np.inf))

    def __call__(self, w: Array) -> Array:
        """g(w), shape (..., n_v + N_a) → (...); what stands behind the columns of Q does not count."""
        w = np.asarray(w)[..., : len(self.Q)]
        return np.asarray(np.einsum("...i,ij,...j->...", w, self.Q, w) + self.c)


@dataclass(frozen=True, eq=False)
class Realisation:
    """A controller as linear modes, with resets of its state a; a simulation needs nothing else of the controller.

    Attributes:
        layout: the segments of a.
        modes: at least one; a run starts in the mode that :meth:`following` gives for mode 0.
        J: a := J a at an event, or every ``period``, shape (N_a, N_a) (eq. imp).
        G: a := G a at the action of an event, ``delay`` later; the identity without a delay.
        R: the event function's faces are |R_j a| = 1, with R_j the rows between ``cuts``; shape (r, N_a) (eq. ED_e).
        cuts: first row of each face, and the number of rows; shape (f + 1,). Without faces there is no event function.
        delay: t_d from an event to its action [s].
        taps: delays of the readings [s]: v = (y(t − τ_1), y(t − τ_2), …), shape (T,), increasing from 0 or more; (0,)
            for the current outputs.
        commands: whether it also reads its own commands of each delay: v = (y(t − τ_1), u(t − τ_1), y(t − τ_2), …),
            but for the tap of 0 s. They may enter its state only: S must be zero for them, and for delayed outputs.
        period: interval between the resets a := J a of a controller without events [s]; infinity for none.
        guards: functions whose signs select the mode.
        table: the mode that follows, by the present mode and the number Σ_j 2^j [g_j(w) > 0], shape (modes, 2^guards).
        signals: terms a cos(ωt + φ) on [start, end), which enter through the last columns of N; each row is (signal,
            a, ω, φ, start, end), shape (M, 6). A term that ends when it starts is an impulse of area a, which moves
            the state at once.
        wait: the least time from an event to the next that the rule causes [s]. A rule that is beyond a face when it is
            over causes an event then.
        clock: interval of a clock whose ticks are events [s]; infinity for none.
        sampling: time from when the rule reaches a face to the event [s].
        watched: in which modes the rule is watched; in all if empty.
        after: the mode that follows an event, by the mode in which it occurs; the same mode if empty.

    Raises:
        AnalysisError: on construction, if a matrix does not fit the others, a delay, a period or a table is invalid,
            commands have no delayed tap, or a command is computed from another without a state between them.
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
    wait: float = 0.0
    clock: float = np.inf
    sampling: float = 0.0
    watched: tuple[bool, ...] = ()
    after: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        self._expect_shapes()
        taps = tuple(_expect_number(tap, "a tap of a controller [s]", 0.0) for tap in self.taps)
        if not taps or np.any(np.diff(taps) <= 0):
            raise AnalysisError(f"the taps of a controller must be rising delays of at least 0 s, got {self.taps}")
        object.__setattr__(self, "taps", taps)
        if self.commands and not self.delayed:
            raise AnalysisError("a controller that reads its own commands needs a delayed tap to read them by")
        if self.commands and self.tapped and any(np.any(mode.S) for mode in self.modes):
            raise AnalysisError("a controller that reads its own commands must have S = 0; let readings move a state")
        for name in ("delay", "wait", "sampling"):
            object.__setattr__(self, name, _expect_number(getattr(self, name), f"the {name} of a controller [s]", 0.0))
        for name in ("period", "clock"):
            if not getattr(self, name) > 0:
                raise AnalysisError(f"the {name} of a controller is {getattr(self, name)} s; it must be positive")
        if self.period < np.inf and self.eventful:
            raise AnalysisError("a controller is reset by events or with a period; leave one of them out")
        self._expect_modes()

    def _expect_shapes(self) -> None:
        """Refuse matrices that do not fit one another; compiled code reads them without looking."""
        if not self.modes:
            raise AnalysisError("a controller has at least one mode")
        first, size = self.modes[0], self.layout.size
        for mode in self.modes:
            for name, shape in (("M", (size, size)), ("S", first.S.shape)):
                _expect_matrix(getattr(mode, name), f"{name} of mode {mode.name!r}", shape)
        n_v = first.S.shape[1]
        for name, shape in (("J", (size, size)), ("G", (size, size)), ("R", (-1, size)), ("signals", (-1, 6))):
            given = np.asarray(getattr(self, name))
            if name == "signals" and given.shape == (len(given), 6):
                given = np.where(np.arange(6) == 5, np.minimum(given, np.finfo(float).max), given)  # may have no end
            _expect_matrix(given, f"{name} of a controller", shape)
            object.__setattr__(self, name, np.asarray(getattr(self, name), dtype=float))
        cuts = as_naturals(self.cuts, "cuts of a controller", AnalysisError)
        if not len(cuts) or cuts[0] != 0 or cuts[-1] != len(self.R) or np.any(np.diff(cuts) <= 0):
            raise AnalysisError(
                f"cuts of a controller are {cuts.tolist()}; expected rising numbers from 0 to {len(self.R)}, the "
                "number of rows of R"
            )
        object.__setattr__(self, "cuts", cuts)
        for guard in self.guards:
            if len(guard.Q) not in (n_v, n_v + size):
                raise AnalysisError(
                    f"the matrix of a guard has the shape {guard.Q.shape}; expected {(n_v, n_v)} for readings, or "
                    f"{(n_v + size, n_v + size)} for readings and state"
                )

    def _expect_modes(self) -> None:
        """Refuse tables that do not say of every mode what follows."""
        count, patterns = len(self.modes), 1 << len(self.guards)
        if len(self.guards) > _MOST_GUARDS:
            raise AnalysisError(f"a controller has {len(self.guards)} guards; at most {_MOST_GUARDS} are possible")
        if len(self.watched) not in (0, count) or len(self.after) not in (0, count):
            raise AnalysisError(f"watched and after of a controller have one entry for each of its {count} modes")
        object.__setattr__(
            self, "after", tuple(as_naturals(self.after, "after of a controller", AnalysisError).tolist())
        )
        if self.guards and self.table is None:
            raise AnalysisError("a controller with guards needs a table that gives the next mode for their signs")
        if self.table is not None:
            if np.shape(self.table) != (count, patterns):
                raise AnalysisError(
                    f"the table of modes has the shape {np.shape(self.table)}; expected {(count, patterns)}, modes by "
                    "patterns of signs"
                )
            table = as_naturals(np.ravel(self.table), "the table of modes", AnalysisError)
            object.__setattr__(self, "table", table.reshape(count, patterns))
        if not all(0 <= mode < count for mode in (*self.after, *np.ravel([] if self.table is None else self.table))):
            raise AnalysisError(f"a mode follows that does not exist; there are {count}, counted from 0")

    @classmethod
    def of_modes(cls, layout: Layout, modes: tuple[Mode, ...], **more: Any) -> Realisation:
        """One without an event rule, whose state nothing resets; ``more`` are its other attributes."""
        one, none = np.eye(layout.size), np.zeros((0, layout.size))
        return cls(layout, modes, one, one, none, np.zeros(1, dtype=int), **more)

    @property
    def delayed(self) -> tuple[float, ...]:
        """The taps that are not 0 s."""
        return self.taps[1:] if self.taps[0] == 0 else self.taps

    @property
    def tapped(self) -> bool:
        """Whether it only reads delayed outputs, so that its command is known one delay in advance."""
        return self.taps[0] > 0

    @property
    def plain(self) -> bool:
        """Whether it is one mode that reads the current outputs alone, and commands from its state."""
        return len(self.modes) == 1 and self.taps == (0.0,) and not self.guards and not self.modes[0].S.any()

    @property
    def eventful(self) -> bool:
        """Whether it has an event rule or a clock."""
        return len(self.cuts) > 1 or self.clock < np.inf

    @property
    def resets(self) -> bool:
        """Whether its state is reset, by events or with a period."""
        return self.eventful or self.period < np.inf

    def read(self, C: Array, mode: Mode) -> Array:
        """Matrix from (x, a) to the readings in a mode if nothing were delayed, for the plant's C; (n_v, n + N_a)."""
        here = np.hstack([C, np.zeros((len(C), len(mode.M)))])
        S = mode.S[:, : len(C)] if self.taps[0] == 0 else np.zeros((len(mode.K), len(C)))
        both = np.vstack([here, np.hstack([-S @ C, -mode.K])]) if self.commands else here
        return np.vstack([here if tau == 0 else both for tau in self.taps])

    def signals_of(self, n_y: int) -> int:
        """Number of signals that it is given: its readings less those that its taps make of ``n_y`` outputs."""
        n_u, n_v = self.modes[0].S.shape
        return int(n_v - n_y * (self.taps[0] == 0) - len(self.delayed) * (n_y + (n_u if self.commands else 0)))

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

    @property
    def successors(self) -> np.ndarray:
        """The mode after each, by the pattern of signs of the guards: the table, or itself without one."""
        if self.table is not None:
            return self.table
        return np.arange(len(self.modes))[:, None].repeat(1 << len(self.guards), axis=1)

    def following(self, mode: int, w: Array) -> int:
        """The mode that follows ``mode`` for these readings and state, shape (n_v + N_a,), or readings alone."""
        return self.chosen(mode, tuple(float(guard(w)) > 0 for guard in self.guards))

    def chosen(self, mode: int, positive: tuple[bool, ...]) -> int:
        """The mode that follows ``mode`` for these signs of the guards."""
        return int(self.successors[mode, sum(1 << j for j, sign in enumerate(positive) if sign)])


def parallel(first: Realisation, second: Realisation, n_y: int) -> Realisation:
    """Two controllers that read the same ``n_y`` outputs and whose commands are added, as one.

    Its state is that of both, its modes are the pairs of theirs, and its taps all that either has. Signals of the first
    come before those of the second.

    Raises:
        AnalysisError: if both have events or periodic resets, either reads its own commands, or their numbers of
            commands or outputs differ.
    """
    from scipy.linalg import block_diag

    if first.resets and second.resets:
        raise AnalysisError("both controllers have events or resets of their own; only one of the two can")
    if first.commands or second.commands:
        raise AnalysisError("a controller that reads its own commands would read those of the other; it stands alone")
    taps = tuple(sorted({*first.taps, *second.taps}))
    parts = (first, second)
    R = [part.signals_of(n_y) for part in parts]
    if len(first.modes[0].S) != len(second.modes[0].S) or min(R) < 0:
        raise AnalysisError(
            f"the controllers have {len(first.modes[0].S)} and {len(second.modes[0].S)} commands and read "
            f"{first.modes[0].S.shape[1]} and {second.modes[0].S.shape[1]} numbers; both need one plant, of {n_y} "
            "outputs"
        )
    sizes = [part.layout.size for part in parts]
    n_v, N_a, n_u = n_y * len(taps) + sum(R), sum(sizes), first.modes[0].S.shape[0]
    states = slice(0, sizes[0]), slice(sizes[0], N_a)
    reads = []
    for number, part in enumerate(parts):
        outputs = [n_y * taps.index(tau) + np.arange(n_y) for tau in part.taps]
        reads.append(np.concatenate([*outputs, n_y * len(taps) + sum(R[:number]) + np.arange(R[number])]).astype(int))
    modes = []
    for a in first.modes:
        for b in second.modes:
            N, S = np.zeros((N_a, n_v)), np.zeros((n_u, n_v))
            for mode, at, read in zip((a, b), states, reads, strict=True):
                N[at, read] = mode.N
                S[:, read] += mode.S
            name = " and ".join(of.name for of, part in ((a, first), (b, second)) if len(part.modes) > 1)
            modes.append(Mode(name or f"{a.name} and {b.name}", block_diag(a.M, b.M), N, np.hstack([a.K, b.K]), S))
    guards = []
    for part, at, read in zip(parts, states, reads, strict=True):
        where = np.concatenate([read, n_v + np.arange(at.start, at.stop)])
        for guard in part.guards:
            Q = np.zeros((n_v + N_a, n_v + N_a))
            Q[np.ix_(where[: len(guard.Q)], where[: len(guard.Q)])] = guard.Q
            guards.append(Guard(Q, guard.c))
    # modes are numbered by pairs, and signs of the guards of the first come before those of the second
    count = len(second.modes)
    table = (count * first.successors[:, None, None] + second.successors[:, :, None]).reshape(len(modes), -1)
    i, j = np.divmod(np.arange(len(modes)), count)
    acting, mine = (second, j) if second.resets else (first, i)
    watched, after = tuple(acting.watched[k] for k in mine if acting.watched), np.zeros(0, dtype=int)
    if acting.after:
        later = np.array(acting.after)[mine]
        after = count * i + later if second.resets else count * later + j
    signals = np.concatenate([first.signals, second.signals + np.array([R[0], 0, 0, 0, 0, 0])])
    names, lengths = ([*of[0], *of[1]] for of in zip(*((p.layout.names, p.layout.sizes) for p in parts), strict=True))
    if len(set(names)) < len(names):
        names = [f"{name}_{1 + (k >= len(first.layout.names))}" for k, name in enumerate(names)]
    return Realisation(
        Layout(tuple(names), tuple(lengths)), tuple(modes), block_diag(first.J, second.J),
        block_diag(first.G, second.G), block_diag(first.R, second.R), acting.cuts, delay=acting.delay, taps=taps,
        period=acting.period, guards=tuple(guards), table=table if guards else None, signals=signals, wait=acting.wait,
        clock=acting.clock, sampling=acting.sampling, watched=watched, after=tuple(after.tolist()),
    )  # fmt: skip
