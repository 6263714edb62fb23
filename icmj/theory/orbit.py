"""The periodic orbit that the linear theory predicts (paper, sections 3.3 and 3.4), with its admissibility."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from icmj.base.array import Array, argmax_abs
from icmj.base.bernstein import find_maxima
from icmj.controller.trigger import EventRule, Faces
from icmj.errors import AnalysisError
from icmj.theory.error_system import ErrorSystem
from icmj.theory.flow import Flow, make_flow
from icmj.theory.reduction import Reduction, reduce_system

SAMPLES = 256
# E closer to zero than this (relative to the squared threshold) counts as reached: a rule in floating point would fire
TOUCH = 1e-12
# faces whose E at the event are closer to each other than this (relative to the squared threshold) are reached together
TIE = 1e-9
# a stiff system has so many Taylor cells that its motion no longer fits into half a gigabyte: cells times states
_MOST_CELLS = 5_000_000
# polynomials are made for a part of the cells at a time (cells times states), so that they take tens of megabytes
_CELLS_AT_ONCE = 100_000
EXTENTS = ("y_peak", "u_peak", "x_peak", "y_range", "u_range", "x_range")


@dataclass(frozen=True, eq=False)
class Orbit:
    """The periodic orbit that the linear theory predicts, over one interval; mirrored in the next if ``sign`` is −1.

    Attributes:
        delta: open-loop interval Δ_crit [s].
        sign: eigenvalue there, +1 (period Δ_crit) or −1 (period 2Δ_crit, mirrored halves).
        period: of the whole orbit [s].
        gamma: γ = q_t/e_0 for the eigenvector of unit norm and largest entry positive; so the length of x̄, which
            depends on T̂ and on the units of the states, as nothing else here but x_bar and X does.
        x_bar: the state at an event, γ V_{k1}: x̄, shape (n + n̂,); with a delay X̄, shape (n + 2n̂,).
        t: times in [0, delta] [s], shape (M,); with a delay t_d occurs twice, before and after the action.
        X: X̄(t) = (x, x̃_o, x̃_h), shape (M, n + 2n̂).
        y, u, e_hp: outputs, inputs and hold error, shapes (M, n_y), (M, n_u), (M, n̂).
        E: event function, shape (M,); negative until delta if the orbit is admissible.
        y_peak, u_peak, x_peak: largest magnitude over the whole orbit; NaN where a neutral mode shows, because any
            constant may be added there.
        y_range, u_range, x_range: peak to peak over the whole orbit; NaN where it drifts.
        admissible: no earlier event, and delta > Δ_min.
        reason: why not admissible, or empty.
        drift: φ x̄ ∓ x̄, how far a neutral mode moves x̄ in one interval, shape (n + n̂,); zero without such modes.
    """

    delta: float
    sign: int
    period: float
    gamma: float
    x_bar: Array
    t: Array
    X: Array
    y: Array
    u: Array
    e_hp: Array
    E: Array
    y_peak: Array
    u_peak: Array
    x_peak: Array
    y_range: Array
    u_range: Array
    x_range: Array
    admissible: bool
    reason: str
    drift: Array | None = None


def compute_critical_vectors(phi: Array, sign: int, count: int = 1) -> Array:
    """V_{k₁}: eigenvectors of φ at the eigenvalue ``sign``, unit norm, largest entry positive, shape (n + n̂, count).

    The null vectors of φ ∓ I from its singular values; sound also where V as a whole has no usable inverse. Several
    are made as sparse as can be: each has a row of its own in which the others are zero.
    """
    V = np.linalg.svd(phi - sign * np.eye(len(phi)))[2][-count:].T
    if count > 1:
        from scipy.linalg import qr

        own = qr(V.T, pivoting=True, mode="r")[1][:count]
        V = V @ np.linalg.inv(V[own])
        V /= np.linalg.norm(V, axis=0)
    return np.asarray(V * np.array([np.sign(v[argmax_abs(v)]) for v in V.T]))


def compute_orbit(
    system: ErrorSystem,
    trigger: EventRule,
    delta: float,
    sign: int,
    *,
    prepared: Flow | None = None,
    reduced: Reduction | None = None,
    vector: Array | None = None,
) -> Orbit:
    """The orbit at Δ = ``delta`` where φ has the eigenvalue ``sign``.

    Args:
        system: the error system.
        trigger: the event rule, with its Δ_min.
        delta: open-loop interval Δ_crit [s].
        sign: +1, or −1 for mirrored halves.
        prepared: the flow of ``system``, if at hand.
        reduced: the system without its neutral directions, if at hand.
        vector: which eigenvector of φ_r, where there is more than one, shape (m,).

    Returns:
        the orbit; where Q_t does not see it (e_0 = 0) its γ is infinite, its time courses are those of γ = 1,
        its peaks are infinite, and it is not admissible.

    Raises:
        AnalysisError: if sign is not ±1, ``delta`` is not positive, Q_t does not fit, or the system is so stiff that
            its motion over one interval cannot be held in memory.
    """
    if sign not in (1, -1):
        raise AnalysisError(f"an orbit has the eigenvalue +1 or −1, got {sign}")
    if not (np.isfinite(delta) and delta > 0):
        raise AnalysisError(f"an orbit's interval must be positive, got {delta}")
    faces = trigger.faces(system.design)
    phi_t = prepared or make_flow(system.A_C)
    reduced = reduced or reduce_system(system, phi_t)
    t_d = system.delay.t_d
    if not delta > t_d:
        raise AnalysisError(f"an orbit's interval must be longer than the delay, {t_d:g} s; got {delta}")
    phi = system.exit @ phi_t.exponential(delta - t_d) @ system.entry
    if vector is None:
        vector = compute_critical_vectors(reduced.phi(delta), sign)[:, 0]
    v, drift = _start(reduced, phi, sign, vector)
    # cells short enough for one Taylor series each, so that every signal is a polynomial between grid points
    points = max(SAMPLES, int(np.ceil(delta / phi_t.reach)))
    cells = 2 ** int(np.ceil(np.log2(points))) * (2 if t_d else 1)
    if cells * len(phi_t.A_C) > _MOST_CELLS:
        raise AnalysisError(
            f"not analysable: the orbit of {delta:.4g} s would need {cells} Taylor cells; the fastest mode of the "
            "error system is out of proportion"
        )
    t, X = phi_t.trajectory(system.entry @ v, delta - t_d, points)
    waiting, X_waiting = phi_t.trajectory(system.lift @ v, t_d, points) if t_d else (t[:0], X[:0])
    reached, gamma = _find_end(faces, system, X)
    unseen = not np.isfinite(gamma)
    factor = 1.0 if unseen else gamma
    X, X_waiting = X * factor, X_waiting * factor
    rows = np.concatenate([system.C_y, system.C_u, np.eye(system.n, len(system.A_C))])
    highest, watched = np.full(2 * len(rows), -np.inf), []
    if t_d:
        # until the action, events are not watched; outputs may peak there all the same
        for polynomials in _polynomials(phi_t, X_waiting, waiting[1]):
            highest = np.maximum(highest, _highest(polynomials, rows))
    for polynomials in _polynomials(phi_t, X, t[1]):
        highest = np.maximum(highest, _highest(polynomials, rows))
        watched.append(faces.polynomials(polynomials @ (faces.R @ system.T_t).T))
    X = np.concatenate([X_waiting, X])
    up, down = np.split(highest, 2)
    peak = np.maximum(up, down)
    spread = up + down if sign > 0 else 2 * peak
    if reduced.dropped.shape[1]:
        after = rows @ system.T_bar
        peak = np.where(reduced.shown_by(after), np.nan, peak)
        drifts = np.abs(after @ drift) * factor > 1e-9 * (np.abs(after) @ np.abs(v) * factor + spread)
        spread = np.where(drifts, np.nan, spread)
    if unseen:
        peak, spread = np.full_like(peak, np.inf), np.full_like(spread, np.inf)
        reason = "the event rule does not detect this orbit, whose event error is zero at the event (e_0 = 0)"
    else:
        reason = _obstacle(np.concatenate(watched, axis=1), reached, trigger.delta_min, t, t_d)
    cuts = np.cumsum([system.actual.n_y, system.actual.n_u])
    sizes = zip(EXTENTS, (*np.split(peak, cuts), *np.split(spread, cuts)), strict=True)
    return Orbit(
        delta=float(delta),
        sign=int(sign),
        period=float(delta if sign > 0 else 2 * delta),
        gamma=float(gamma),
        x_bar=v * factor,
        t=np.concatenate([waiting, t_d + t]),
        X=X,
        y=X @ system.C_y.T,
        u=X @ system.C_u.T,
        e_hp=X @ system.T_t.T,
        E=faces.E(X @ system.T_t.T),
        **dict(sizes),
        admissible=not reason,
        reason=reason,
        drift=drift * factor,
    )


def _start(reduced: Reduction, phi: Array, sign: int, vector: Array) -> tuple[Array, Array]:
    """The state right after an event on the orbit, of unit norm, and how far one interval carries it away."""
    v = reduced.complete(vector, phi, sign)
    v = v * (np.sign(v[argmax_abs(v)]) / np.linalg.norm(v))
    return v, phi @ v - sign * v if reduced.modes else np.zeros(len(v))


def _find_end(faces: Faces, system: ErrorSystem, X: Array) -> tuple[NDArray[np.intp], float]:
    """The faces that the motion ends on, and γ, the factor that puts its end there; infinite where no face sees it.

    Relative to the largest values on the way what is seen must not be rounding.
    """
    squares = faces.squares(X @ system.T_t.T @ faces.R.T)
    seen = float(squares[-1].max())
    scale = float((np.abs(X) @ np.abs(faces.R @ system.T_t).T).max()) ** 2
    return find_ties(squares[-1]), 1 / np.sqrt(seen) if seen > 1e-20 * scale else np.inf


def find_ties(squares: Array) -> NDArray[np.intp]:
    """The faces that are reached together, the first of the largest |R_j e|² first."""
    tied = np.flatnonzero(squares >= (1 - TIE) * squares.max())
    return tied[np.argsort(-squares[tied], kind="stable")]


def _polynomials(prepared: Flow, X: Array, h: float) -> Iterator[Array]:
    """The cells between the states ``X`` as polynomials, a part of the cells at a time, each shape (19, cells, N)."""
    at_once = max(1, _CELLS_AT_ONCE // X.shape[1])
    for first in range(0, len(X) - 1, at_once):
        yield prepared.polynomials(X[first : min(first + at_once, len(X) - 1)], h)


def _highest(polynomials: Array, rows: Array) -> Array:
    """Highest value of each row, then of each row's negative, shape (2 rows,)."""
    signals = polynomials @ rows.T
    return find_maxima(np.concatenate([signals, -signals], axis=2)).value


