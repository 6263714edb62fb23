"""A controller as data for compiled code, with the history of what it reads later.

Before t = 0 it has read what there is at the start, held. Time within a stretch is counted from its begin, in units of
:attr:`Taps.unit`; polynomials are rows of p + 1 coefficients in it.
"""

from __future__ import annotations

from math import floor
from typing import NamedTuple

import numpy as np

from icmj.base.array import Array
from icmj.base.bernstein import make_bernstein_matrix
from icmj.base.roots import DEEPEST
from icmj.controller.realisation import Realisation
from icmj.errors import SimulationError
from icmj.simulation.disturbance import Acting, Disturbance
from icmj.simulation.grid import count_points, draw_at_points
from icmj.simulation.native.loop import ACTED, EDGE, PLANNED, SIGNAL, TICK
from icmj.simulation.native.taps import SMOOTH
from icmj.simulation.native.waves import Waves

POWERS = 21  # p + 1: what they leave out of a motion that turns by up to 1.5 rad in a unit of time is below rounding
ROUGH = 12  # levels from here on are smooth to rounding: what jumps has thirteen integrals by then
ROUGH_ON_ENGINE = 7  # what jumps there is a derivative beyond those that its methods and polynomials follow
FASTEST = 1e13  # rad/s; beyond, a stretch is no more than rounding of the time
_NODES = 13
ROOM = 5e8  # bytes of what a controller remembers of its readings
_QUEUE = 64  # actions that may be due beside those of a clock
_BEGINNING = -1e30  # of the history that is held before t = 0


class Taps(NamedTuple):
    """The controller's numbers for compiled code, with N_w = n_v + N_a.

    Attributes:
        unit: of time [s], and the longest stretch.
        direct: number of readings that are the current outputs: n_y or 0, the first of v.
        tau: the delayed taps [s], shape (T,).
        M, N, K, S: of the modes, shapes (modes, N_a, N_a), (modes, N_a, n_v), (modes, n_u, N_a), (modes, n_u, n_v).
        Q, c: of the guards, shapes (G, N_w, N_w) and (G,).
        used: whether a guard takes up a component of w, shape (N_w,).
        table: the mode that follows by mode and signs, shape (modes, 2^G).
        R, cuts: of the event rule, as in :class:`icmj.controller.realisation.Realisation`.
        watched, after: by mode, as there.
        J, jump: maps of an event, or of the period; and of an action (G there), shapes (N_a, N_a).
        wait, delay, clock, sampling, period: as there [s].
        signals: what enters through the last columns of N.
        edges: where one begins, ends or jumps, rising, then infinity.
        F: to Bernstein coefficients of a guard, degree 2p.
        rough: level from which on an instant counts as smooth.
        exact: whether what is remembered are Taylor series, else polynomials through values at nodes.
        nodes, fit: nodes on (−1, 1), rising, and the matrix from values at them to coefficients; else empty.
    """

    unit: float
    direct: int
    tau: Array
    M: Array
    N: Array
    K: Array
    S: Array
    Q: Array
    c: Array
    used: np.ndarray
    table: np.ndarray
    R: Array
    cuts: np.ndarray
    watched: np.ndarray
    after: np.ndarray
    J: Array
    jump: Array
    wait: float
    delay: float
    clock: float
    sampling: float
    period: float
    signals: Waves
    edges: Array
    F: Array
    rough: int
    exact: bool
    nodes: Array
    fit: Array


class History(NamedTuple):
    """The readings so far, one entry for each stretch.

    Attributes:
        start: where each stretch begins [s], shape (capacity,).
        level: of that instant, see :mod:`icmj.simulation.native.taps`.
        r: polynomials of the outputs as they are read, and of commands if they are read; shape (capacity, n_r, p + 1).
        count: of stretches, shape (1,); the last one goes on to the present.
        at: the stretch that each tap reads, shape (T,).
        ahead: the next one after it that begins roughly, as far as has been looked, shape (T,).
    """

    start: Array
    level: np.ndarray
    r: Array
    count: np.ndarray  # type: ignore[assignment]
    at: np.ndarray
    ahead: np.ndarray


