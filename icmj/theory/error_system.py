"""The error system of intermittent control with a wrong model (paper, section 3; general orders).

With T̂ (n̂ × n), x̃_o = x_o − T̂x and x̃_h = x_h − T̂x, the closed loop between samples is X̄' = Ā_C X̄ with X̄ = (x,
x̃_o, x̃_h); an event sets x̃_h := x̃_o (A_D), and φ(Δ) maps x̄ = (x, x̃_o) from event to event.

With a delay t_d the event itself resets nothing, so that φ(Δ) maps the whole of X̄ from event to event: the state flows
for t_d, then x̃_h is set to the prediction, then the state flows on. The two cases differ only in ``lift``, ``entry``
and ``exit``: the state right after an event, right after its action, and at the next event.

e^{Ā_C t} for many t at once, and functions along it as polynomials in time.

Everything rests on the increment F(t) = e^{Ā_C t} − I: it is small where t is, so nothing cancels as t → 0, and
F(s + t) = F(s) + F(t) + F(s)F(t). Short times come from the Taylor series, long ones from doubling, which is
scaling and squaring with all times of a grid sharing the work. Ā_C is balanced first (a diagonal similarity by
powers of two, exact), because gains make its rows differ by orders of magnitude.

Eigenvalues of φ(Δ) over a range of Δ, each branch followed continuously (panels (a) and (b) of the paper).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from icmj.base.array import Array, balance, exponential, real
from icmj.controller.controller import ERRORS, Controller, compose
from icmj.controller.delay import NO_DELAY, Delay
from icmj.controller.design import Design
from icmj.controller.hold import Hold, system_matched
from icmj.controller.model_prediction import predictor
from icmj.controller.trigger import ClockTrigger
from icmj.errors import AnalysisError
from icmj.plant.linear_plant import LinearPlant, Match, match_ports, transformation


@dataclass(frozen=True, eq=False)
class ErrorSystem:
    """X̄' = Ā_C X̄ between events, X̄ := A_D X̄ at an event (eqs. X_c, imp_X_D).

    Attributes:
        A_C: Ā_C, shape (n + 2n̂, n + 2n̂) (eq. AC_smh_sens, generalised to n ≠ n̂ and to any hold).
        T_hat: T̂, shape (n̂, n).
        actual: the actual plant [A, B, C].
        design: gains and assumed plant [Â, B̂, Ĉ].
        hold: hold of the controller; system-matched if ``None``.
        delay: t_d and the delay that the predictor assumes.
    """

    A_C: Array
    T_hat: Array
    actual: LinearPlant
    design: Design
    hold: Hold | None = None
    delay: Delay = NO_DELAY

    @property
    def n(self) -> int:
        """Number of states of the actual plant."""
        return self.actual.n

    @property
    def n_hat(self) -> int:
        """Number of states of the assumed plant."""
        return self.design.plant.n

    @property
    def k(self) -> Array:
        """k = k̂T̂, shape (n_u, n)."""
        return self.design.k @ self.T_hat

    @property
    def A_D(self) -> Array:
        """The jump x̃_h := x̃_o (eq. AD)."""
        n, m = self.n, self.n_hat
        A_D = np.eye(n + 2 * m)
        A_D[n + m :, n + m :] = 0
        A_D[n + m :, n : n + m] = np.eye(m)
        return A_D

    @property
    def T(self) -> Array:
        """𝔗 with x̄ = 𝔗 X̄ (eq. T), shape (n + n̂, n + 2n̂)."""
        return np.eye(self.n + self.n_hat, self.n + 2 * self.n_hat)

    @property
    def T_bar(self) -> Array:
        """𝔗̄ with X̄ = 𝔗̄ x̄ after an event (eq. Tb), shape (n + 2n̂, n + n̂)."""
        n, m = self.n, self.n_hat
        return np.vstack([np.eye(n + m), np.eye(m, n + m, n)])

    @property
    def T_t(self) -> Array:
        """𝔗_t with e_hp = 𝔗_t X̄, shape (n̂, n + 2n̂)."""
        n, m = self.n, self.n_hat
        return np.hstack([np.zeros((m, n)), -np.eye(m), np.eye(m)])

    @property
    def C_y(self) -> Array:
        """y = C_y X̄, shape (n_y, n + 2n̂)."""
        return np.hstack([self.actual.C, np.zeros((self.actual.n_y, 2 * self.n_hat))])

    @property
    def C_u(self) -> Array:
        """u = −k̂ x_h = C_u X̄, shape (n_u, n + 2n̂)."""
        return np.hstack([-self.k, np.zeros((self.actual.n_u, self.n_hat)), -self.design.k])

    @cached_property
    def lift(self) -> Array:
        """X̄ right after an event from the state w at the event: 𝔗̄, or the identity with a delay; shape (N, N_w)."""
        return np.eye(len(self.A_C)) if self.delay else self.T_bar

    @cached_property
    def exit(self) -> Array:
        """The state w at an event from X̄ just before it; shape (N_w, N)."""
        return np.eye(len(self.A_C)) if self.delay else self.T @ self.A_D

    @cached_property
    def entry(self) -> Array:
        """X̄ right after the action of an event from the state w at the event; shape (N, N_w)."""
        if not self.delay:
            return self.T_bar
        flown = exponential(self.A_C * self.delay.t_d)
        original = self.to_original(np.eye(len(self.A_C))).T  # (x, x_o, x_h) from X̄
        E_p = predictor(self.design, self.hold or system_matched(self.design), self.delay.predicted)
        flown[self.n + self.n_hat :] = E_p @ original[self.n :] - self.T_hat @ flown[: self.n]
        return np.asarray(flown)

    def phi(self, delta: float) -> Array:
        """φ(Δ) of the state at events, w_{i+1} = φ(Δ_i) w_i; shape (N_w, N_w), for Δ ≥ t_d.

        Without a delay w = x̄ and φ(Δ) = 𝔗 A_D e^{Ā_C Δ} 𝔗̄ (eq. pd). With a delay w = X̄ and
        φ(Δ) = e^{Ā_C (Δ − t_d)} R.
        """
        return np.asarray(self.exit @ exponential(self.A_C * (delta - self.delay.t_d)) @ self.entry)

    def start(self, w: Array) -> tuple[Array, Array, Array]:
        """(x, x_o, x_h) right after an event with the state w, shapes (n,), (n̂,), (n̂,)."""
        x, x_o, x_h = np.split(self.to_original(self.lift @ w), [self.n, self.n + self.n_hat])
        return x, x_o, x_h

    def to_original(self, X: Array) -> Array:
        """(x, x_o, x_h) from X̄ = (x, x̃_o, x̃_h); last axis is the state, shape (..., n + 2n̂)."""
        X = np.array(X, dtype=float)
        shift = X[..., : self.n] @ self.T_hat.T
        X[..., self.n : self.n + self.n_hat] += shift
        X[..., self.n + self.n_hat :] += shift
        return X

    def from_original(self, X: Array) -> Array:
        """X̄ = (x, x̃_o, x̃_h) from (x, x_o, x_h); last axis is the state, shape (..., n + 2n̂)."""
        X = np.array(X, dtype=float)
        shift = X[..., : self.n] @ self.T_hat.T
        X[..., self.n : self.n + self.n_hat] -= shift
        X[..., self.n + self.n_hat :] -= shift
        return X


def error_system(
    actual: LinearPlant,
    design: Design,
    hold: Hold | None = None,
    T_hat: Array | None = None,
    delay: Delay = NO_DELAY,
    match: Match = "name",
) -> ErrorSystem:
    """Build the error system of ``actual`` under ``design``.

    Args:
        actual: the actual plant [A, B, C].
        design: gains k̂, L and the assumed plant [Â, B̂, Ĉ].
        hold: the hold; the system-matched hold if ``None``.
        T_hat: T̂, shape (n̂, n); if ``None``, states of the same name are matched. The choice changes the
            coordinates, not the closed loop.
        delay: delay between an event and its action; by default there is none.
        match: how inputs and outputs of the two plants correspond: by name, and by position for plants without names
            (:func:`icmj.plant.linear_plant.match_ports`). Those of the system are in the order of the assumed plant.

    Raises:
        AnalysisError: if inputs and outputs of the two plants differ in number or name, or hold or T̂ does not fit.
    """
    assumed = design.plant
    actual = match_ports(actual, assumed, match)
    T_hat = transformation(assumed, actual) if T_hat is None else np.atleast_2d(real(T_hat, "T̂", AnalysisError))
    if T_hat.shape != (assumed.n, actual.n):
        raise AnalysisError(f"T̂ has shape {T_hat.shape}; expected {(assumed.n, actual.n)}")
    hold = hold or system_matched(design)
    # between events neither the trigger nor the delay matters
    loop = compose(actual, Controller(design, hold, ClockTrigger(1.0)), ERRORS, T_hat)
    return ErrorSystem(loop.F, T_hat, actual, design, hold, delay)


_TERMS = 18  # 1/19! = 8e-18: the Taylor series to rounding for ‖Ā_C t‖ ≤ 1
# With ‖Ā_C‖t beyond this the rounding of e^{Ā_C t} may reach 1e-6, and no eigenvalue can be placed on the circle
_STIFFEST = 1e-6 / np.finfo(float).eps


@dataclass(frozen=True, eq=False)
class Flow:
    """The flow X̄' = Ā_C X̄, prepared by :func:`flow`.

    Attributes:
        A_C: Ā_C, shape (N, N).
        balanced: S⁻¹ Ā_C S, shape (N, N).
        scale: diagonal of S, shape (N,).
        series: (S⁻¹ Ā_C S u)^k / k! for k = 1 … 18, shape (18, N, N).
        unit: u, the power of two next to ``reach``, so that no unit of time makes the powers overflow [s].
        reach: largest t of one Taylor series [s], where ‖S⁻¹ Ā_C S‖ t = 1.
    """

    A_C: Array
    balanced: Array
    scale: Array
    series: Array
    unit: float
    reach: float

    def increment(self, t: ArrayLike) -> Array:
        """F(t) = e^{Ā_C t} − I for each t ≥ 0, shape (..., N, N)."""
        t = np.asarray(t, dtype=float)
        flat = t.reshape(-1)
        doublings = self._doublings(flat.max(initial=0.0))
        F = self._short(flat / 2**doublings)
        for _ in range(doublings):
            F = 2 * F + F @ F
        return self._unbalance(F).reshape(*t.shape, *self.A_C.shape)

    def exponential(self, t: ArrayLike) -> Array:
        """e^{Ā_C t} for each t ≥ 0, shape (..., N, N)."""
        return self.increment(t) + np.eye(len(self.A_C))

    def trajectory(self, X: Array, end: float, points: int) -> tuple[Array, Array]:
        """e^{Ā_C t} X on a uniform grid of at least ``points`` + 1 times from 0 to ``end``.

        Args:
            X: a state, shape (N,), or several as columns, shape (N, c).
            end: last time [s].
            points: how many steps at least; the next power of two is taken.

        Returns:
            times, shape (M,), and states, shape (M, N) or (M, N, c).
        """
        levels = max(int(np.ceil(np.log2(max(points, 2)))), 1)
        states = X.reshape(1, len(X), -1)
        F = self.increment(end / 2**levels)
        for _ in range(levels):
            states = np.concatenate([states, states + F @ states])
            F = 2 * F + F @ F
        states = np.concatenate([states, states[:1] + F @ states[:1]])
        return np.linspace(0.0, end, 2**levels + 1), states.reshape(len(states), *X.shape)

    def polynomials(self, states: Array, h: float) -> Array:
        """Taylor coefficients of e^{Ā_C h s} X̄ in s ∈ [0, 1] from each state.

        Args:
            states: start states, shape (M, N).
            h: length of each cell [s]; at most ``reach``.

        Returns:
            coefficients by rising power, shape (19, M, N).

        Raises:
            AnalysisError: if ``h`` is longer than one series reaches.
        """
        if h > self.reach * (1 + 1e-12):
            raise AnalysisError(f"a Taylor cell of {h:.3g} s is longer than the series reaches, {self.reach:.3g} s")
        terms = [states / self.scale]
        step = (self.balanced * h).T
        for k in range(1, _TERMS + 1):
            terms.append(terms[-1] @ step / k)
        return np.array(terms) * self.scale

    def demand(self, t: float) -> None:
        """Check that e^{Ā_C t} is not dominated by rounding.

        Raises:
            AnalysisError: if it cannot, because the fastest rate of the system is out of proportion to ``t`` [s].
        """
        if t > _STIFFEST * self.reach:
            raise AnalysisError(
                f"not analysable: the fastest rate of the error system, {1 / self.reach:.1e}/s, is out of proportion "
                f"to a range of {t:.4g} s; look for gains or rates of the wrong size, or search a shorter range"
            )

    def _doublings(self, t: float) -> int:
        return max(0, int(np.ceil(np.log2(max(t / self.reach, 1.0)))))

    def _short(self, t: Array) -> Array:
        coefficients = (t / self.unit)[:, None] ** np.arange(1, _TERMS + 1)
        N = len(self.A_C)
        return (coefficients @ self.series.reshape(_TERMS, -1)).reshape(-1, N, N)

    def _unbalance(self, F: Array) -> Array:
        return F * self.scale[:, None] / self.scale


def flow(A_C: Array) -> Flow:
    """Prepare the flow of Ā_C.

    Raises:
        AnalysisError: if Ā_C is not a finite square matrix, or its norm is beyond all numbers.
    """
    A_C = np.asarray(A_C, dtype=float)
    if A_C.ndim != 2 or A_C.shape[0] != A_C.shape[1] or not np.isfinite(A_C).all():
        raise AnalysisError(f"not analysable: the matrix of a flow must be finite and square, got shape {A_C.shape}")
    balanced, scale = balance(A_C)
    norm = float(np.linalg.norm(balanced, 2)) or 1.0
    if not np.isfinite(norm):
        raise AnalysisError("not analysable: the rates of the error system are beyond all numbers; check the gains")
    unit = float(np.exp2(-np.clip(np.round(np.log2(norm)), -1000, 1000)))
    series = np.empty((_TERMS, *A_C.shape))
    power = np.eye(len(A_C))
    for k in range(_TERMS):
        power = power @ (balanced * unit) / (k + 1)
        series[k] = power
    return Flow(A_C, balanced, scale, series, unit, 1.0 / norm)


POINTS = 256
_HALVINGS = 4
_CLEAR = 0.3  # an eigenvalue is followed safely if it moves less than this part of the way to its neighbour
_NEGLIGIBLE = 1e-3  # moves below this are not worth a finer grid


@dataclass(frozen=True, eq=False)
class Locus:
    """Eigenvalues of φ(Δ) over a range of Δ, each branch followed continuously (panels (a) and (b)).

    Attributes:
        delta: Δ [s], shape (M,).
        eigenvalues: shape (M, n + n̂).
    """

    delta: Array
    eigenvalues: NDArray[np.complex128]

    @property
    def largest(self) -> Array:
        """Largest |λ| at each Δ, shape (M,)."""
        return np.abs(self.eigenvalues).max(axis=1)


def locus(system: ErrorSystem, delta_max: float, *, points: int = POINTS, prepared: Flow | None = None) -> Locus:
    """The eigenvalue branches on (t_d, ``delta_max``] at equal steps, followed on a finer grid where needed.

    Where φ grows beyond what numbers hold, the range ends before.

    Args:
        system: the error system.
        delta_max: end of the range [s].
        points: how many steps at least; the next power of two is taken.
        prepared: the flow of ``system``, if at hand.

    Raises:
        AnalysisError: if ``delta_max`` is not positive and finite, or so far off that not one step is computable.
    """
    if not (np.isfinite(delta_max) and delta_max > 0):
        raise AnalysisError(f"a locus needs a positive end, got {delta_max} s")
    t_d = system.delay.t_d
    if delta_max <= t_d:
        raise AnalysisError(f"no interval is shorter than the delay, {t_d:g} s; the locus must end beyond it")
    phi_t = prepared or flow(system.A_C)
    with np.errstate(over="ignore", invalid="ignore"):
        delta, states = phi_t.trajectory(system.entry, delta_max - t_d, points)
        phi = system.exit @ states[1:]
    # no further than numbers go
    beyond = np.flatnonzero(~np.isfinite(phi).all(axis=(1, 2)))
    points = int(beyond[0]) if len(beyond) else len(phi)
    if points == 0:
        raise AnalysisError(
            f"a locus up to {delta_max:g} s: φ is beyond all numbers from {delta[1]:g} s on; end it before"
        )
    delta, values = t_d + delta[1 : points + 1], np.linalg.eigvals(phi[:points]).astype(complex)
    wanted = np.ones(points, dtype=bool)
    check = np.arange(points - 1)  # steps not known to be clear yet
    for _ in range(_HALVINGS):
        unclear = check[_unclear(values[check], values[check + 1])]
        if not len(unclear):
            break
        middle = (delta[unclear] + delta[unclear + 1]) / 2
        delta = np.insert(delta, unclear + 1, middle)
        values = np.insert(values, unclear + 1, spectra(system, phi_t, middle), axis=0)
        wanted = np.insert(wanted, unclear + 1, False)
        moved = unclear + np.arange(len(unclear))
        check = np.column_stack([moved, moved + 1]).reshape(-1)
    return Locus(delta[wanted], follow(delta, values)[wanted])


def spectra(system: ErrorSystem, prepared: Flow, delta: Array) -> NDArray[np.complex128]:
    """Eigenvalues of φ(Δ) at each Δ, unordered, shape (M, n + n̂)."""
    phi = system.exit @ prepared.exponential(delta - system.delay.t_d) @ system.entry
    return np.linalg.eigvals(phi).astype(complex)


def follow(delta: Array, values: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Rows re-ordered so that each column is one branch.

    Where each eigenvalue has an unmistakable successor, that is it; elsewhere the assignment with the least total
    distance from a linear prediction. Where two branches meet (and leave the real axis), which is which afterwards
    is a convention.

    Args:
        delta: Δ, rising, shape (M,).
        values: eigenvalues in any order, shape (M, N).
    """
    order = np.arange(values.shape[1])
    ordered = values.copy()
    nearest, clear = _successors(values)
    for m in range(len(values) - 1):
        if clear[m]:
            order = nearest[m][order]
        else:
            here = ordered[m]
            ahead = here
            if m:
                ahead = here + (here - ordered[m - 1]) * ((delta[m + 1] - delta[m]) / (delta[m] - delta[m - 1]))
            order = _assign(np.abs(ahead[:, None] - values[m + 1]))
        ordered[m + 1] = values[m + 1, order]
    return ordered


