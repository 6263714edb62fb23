"""A controller that reads delayed outputs, as data for compiled code, with the history of its readings.

Before t = 0 it has read what there is at the start, held. Time within a stretch is counted from its begin, in units of
:attr:`Taps.unit`; polynomials are rows of p + 1 coefficients in it.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from icmj.base.array import Array
from icmj.base.bernstein import from_powers
from icmj.base.roots import DEEPEST
from icmj.controller.law import Law
from icmj.controller.realisation import Realisation
from icmj.errors import SimulationError
from icmj.plant.linear_plant import LinearPlant
from icmj.simulation.disturbance import Acting, Disturbance, expect_held
from icmj.simulation.gaussian import at_points, points_of
from icmj.simulation.native.taps import SMOOTH
from icmj.simulation.native.waves import Waves
from icmj.simulation.settings import Settings

POWERS = 21  # p + 1: of a motion that turns by one radian in a unit of time they leave nothing
_NODES = 13
ROOM = 5e8  # bytes of what a controller remembers of its readings
_BEGINNING = -1e30  # of the history that is held before t = 0


class Taps(NamedTuple):
    """The controller's numbers for compiled code.

    Attributes:
        unit: of time [s], and the longest stretch.
        tau: taps [s], shape (T,).
        M, N, K, S: of the modes, shapes (modes, N_a, N_a), (modes, N_a, n_v), (modes, n_u, N_a), (modes, n_u, n_v).
        Q, c: of the guards, shapes (G, n_v, n_v) and (G,).
        table: the mode that follows by mode and signs, shape (modes, 2^G).
        J, period: a := J a at multiples of the period [s], shape (N_a, N_a).
        signals: the last columns of N, R of them.
        edges: where one begins, ends or jumps, rising, then infinity.
        F: to Bernstein coefficients of a guard, degree 2p.
        exact: whether what is remembered are Taylor series, else polynomials through values at nodes.
        nodes, fit: nodes on (−1, 1), rising, and the matrix from values at them to coefficients; else empty.
    """

    unit: float
    tau: Array
    M: Array
    N: Array
    K: Array
    S: Array
    Q: Array
    c: Array
    table: np.ndarray
    J: Array
    period: float
    signals: Waves
    edges: Array
    F: Array
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


class Now(NamedTuple):
    """The present state of the controller, and work arrays.

    Attributes:
        mode: shape (1,).
        sign: whether each guard is positive, shape (G,).
        a: state, shape (N_a,).
        due: number of the next reset, and of the next edge of a signal.
        v, A, u: readings, state and command on the stretch under way, shapes (n_v, p + 1), (N_a, p + 1), (n_u, p + 1).
        values: at nodes, shape (nodes, n_r).
        g: of a guard.
        stack, spans: see :mod:`icmj.base.roots`.
    """

    mode: np.ndarray
    sign: np.ndarray
    a: Array
    due: np.ndarray
    v: Array
    A: Array
    u: Array
    values: Array
    g: Array
    stack: Array
    spans: Array


def taps_of(realisation: Realisation, n_y: int, rate: float, *, exact: bool) -> Taps:
    """The controller of a loop of ``n_y`` outputs whose fastest rate is so many rad/s, with what disturbs it."""
    modes, guards = realisation.modes, realisation.guards
    n_v, n_u = modes[0].S.shape[1], modes[0].S.shape[0]
    M, N, K, S = (np.ascontiguousarray([getattr(mode, letter) for mode in modes], dtype=float) for letter in "MNKS")
    table = np.arange(len(modes))[:, None].repeat(1 << len(guards), axis=1)
    number = 0 if exact else _NODES
    nodes = -np.cos(np.pi * (np.arange(number) + 0.5) / max(number, 1))
    fit = np.linalg.inv(np.vander(nodes, increasing=True)) if number else np.zeros((0, 0))
    size, R, signals = realisation.layout.size, signals_of(realisation, n_y), realisation.signals
    return Taps(
        unit=float(min(1 / max(rate, 1e-300), realisation.taps[0])),
        tau=np.array(realisation.taps, dtype=float),
        M=M, N=N.reshape(len(modes), size, n_v), K=K.reshape(len(modes), n_u, size), S=S,
        Q=np.array([guard.Q for guard in guards], dtype=float).reshape(len(guards), n_v, n_v),
        c=np.array([guard.c for guard in guards], dtype=float),
        table=np.ascontiguousarray(table if realisation.table is None else realisation.table, dtype=np.int64),
        J=np.ascontiguousarray(realisation.J, dtype=float), period=float(realisation.period),
        signals=Waves(np.eye(R)[signals[:, 0].astype(int)], np.ascontiguousarray(signals[:, 1:])),
        edges=np.append(edges_of(realisation), np.inf), F=from_powers(2 * POWERS - 2),
        exact=exact, nodes=nodes, fit=np.ascontiguousarray(fit),
    )  # fmt: skip


def begun(taps: Taps, realisation: Realisation, r: Array, capacity: int = 256) -> tuple[History, Now]:
    """The beginning of a run at t = 0, where the outputs are read as ``r``, shape (n_y,)."""
    count, n_v, n_u = len(taps.tau), taps.S.shape[2], taps.S.shape[1]
    if realisation.commands:  # of which there were none
        r = np.append(r, np.zeros(n_u))
    history = History(
        start=np.full(capacity, _BEGINNING), level=np.full(capacity, SMOOTH), r=np.zeros((capacity, len(r), POWERS)),
        count=np.ones(1, np.int64), at=np.zeros(count, np.int64), ahead=np.zeros(count, np.int64),
    )  # fmt: skip
    history.r[0, :, 0] = r
    v = np.pad(np.tile(r, count), (0, n_v - count * len(r)))
    sign = np.array([float(guard(v)) > 0 for guard in realisation.guards], dtype=np.int64)
    size = realisation.layout.size
    return history, Now(
        mode=np.array([realisation.following(0, v)]), sign=sign, a=np.zeros(size),
        due=np.array([1, 0]), v=np.zeros((n_v, POWERS)),
        A=np.zeros((size, POWERS)), u=np.zeros((n_u, POWERS)), values=np.zeros((len(taps.nodes), len(r))),
        g=np.zeros(2 * POWERS - 1), stack=np.zeros((DEEPEST, 2 * POWERS)), spans=np.zeros((DEEPEST, 3)),
    )  # fmt: skip


def signals_of(realisation: Realisation, n_y: int) -> int:
    """Number of signals that the controller is given: its readings less those that its taps make of ``n_y`` outputs."""
    n_u, n_v = realisation.modes[0].S.shape
    return n_v - len(realisation.taps) * (n_y + (n_u if realisation.commands else 0))


def edges_of(realisation: Realisation) -> Array:
    """Times at which its signals begin, end or jump, increasing [s]."""
    times = np.unique(realisation.signals[:, 4:])
    return np.asarray(times[np.isfinite(times)])


def levels_of(edges: Array, acting: Acting) -> np.ndarray:
    """The level of each of these instants, at which something of what acts begins, ends or bends.

    Where readings jump it is −1; where they bend, or what acts on the plant jumps, 0; where that bends, 1.
    """
    levels = np.where(np.isin(edges, acting.edges), 0, 0 if acting.errors.gaussian else 1)
    levels[np.isin(edges, acting.errors.edges)] = -1
    return levels


def first_level(realisation: Realisation) -> int:
    """The level of a run's begin: its commands may jump there."""
    return -1 if realisation.commands else 0


