"""The matrices by which the compiled simulation moves, watches and bounds the state (:mod:`icmj.linear.native.state`).

All come from one series. With s = (z, f) and G its generator, of which f is a shift, rows c of z follow along a step

    c z(θ) = Σ_j c G^j/j! s θ^j

cut where nothing is left of it. Over a span of several steps the same series, in its units, is split: a short
polynomial by its control points, and a bound of the rest.
"""

from __future__ import annotations

from functools import lru_cache
from math import comb, factorial

import numpy as np

from icmj.base.array import Array
from icmj.base.bernstein import from_powers
from icmj.linear.exponential import exponential
from icmj.linear.loop import Forcing, LinearLoop
from icmj.linear.native.state import Tables

_STEP_NORM = 2.0  # ‖M h‖ of one step: the terms of its series stay below 2, so nothing cancels
_LONGEST_STEP = 1e3  # s
_MOST_TERMS = 60
_COARSE = 7  # degree of the polynomials that dismiss a span
_TURN = 1.6  # the loop's fastest eigenvalue times a span: what so short polynomials can bound
_SWING = 2.0  # the same for the fastest sinusoid
_LONGEST_SPAN = 8  # steps
_TICK = 1e-9  # relative: a delay this close to a multiple of the clock's interval is one
_NOTHING = 1e-18  # of the sum: a term that is left out


