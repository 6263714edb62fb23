"""Matrices that propagate the state and bound events and outputs (:mod:`icmj.linear.native.motion`).

All come from one series. With s = (z, f) and G its generator, of which f is a shift, rows c of z follow along a step

    c z(θ) = Σ_j c G^j/j! s θ^j

cut where nothing is left of it. The same series is split where a step is to be dismissed quickly: a short polynomial by
its control points, and a bound of the rest.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from itertools import accumulate
from math import comb, factorial

import numpy as np

from icmj.base.array import Array
from icmj.base.balancing import balance, compute_exponential
from icmj.base.bernstein import make_bernstein_matrix
from icmj.base.economisation import economise
from icmj.linear.loop import Forcing, LinearLoop
from icmj.linear.native.motion import Tables
from icmj.simulation.grid import list_lines
from icmj.simulation.sinusoids import count_nodes
from icmj.simulation.sources import Gaussian

_LONGEST_STEP = 1e3  # s
_MOST_TERMS = 60
_COARSE = 7  # degree of the polynomials that dismiss a step
_TURN = 1.6  # the loop's fastest eigenvalue times a step: what so short polynomials can bound
_SWING = 2.2  # the same for the fastest sinusoid
_NORM = 16.0  # ‖M h‖ of one step, for which there are terms enough
_PEAK = 24.0  # the largest term of a step's series of z, where z is one: what cancels costs a digit
_TICK = 1e-9  # relative: a delay this close to a multiple of the clock's interval is one
_NOTHING = 1e-18  # of the sum: a term that is left out
_PLACES = 8  # of rows within a step
_EIGHTHS = 8
_HARDLY = 1.25


def make_tables(
    loop: LinearLoop,
    acting: Forcing,
    duration: float,
    limits: Array,
    interval: float,
    shares: Sequence[Gaussian] = (),
) -> Tables:
    """All precomputed matrices of a run.

    Args:
        loop: the closed loop.
        acting: what acts on it from outside.
        duration: of the run [s].
        limits: the run has fallen when a position departs further than its own; infinite where it has none.
        interval: between two recorded rows [s]; infinite if none are asked for.
        shares: noises whose size is a share of the command, in the order of the loop's products.
    """
    M, m, controller = loop.M, loop.moving, loop.controller
    fastest, signals = float(acting.omega.max(initial=0.0)), acting.D.shape[1]
    h = _step(M, fastest)
    if signals:
        h = _round(h)
    drawn = [noise for _, noise in acting.gaussian]
    bends = min((noise.interval for noise in (*drawn, *shares)), default=np.inf)
    if np.isfinite(bends):  # straight lines bend where steps end
        h = bends / np.ceil(bends / h * (1 - 1e-9))
    grid = min((noise.interval for noise in drawn), default=np.inf)
    G, D = M * h, acting.D * h

    faces, limited = loop.composed.R[:, :m], np.flatnonzero(np.isfinite(limits))
    positions, outputs = np.zeros((len(limited), m)), np.zeros((loop.plant.n_y, m))
    positions[np.arange(len(limited)), loop.positions[limited]] = 1 / limits[limited]
    outputs[:, loop.composed.layout["x"]] = loop.plant.C

    size = bound_sizes(fastest * h) if signals else np.zeros(0)
    if np.isfinite(grid):
        size = np.maximum(np.pad(size, (0, max(2 - len(size), 0))), [1.0, 2 * h / grid] + [0.0] * (len(size) - 2))
    factorials = np.array([float(factorial(j)) for j in range(len(size))])
    # from derivatives about the middle to Taylor coefficients where the step begins
    middle = shift(len(size), signals, -0.5) / np.repeat(factorials, signals)
    step = _series(np.vstack([faces, positions, outputs]), G, D, size, _COARSE + 1)
    motion = _series(np.eye(m), G, D, size, 2)
    for series in (step, motion):
        series[:, :, m:] = series[:, :, m:] @ middle
    P = np.hstack([compute_exponential(G), motion[:, :, m:].sum(axis=0)])
    W, V = _bounds(step, P, len(faces), len(positions), m + signals * (_COARSE + 1))
    places, stride = _places(h / interval) if signals else (1, 1)
    Q = np.zeros((places, m, m))
    if np.isfinite(interval):
        for place in range(places):
            Q[place] = compute_exponential(M * (h * place / places if signals else interval))
    part = (np.arange(places) / max(places, 1))[:, None] ** np.arange(len(motion))
    weights = size * factorials
    curves = _economise(step, m, weights, signals)
    degree = len(curves) - 1
    ahead, back = _eighths(G, motion[:, :, m:]) if signals else (np.zeros((0, m, m)),) * 2
    near, *terms = _terms(motion, m, weights, signals, np.array([0.5, *range(1, _EIGHTHS + 1)]) / _EIGHTHS)
    return Tables(
        step=h,
        end=duration,
        interval=interval,
        clock=controller.trigger.clock,
        wait=controller.wait,
        sampling=controller.sampling_delay,
        delay=_round_delay(controller.delay.t_d, controller.trigger.clock),
        coarse=_COARSE,
        controls=(_COARSE + 1) * (len(faces) + len(outputs)),
        places=places,
        stride=stride,
        powers=len(size),
        M=np.hstack([G, D]),
        C=outputs,
        Q=Q,
        R=np.tensordot(part, motion[:, :, m:], 1),
        W=W,
        W_z=W[:, :m].T.copy(),
        V=V,
        A=np.ascontiguousarray(np.moveaxis(curves, 0, 1)),
        F=make_bernstein_matrix(degree),
        F2=make_bernstein_matrix(2 * degree),
        terms=np.array([0, *terms]),
        ahead=ahead,
        back=back,
        near=int(near),
        J=np.ascontiguousarray(loop.composed.J),
        G=np.ascontiguousarray(loop.composed.G),
        cuts=loop.composed.cuts.astype(np.int64),
        edges=np.append(acting.edges, np.inf),
        jumps=_jumps(acting),
        **_products(loop, shares, duration),
    )


def _products(loop: LinearLoop, shares: Sequence[Gaussian], duration: float) -> dict[str, Array]:
    """The parts of the tables that set products; no lines without any."""
    if not shares:
        return {"H": np.zeros((0, 0)), "points": np.zeros(0), "begins": np.zeros(0), "lines": np.zeros((0, 0, 2))}
    points, found = list_lines(shares, duration)
    return {"H": loop.held, "points": points, "begins": np.append(0.0, points[:-1]), "lines": found}


def _jumps(acting: Forcing) -> Array:
    """The jump of z by impulses at each edge, shape (edges, m); (0, 0) without any."""
    impulses = np.flatnonzero((acting.start == acting.end) & (acting.start > 0))
    if not len(impulses):
        return np.zeros((0, 0))
    jumps = np.zeros((len(acting.edges), len(acting.D)))
    at = np.searchsorted(acting.edges, acting.start[impulses])
    np.add.at(jumps, at, (acting.D[:, acting.input[impulses]] * acting.amplitude[impulses]).T)
    return jumps


def bound_sizes(turn: float) -> Array:
    """How large Taylor coefficients of a sinusoid of one can be, of one that turns by so much in a step [rad].

    There are as many as polynomials must have that agree with it on a step, to rounding.
    """
    return np.array([turn**j / factorial(j) for j in range(count_nodes(turn / 2))])


def _step(M: Array, fastest: float) -> float:
    """The longest step on which short polynomials can exclude events and the series does not cancel [s]."""
    balanced, _ = balance(M)
    norm = max(float(np.linalg.norm(balanced, 2)), 1e-300)
    mode = max(float(np.abs(np.linalg.eigvals(M)).max(initial=0.0)), 1e-300)
    h = min(_TURN / mode, _SWING / max(fastest, 1e-300), _NORM / norm, _LONGEST_STEP)
    while norm * h > 2 and _peak(balanced * h) > _PEAK:
        h /= 1.25
    return h


def _peak(G: Array) -> float:
    """The largest ‖G^j/j!‖."""
    term, largest, size, j = np.eye(len(G)), 1.0, 1.0, 0
    while size > 0.1 or j < 2:
        j += 1
        term = term @ G / j
        size = float(np.abs(term).sum(axis=1).max())
        largest = max(largest, size)
    return largest


def _round(h: float) -> float:
    """1, 2 or 5 times a power of ten, as rows and noise are given: the longest that is hardly longer [s]."""
    power = 10.0 ** np.floor(np.log10(_HARDLY * h))
    return float(max(k * power for k in (1, 2, 5) if k * power <= _HARDLY * h))


def _places(ratio: float) -> tuple[int, int]:
    """A step in intervals between rows as the quotient of two small numbers; (0, 1) where it is none."""
    for stride in range(1, 1 + _PLACES * 100):
        places = round(ratio * stride)
        if places > _PLACES:
            break
        if places and abs(ratio * stride / places - 1) < 1e-12:
            return places, stride
    return 0, 1


def _eighths(G: Array, forced: Array) -> tuple[Array, Array]:
    """``ahead`` and ``back`` of ``Tables``, with the series of what f adds to z, shape (terms, m, l − m)."""
    places = np.arange(_EIGHTHS + 1) / _EIGHTHS
    added = np.tensordot(places[:, None] ** np.arange(len(forced)), forced, 1)
    there, again = (
        np.array([np.eye(len(G)), *accumulate([compute_exponential(of)] * _EIGHTHS, np.matmul)])
        for of in (G / _EIGHTHS, -G / _EIGHTHS)
    )
    return np.concatenate([there, added], axis=2), np.concatenate([again, -again @ added], axis=2)


def _terms(series: Array, m: int, size: Array, signals: int, until: Array) -> np.ndarray:
    """How many terms of z's series there are to be until each of these parts of a step."""
    weight = np.repeat(size, signals)
    parts = _sizes(series, m, weight, signals)
    order, terms = np.arange(len(series))[:, None, None], []
    for part in until:
        here = parts * part**order
        counts = np.flatnonzero((here > _NOTHING * here.sum(axis=0)).any(axis=(1, 2)))
        terms.append(int(counts.max(initial=0)) + 1)
    return np.minimum(terms, len(series) - 1)


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
        term = z @ G / len(terms)
        if signals:
            term = np.hstack([term, z @ D / len(terms), f[:, : f.shape[1] - signals] * rise / len(terms)])
        terms.append(term)
        here = _sizes(term, m, weight, signals)
        small = small + 1 if np.all(here <= _NOTHING * total) and len(terms) > least else 0
        total = total + here
    return np.array(terms)