class ControllerState(NamedTuple):
    """The present state of the controller, and work arrays.

    Attributes:
        mode: the present one, and that of the last stretch that was longer than nothing, shape (2,).
        sign: whether each guard is positive, shape (G,).
        roots: where on the stretch each changes its sign first, in units of time, shape (G,).
        a: state, shape (N_a,).
        met: by number, shape (7,), which guard, or face of the rule (numbered behind them), is met within 1e-12 s of
            where the last stretch ended for another reason, −1 for none (``MEETS``); which ended it, −1 for none
            (``ENDS``); how many stretches in a row have ended soon in a switch (``SWITCHES``); whether the plant has
            fallen (``FALLS``); whether the last stretch was longer than nothing (``MOVES``); whether the mode has
            changed at its end (``TURNS``); and whether what is read of earlier lets the command jump or bend where the
            present one begins (``READS``).
        level: of what begins now, see :mod:`icmj.simulation.native.taps`; shape (1,).
        due, when, queue: what is planned, see :mod:`icmj.simulation.native.loop`; shapes (6,), (3,), (capacity,).
        v, A, u: readings, state and command on the stretch under way, shapes (n_v, p + 1), (N_a, p + 1), (n_u, p + 1).
        last: command at the end of the stretch before, shape (n_u,).
        after: room for a state, shape (N_a,).
        values: at nodes, shape (nodes, n_r + n_y + N_a).
        reach: how far each component of w may move on the stretch, shape (N_w,).
        g: of a guard.
        stack, spans: see :mod:`icmj.base.roots`.
    """

    mode: np.ndarray
    sign: np.ndarray
    roots: Array
    a: Array
    met: np.ndarray
    level: np.ndarray
    due: np.ndarray
    when: Array
    queue: Array
    v: Array
    A: Array
    u: Array
    last: Array
    after: Array
    values: Array
    reach: Array
    g: Array
    stack: Array
    spans: Array


def make_taps(realisation: Realisation, n_y: int, rate: float, *, exact: bool) -> Taps:
    """The controller of a loop of ``n_y`` outputs whose fastest rate is ``rate`` [rad/s], with what disturbs it.

    Its unit of time is 1/``rate`` [s] at most.

    Raises:
        SimulationError: if that is too fast for instants to be told apart.
    """
    if not rate < FASTEST:
        raise SimulationError(
            f"the loop has rates of {rate:.3g} rad/s; up to {FASTEST:g} rad/s can be simulated, so look for a gain or "
            "a unit that is too large"
        )
    modes, guards = realisation.modes, realisation.guards
    n_v, n_u, size = modes[0].S.shape[1], modes[0].S.shape[0], realisation.layout.size
    M, N, K, S = (np.ascontiguousarray([getattr(mode, letter) for mode in modes], dtype=float) for letter in "MNKS")
    number = 0 if exact else _NODES
    nodes = -np.cos(np.pi * (np.arange(number) + 0.5) / max(number, 1))
    fit = np.linalg.inv(np.vander(nodes, increasing=True)) if number else np.zeros((0, 0))
    R, signals = realisation.signals_of(n_y), realisation.signals
    edges = np.unique(signals[:, 4:])  # where they begin, end or jump
    Q = np.zeros((len(guards), n_v + size, n_v + size))
    for whole, guard in zip(Q, guards, strict=True):
        whole[: len(guard.Q), : len(guard.Q)] = guard.Q
    return Taps(
        unit=float(min(1 / max(rate, 1e-300), *realisation.delayed, 1e6)),
        direct=n_y if realisation.taps[0] == 0 else 0,
        tau=np.array(realisation.delayed, dtype=float),
        M=M.reshape(len(modes), size, size), N=N.reshape(len(modes), size, n_v), K=K.reshape(len(modes), n_u, size),
        S=S.reshape(len(modes), n_u, n_v),
        Q=Q, c=np.array([guard.c for guard in guards], dtype=float),
        used=np.asarray(Q.any(axis=(0, 1))),
        table=np.ascontiguousarray(realisation.successors, dtype=np.int64),
        R=np.ascontiguousarray(realisation.R, dtype=float), cuts=np.asarray(realisation.cuts, dtype=np.int64),
        watched=np.array(realisation.watched or [True] * len(modes), dtype=np.bool_),
        after=np.array(realisation.after or range(len(modes)), dtype=np.int64),
        J=np.ascontiguousarray(realisation.J, dtype=float), jump=np.ascontiguousarray(realisation.G, dtype=float),
        wait=float(realisation.wait), delay=float(realisation.delay), clock=float(realisation.clock),
        sampling=float(realisation.sampling), period=float(realisation.period),
        signals=Waves(np.eye(R)[signals[:, 0].astype(int)], np.ascontiguousarray(signals[:, 1:])),
        edges=np.append(edges[np.isfinite(edges)], np.inf), F=make_bernstein_matrix(2 * POWERS - 2),
        rough=ROUGH if exact else ROUGH_ON_ENGINE, exact=exact, nodes=nodes, fit=np.ascontiguousarray(fit),
    )  # fmt: skip