def first_command(taps: Taps, history: History, now: Now) -> Array:
    """u at the begin of a run, shape (n_u,)."""
    v = np.concatenate([history.r[k, :, 0] for k in history.at])
    return np.asarray(-taps.S[now.mode[0]] @ np.pad(v, (0, taps.S.shape[2] - len(v))))


def widened(history: History) -> History:
    """The same with history arrays of twice the size.

    Raises:
        SimulationError: if that would be more than :data:`ROOM`.
    """
    if 2 * history.r.nbytes > ROOM:
        raise SimulationError(
            f"{len(history.start)} stretches of motion would have to be remembered within the controller's delay; look "
            "for gains or rates of the wrong size, or shorten the delay"
        )
    start, level, r = (np.concatenate([part, np.zeros_like(part)]) for part in history[:3])
    return history._replace(start=start, level=level, r=r)


def modes_of(realisation: Realisation, mode: Array) -> dict[str, Any]:
    """The modes at the rows of a run; empty if the controller has only one."""
    names = tuple(mode.name for mode in realisation.modes)
    return {"mode": mode.astype(np.int64), "modes": names} if len(names) > 1 else {}


def waves_of(duration: float, *parts: tuple[Disturbance, Array]) -> Waves:
    """The effect of what acts over a run of ``duration`` [s], each part through the columns of its effects."""
    effect, terms, through, grids, values = [], [], [], [np.zeros((0, 4))], [np.zeros(0)]
    for part, effects in parts:
        effect.append(effects[:, part.input].T)
        terms.append(np.column_stack([part.amplitude, part.omega, part.phase, part.start, part.end]))
        through.append(effects[:, [index for index, _ in part.gaussian]].T)
        for _, noise in part.gaussian:
            drawn, first = at_points(noise, 0, points_of(noise, duration)), sum(map(len, values))
            values.append(drawn)
            grids.append(np.array([[noise.start, noise.interval, first, first + len(drawn)]]))
    return Waves(*(np.ascontiguousarray(np.concatenate(of)) for of in (effect, terms, through, grids, values)))


def expect_no_observer(law: Law, settings: Settings, *given: object) -> None:
    """Refuse initial values ``given`` for states that the controller does not have, and shares of its command.

    Raises:
        SimulationError: if there is one, or the settings name one.
    """
    expect_held(law, settings)
    if settings.observer or any(start is not None for start in given):
        raise SimulationError(f"a {law.kind} controller has neither observer nor hold; leave out where they start")


def expect_tapped(law: Law, plant: LinearPlant) -> Realisation:
    """The controller's realisation, if it reads nothing of ``plant`` but delayed outputs.

    Raises:
        SimulationError: if it reads outputs as they are, or its model has other numbers of inputs and outputs than the
            plant.
    """
    realisation, assumed = law.realisation, law.plant
    if not realisation.tapped:
        raise SimulationError(f"a {law.kind} controller that reads outputs as they are: expected delayed taps")
    if (plant.n_u, plant.n_y) != (assumed.n_u, assumed.n_y):
        raise SimulationError(
            f"the plant has {plant.n_u} inputs and {plant.n_y} outputs, the controller's model "
            f"{assumed.n_u} and {assumed.n_y}; they must agree"
        )
    more = max(signals_of(realisation, assumed.n_y), 0) if len(realisation.signals) else 0
    each = assumed.n_y + (assumed.n_u if realisation.commands else 0)
    wanted = (assumed.n_u, each * len(realisation.taps) + more)
    for mode in realisation.modes:
        if mode.S.shape != wanted:
            raise SimulationError(
                f"mode {mode.name!r} of the {law.kind} controller has S of shape {mode.S.shape}; expected {wanted}"
            )
    return realisation