def _economise(series: Array, m: int, size: Array, signals: int) -> Array:
    """The same curves on a step by fewer powers: what is changed is as little as what the series leaves out."""
    weight, highest = np.repeat(size, signals), len(series) - 1
    parts = _sizes(series, m, weight, signals).reshape(len(series), -1)
    enough = np.flatnonzero(np.all(_errors(highest) @ parts <= _NOTHING * parts.sum(axis=0), axis=1))
    if not len(enough):
        return series
    degree = _COARSE + int(enough[0])
    to, _ = economise(degree, highest)
    return np.asarray(series[: degree + 1] + np.tensordot(to, series[degree + 1 :], 1))


@lru_cache(maxsize=64)
def _errors(highest: int) -> Array:
    """Of each power, as a polynomial of degree ``_COARSE`` or of a higher one, shape (…, highest + 1)."""
    degrees = range(_COARSE, highest)
    return np.array([np.pad(economise(degree, highest)[1], (degree + 1, 0)) for degree in degrees])


def _sizes(terms: Array, m: int, weight: Array, signals: int) -> Array:
    """Entry by entry for z, hence in any scaling of the states; signal by signal for f; of one term or of several."""
    if not signals:
        return np.abs(terms)
    of_f = (np.abs(terms[..., m:]) * weight).reshape(*terms.shape[:-1], -1, signals).sum(axis=-2)
    return np.concatenate([np.abs(terms[..., :m]), of_f], axis=-1)