def begin(
    taps: Taps, realisation: Realisation, r: Array, a: Array | None = None, capacity: int = 256
) -> tuple[History, ControllerState]:
    """The beginning of a run at t = 0, where the outputs are read as ``r``, shape (n_y,).

    ``a`` is the controller's state, shape (N_a,); zero if ``None``. The start counts as an event: the rule is watched
    when its least time is over, and an action follows.
    """
    count, n_v, n_u, size = len(taps.tau), taps.S.shape[2], taps.S.shape[1], realisation.layout.size
    a = np.zeros(size) if a is None else np.array(a, dtype=float)
    direct = r[: taps.direct]
    if realisation.commands:  # of which there were none
        r = np.append(r, np.zeros(n_u))
    history = History(
        start=np.full(capacity, _BEGINNING), level=np.full(capacity, SMOOTH), r=np.zeros((capacity, len(r), POWERS)),
        count=np.ones(1, np.int64), at=np.zeros(count, np.int64), ahead=np.zeros(count, np.int64),
    )  # fmt: skip
    history.r[0, :, 0] = r
    v = np.concatenate([direct, np.tile(r, count)])
    v = np.pad(v, (0, n_v - len(v)))
    w = np.concatenate([v, a])
    sign = np.array([float(guard(w)) > 0 for guard in realisation.guards], dtype=np.int64)
    queue = np.full(_QUEUE + int(min(taps.delay / taps.clock, ROOM / 8)), np.inf)
    acts = get_delay(realisation) > 0
    if acts:
        queue[0] = taps.delay
    return history, ControllerState(
        mode=np.repeat(realisation.following(0, w), 2), sign=sign, roots=np.zeros(len(sign)), a=a,
        met=np.array([-1, -1, 0, 0, 0, 0, 0]),
        level=np.array([-1 if realisation.commands else 0]),  # commands may jump there
        due=np.array([1, 0, 1, 0, int(acts), 0]), when=np.array([taps.wait, np.inf, 0.0]), queue=queue,
        v=np.zeros((n_v, POWERS)), A=np.zeros((size, POWERS)), u=np.zeros((n_u, POWERS)), last=np.zeros(n_u),
        after=np.zeros(size),
        values=np.zeros((len(taps.nodes), len(r) + taps.direct + size)), reach=np.zeros(n_v + size),
        g=np.zeros(2 * POWERS - 1), stack=np.zeros((DEEPEST, 2 * POWERS)), spans=np.zeros((DEEPEST, 3)),
    )  # fmt: skip


def begin_at(taps: Taps, now: ControllerState, edges: Array, t: float) -> None:
    """Plan what follows an event at ``t`` [s], where what is due of ``edges``, signals and the clock has been done."""
    now.met[:] = -1, -1, 0, 0, 0, 0, 0
    now.when[:] = t + taps.wait, np.inf, t
    now.due[EDGE], now.due[SIGNAL] = edges.searchsorted(t, side="right"), taps.edges.searchsorted(t, side="right")
    now.due[TICK] = floor(t / taps.clock * (1 + 1e-12)) + 1
    now.due[ACTED], now.due[PLANNED] = 0, taps.delay > 0
    now.queue[0] = t + taps.delay  # the event at the start makes a prediction like any other