def _obstacle(levels: Array, reached: NDArray[np.intp], delta_min: float, t: Array, t_d: float) -> str:
    """Why the orbit is not admissible; empty if E < 0 on [Δ_min, Δ) and E rises through zero at Δ.

    Args:
        levels: E_j in each cell as power coefficients, shape (2d + 1, cells, F).
        reached: the faces that are reached at Δ.
        delta_min: Δ_min [s].
        t: ends of the cells, counted from the action; the last is Δ − t_d [s]; shape (cells + 1,).
        t_d: delay [s].
    """
    if not t_d + t[-1] > delta_min:
        return f"Δ_crit = {t_d + t[-1]:.6g} s is not longer than Δ_min = {delta_min:.6g} s"
    h, delta_min = t[1], max(delta_min - t_d, 0.0)
    first = min(int(delta_min / h), len(t) - 2)
    cut = delta_min / h - first
    cells = levels[:, first:].copy()
    for j in range(cells.shape[2]):
        cells[:, 0, j] = _tail(cells[:, 0, j], cut)
    # in the last cell the zero of E_j at Δ itself is divided out: E_j = (s − 1) D, and E_j < 0 there means D > 0
    last = np.column_stack([-_deflate(levels[:, -1, j]) for j in reached])
    if first == len(t) - 2:
        last = np.column_stack([_tail(p, cut) for p in last.T])
    if last.sum(axis=0).max() >= -TOUCH:
        return "E does not rise through zero at Δ_crit: the event there is a graze, or comes from above"
    for j in range(cells.shape[2]):
        watched = cells[:, :-1, j] if j in reached else cells[:, :, j]
        if not watched.shape[1]:
            continue
        highest = find_maxima(watched[:, :, None])
        if highest.value[0] >= -TOUCH:
            cell = int(highest.cell[0])
            s = highest.s[0] if cell else cut + (1 - cut) * highest.s[0]
            return _earlier(t_d + (first + cell + s) * h, highest.value[0])
    in_last = find_maxima(last[:, None, :])
    if in_last.value.max() >= 0:
        return _earlier(t_d + (len(t) - 2 + in_last.s[in_last.value.argmax()]) * h, 0.0)
    return ""


def _earlier(tau: float, height: float) -> str:
    reached = f"E reaches {height:.3g} times the threshold squared at τ = {tau:.6g} s"
    return f"the event function is not negative before Δ_crit: {reached}"


def _deflate(p: Array) -> Array:
    """Quotient of p by (s − 1), by synthetic division; the remainder (p(1), rounding at an event) is dropped."""
    return np.cumsum(p[::-1])[:-1][::-1]


def _tail(p: Array, cut: float) -> Array:
    """p on [cut, 1], as a polynomial on [0, 1]."""
    shifted = np.polynomial.polynomial.Polynomial(p)(np.polynomial.polynomial.Polynomial([cut, 1 - cut]))
    q = np.zeros_like(p)
    q[: len(shifted.coef)] = shifted.coef
    return q