def _bounds(step: Array, P: Array, r: int, limited: int, until: int) -> tuple[Array, Array]:
    """W and V from the series of faces, positions and outputs; see ``Tables``.

    What acts with a power beyond the short polynomials' goes into the bounds alone: entries of s from ``until`` on.
    """
    faces, positions, outputs = np.split(step, [r, r + limited], axis=1)
    curves, n_y = np.concatenate([outputs, faces], axis=1), outputs.shape[1]
    controls = np.einsum("ij,jrm->rim", make_bernstein_matrix(_COARSE), curves[: _COARSE + 1]).reshape(
        -1, step.shape[2]
    )
    left, order = np.abs(curves), np.arange(len(step), dtype=float)
    left[: _COARSE + 1, :, :until] = controls[:, until:] = 0
    V = [np.abs(positions[1:]).sum(axis=0), np.einsum("j,jrm->rm", order, left[:, :n_y]), left[:, n_y:].sum(axis=0)]
    return np.vstack([P, positions[0], controls]), np.vstack(V)


@lru_cache(maxsize=256)
def shift(powers: int, signals: int, by: float) -> Array:
    """The matrix that shifts the expansion point of the polynomials f by ``by`` steps."""
    shift = np.array([[comb(j, i) * by ** (j - i) if j >= i else 0.0 for j in range(powers)] for i in range(powers)])
    return np.kron(shift.reshape(powers, powers), np.eye(signals))


def _round_delay(delay: float, clock: float) -> float:
    """The delay, exactly a multiple of the clock's interval where it is nearly one."""
    number = round(delay / clock) if np.isfinite(clock) else 0
    return number * clock if number and abs(delay / clock - number) < _TICK * number else delay