def list_levels(edges: Array, acting: Acting) -> np.ndarray:
    """The level of each of these instants, at which something of what acts begins, ends or bends.

    Where readings jump it is −1; where they bend, or what acts on the plant jumps, 0; where that bends, 1.
    """
    levels = np.where(np.isin(edges, acting.edges), 0, 0 if acting.errors.gaussian else 1)
    levels[np.isin(edges, acting.errors.edges)] = -1
    return levels


def compute_first_command(taps: Taps, history: History, now: ControllerState) -> Array:
    """u at the begin of a run, shape (n_u,)."""
    v = np.concatenate([history.r[0, : taps.direct, 0], *(history.r[k, :, 0] for k in history.at)])
    mode = now.mode[0]
    return np.asarray(-taps.K[mode] @ now.a - taps.S[mode] @ np.pad(v, (0, taps.S.shape[2] - len(v))))


def widen(history: History) -> History:
    """The same with history arrays of twice the size.

    Raises:
        SimulationError: if that would be more than :data:`ROOM`.
    """
    if history.count[0] <= len(history.start) // 2:  # it is the queue that is full
        return history
    if 2 * history.r.nbytes > ROOM:
        raise SimulationError(
            f"{len(history.start)} stretches of motion would have to be remembered within the controller's delay; look "
            "for gains or rates of the wrong size, or shorten the delay"
        )
    start, level, r = (np.concatenate([part, np.zeros_like(part)]) for part in history[:3])
    return history._replace(start=start, level=level, r=r)


def copy_of(history: History, now: ControllerState) -> tuple[History, ControllerState]:
    """Both with arrays of their own."""
    return History(*(part.copy() for part in history)), ControllerState(*(part.copy() for part in now))


def lengthen(now: ControllerState) -> ControllerState:
    """The same with a queue of actions that is twice as long if it is full.

    Raises:
        SimulationError: if that would be more than :data:`ROOM`.
    """
    done, count, size = int(now.due[ACTED]), int(now.due[PLANNED] - now.due[ACTED]), len(now.queue)
    if count < size - 1:
        return now
    if 2 * now.queue.nbytes > ROOM:
        raise SimulationError(f"{count} actions are under way at once; give the controller a least time between events")
    queue = np.full(2 * size, np.inf)
    for number in range(done, done + count):
        queue[number % (2 * size)] = now.queue[number % size]
    return now._replace(queue=queue)


def get_least_interval(realisation: Realisation) -> float:
    """The least time between two events [s]; 0 with a clock, or without events."""
    rules = len(realisation.cuts) > 1 and realisation.clock == np.inf
    return realisation.sampling + realisation.wait if rules else 0.0


def get_delay(realisation: Realisation) -> float:
    """The time from an event to its action [s]; 0 without events."""
    return realisation.delay if realisation.eventful else 0.0


def make_waves(duration: float, *parts: tuple[Disturbance, Array]) -> Waves:
    """The effect of what acts over a run of ``duration`` [s], each part through the columns of its effects."""
    effect, terms, through, grids, values = [], [], [], [np.zeros((0, 4))], [np.zeros(0)]
    for part, effects in parts:
        effect.append(effects[:, part.input].T)
        terms.append(part.table[:, 1:])
        through.append(effects[:, [index for index, _ in part.gaussian]].T)
        for _, noise in part.gaussian:
            drawn, first = draw_at_points(noise, 0, count_points(noise, duration)), sum(map(len, values))
            values.append(drawn)
            grids.append(np.array([[noise.start, noise.interval, first, first + len(drawn)]]))
    return Waves(*(np.ascontiguousarray(np.concatenate(of)) for of in (effect, terms, through, grids, values)))