def tables(loop: LinearLoop, acting: Forcing, duration: float, limits: Array, interval: float) -> Tables:
    """Everything that a run needs besides its state.

    Args:
        loop: the closed loop.
        acting: what acts on it from outside.
        duration: of the run [s].
        limits: the run has fallen when a position departs further than its own; infinite where it has none.
        interval: between two recorded rows [s]; infinite if none are asked for.
    """
    from scipy.linalg import matrix_balance

    M, m, controller = loop.M, loop.moving, loop.controller
    fastest = float(acting.omega.max(initial=0.0))
    balanced = matrix_balance(M, permute=False)[0]
    norm = max(float(np.linalg.norm(balanced, 2)), fastest, 1e-300)
    h = min(_STEP_NORM / norm, _LONGEST_STEP)
    mode = float(np.abs(np.linalg.eigvals(M)).max(initial=0.0)) * h
    q = int(np.clip(min(_TURN / max(mode, 1e-300), _SWING / max(fastest * h, 1e-300)), 1, _LONGEST_SPAN))
    signals = acting.D.shape[1]
    p = _degree(fastest * h * q / 2) if signals else -1
    G, D = M * h, acting.D * h

    faces, limited = loop.composed.R[:, :m], np.flatnonzero(np.isfinite(limits))
    positions, outputs = np.zeros((len(limited), m)), np.zeros((loop.plant.n_y, m))
    positions[np.arange(len(limited)), loop.positions[limited]] = 1 / limits[limited]
    outputs[:, loop.composed.layout["x"]] = loop.plant.C
    rows = np.vstack([faces, positions, outputs])

    size = np.array([(fastest * h) ** j / factorial(j) for j in range(p + 1)])
    step = _series(rows, G, D, size, 2)
    P = exponential(G)
    if signals:
        P = np.hstack([P, _series(np.eye(m), G, D, size, 2)[:, :, m:].sum(axis=0)])
    W, V = _span(G, D, P, faces, positions, outputs, size, q)
    degree = len(step) - 1
    ticks = _ticks(controller.delay.t_d, controller.trigger.clock)
    j = np.arange(p + 1)
    sign = np.where((j + 1) // 2 % 2 == 0, 1.0, -1.0)  # cos, −sin, −cos, sin
    share = (sign / np.array([float(factorial(i)) for i in j]))[:, None] * (acting.omega * h) ** j[:, None]
    angle = acting.omega * (q * h)
    return Tables(
        step=h,
        end=duration,
        interval=interval,
        clock=controller.trigger.clock,
        least=controller.least,
        delay=controller.delay.t_d,
        ticks=ticks,
        steps=q,
        coarse=_COARSE,
        P=P,
        M=np.ascontiguousarray(G),
        D=np.ascontiguousarray(D),
        Q=exponential(M * interval) if np.isfinite(interval) and not signals else np.zeros((m, m)),
        W=W,
        V=V,
        A=np.ascontiguousarray(np.moveaxis(step, 0, 1)),
        F=from_powers(degree),
        F2=from_powers(2 * degree),
        J=np.ascontiguousarray(loop.composed.J),
        G=np.ascontiguousarray(loop.composed.G),
        cuts=loop.composed.cuts.astype(np.int64),
        edges=np.append(acting.edges, np.inf),
        ranges=np.searchsorted(acting.signal, np.arange(signals + 1)),
        omega=acting.omega,
        phase=acting.phase,
        first=acting.start,
        last=acting.end,
        share=share * acting.amplitude,
        turn=np.array([np.cos(angle), np.sin(angle)]),
    )


def _degree(turn: float) -> int:
    """Of Taylor polynomials of sinusoids that turn by at most this on either side [rad]."""
    return next(p for p in range(_MOST_TERMS) if turn ** (p + 1) / factorial(p + 1) <= 1e-17)


def _series(rows: Array, G: Array, D: Array, size: Array, least: int) -> Array:
    """c G^j/j! of rows c of z, on s; cut after two terms of which nothing is left; shape (terms, rows, l).

    ``size`` says how large the coefficients of f can be, in units of a signal; there are ``least`` terms or more.
    """
    m, signals = D.shape
    weight = np.repeat(size, signals).reshape(len(size) * signals)
    rise = np.repeat(np.arange(1, len(size)), signals)
    term = np.hstack([rows, np.zeros((len(rows), len(weight)))])
    terms, total, small = [term], _sizes(term, m, weight, signals), 0
    while small < 2 and len(terms) < _MOST_TERMS:
        z, f = term[:, :m], term[:, m:]
        following = np.hstack([z @ D, f[:, : f.shape[1] - signals] * rise]) if signals else f
        term = np.hstack([z @ G, following]) / len(terms)
        terms.append(term)
        here = _sizes(term, m, weight, signals)
        small = small + 1 if np.all(here <= _NOTHING * total) and len(terms) > least else 0
        total = total + here
    return np.array(terms)


def _sizes(term: Array, m: int, weight: Array, signals: int) -> Array:
    """Entry by entry for z, hence in any scaling of the states; signal by signal for f."""
    if not signals:
        return np.abs(term)
    of_f = (np.abs(term[:, m:]) * weight).reshape(len(term), -1, signals).sum(axis=1)
    return np.hstack([np.abs(term[:, :m]), of_f])


def _span(
    G: Array, D: Array, P: Array, faces: Array, positions: Array, outputs: Array, size: Array, q: int
) -> tuple[Array, Array]:
    """W and V of spans of ``q`` steps; see :class:`icmj.linear.native.state.Tables`."""
    m, r, signals = len(G), len(faces), D.shape[1]
    curves = np.vstack([faces, outputs])
    stretch = np.repeat(float(q) ** np.arange(len(size)), signals)
    series = _series(np.vstack([curves, positions]), G * q, D * q, size * float(q) ** np.arange(len(size)), _COARSE + 1)
    series[:, :, m:] *= stretch
    forward = _shift(len(size), signals, -q / 2)
    series[:, :, m:] = series[:, :, m:] @ forward
    moved = [exponential(G * q), np.zeros((m, len(stretch)))]
    one, P_f = np.eye(m), P[:, m:]
    for k in range(q - 1, -1, -1):
        moved[1] = moved[1] + one @ P_f @ _shift(len(size), signals, k - q / 2)
        one = one @ P[:, :m]
    short = series[: _COARSE + 1, : len(curves)]
    controls = np.einsum("ij,jrm->rim", from_powers(_COARSE), short).reshape(-1, series.shape[2])
    left = np.abs(series[_COARSE + 1 :])
    order = np.arange(_COARSE + 1, len(series), dtype=float)
    V = np.vstack(
        [
            left[:, :r].sum(axis=0),
            np.einsum("j,jrm->rm", order, left[:, r : len(curves)]),
            np.abs(series[1:, len(curves) :]).sum(axis=0),
        ]
    )
    W = np.vstack([np.hstack(moved), controls, np.hstack([positions, np.zeros((len(positions), len(stretch)))])])
    W[m + len(controls) :] = series[0, len(curves) :]
    return W, V


@lru_cache(maxsize=256)
def _shift(powers: int, signals: int, by: float) -> Array:
    """Takes f about a place to f about one ``by`` steps further on."""
    shift = np.array([[comb(j, i) * by ** (j - i) if j >= i else 0.0 for j in range(powers)] for i in range(powers)])
    return np.kron(shift.reshape(powers, powers), np.eye(signals))


def _ticks(delay: float, clock: float) -> int:
    """The delay in intervals of the clock where it is a multiple of that, else −1."""
    number = round(delay / clock) if np.isfinite(clock) else 0
    return number if number and abs(delay / clock - number) < _TICK * number else -1