def _assign(distance: Array) -> NDArray[np.intp]:
    """The column of each row, all different, with the least total distance."""
    nearest = distance.argmin(axis=1)
    if len(set(nearest.tolist())) == len(nearest):  # as each could not do better, neither could all
        return nearest
    from scipy.optimize import linear_sum_assignment

    return np.asarray(linear_sum_assignment(distance)[1])


def _successors(values: NDArray[np.complex128]) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
    """Nearest eigenvalue in the next row for each in this one, and whether all of them are unmistakable."""
    distance = np.abs(values[:-1, :, None] - values[1:, None, :])
    nearest = distance.argmin(axis=2)
    moved = distance.min(axis=2)
    onto = np.sort(nearest, axis=1)
    one_to_one = (onto == np.arange(values.shape[1])).all(axis=1)
    # two that pass through each other between two rows seem to stand still there: so the step before counts as well
    arrived = np.zeros_like(moved)
    arrived[1:] = distance[:-1].min(axis=1)
    far = np.maximum(moved, arrived) >= _CLEAR * _separation(values)[:-1]
    return nearest, one_to_one & ~far.any(axis=1)


def _unclear(before: NDArray[np.complex128], after: NDArray[np.complex128]) -> NDArray[np.bool_]:
    """Steps that a finer grid would make clearer: an eigenvalue of some size moves too far for its neighbours."""
    distance = np.abs(before[:, :, None] - after[:, None, :]).min(axis=2)
    far = (distance > _CLEAR * _separation(before)) & (distance > _NEGLIGIBLE)
    return np.asarray(far.any(axis=1))


def _separation(values: NDArray[np.complex128]) -> Array:
    """Distance of each eigenvalue to its nearest neighbour in the same row."""
    between = np.abs(values[:, :, None] - values[:, None, :])
    between += np.where(np.eye(values.shape[1], dtype=bool), np.inf, 0.0)
    return np.asarray(between.min(axis=2))
