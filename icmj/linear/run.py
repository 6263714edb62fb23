"""The exact simulation of the intermittently controlled linear plant: events root-found, nothing integrated by steps.

Between events the state follows a matrix exponential. A step of the internal grid only fixes where its series is
expanded; on each step the event function is a polynomial (to round-off), and whether it reaches zero anywhere on the
step is decided by its Bernstein coefficients, not by sampling. The same holds for the limit on positions and for the
extremes of the outputs. What disturbs, noise included, is a function of time whose response is exact, too.

Any other controller is simulated from its realisation alone, stretch by stretch (:mod:`icmj.linear.native.stretches`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import factorial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from icmj.base.array import Array
from icmj.base.balancing import balance
from icmj.base.bernstein import make_bernstein_matrix
from icmj.base.blas_threads import limit_to_one_thread
from icmj.base.interruption import defer_interrupt
from icmj.controller.controller import expect_intermittent
from icmj.controller.law import Law
from icmj.controller.realisation import Realisation
from icmj.linear.loop import find_positions
from icmj.linear.native.stretches import Body, Grid, Track, compile_stretches
from icmj.linear.simulator import RunEnd, Simulator
from icmj.plant.linear_plant import LinearPlant
from icmj.simulation import position_limit
from icmj.simulation.disturbance import Acting, make_acting
from icmj.simulation.ending import Outcome
from icmj.simulation.grid import list_points
from icmj.simulation.native.loop import Status
from icmj.simulation.native.waves import Waves
from icmj.simulation.readings import expect_readings
from icmj.simulation.rows import (
    ControllerRows,
    collect_controls,
    collect_drives,
    keep_leads,
    keep_rows,
    lead_jumps,
    lead_rows,
    list_edges,
    part_rows,
)
from icmj.simulation.settings import Settings
from icmj.simulation.simulation import Events, Simulation
from icmj.simulation.start import make_controller_start, make_plant_start, start_states
from icmj.simulation.taps import (
    POWERS,
    begin,
    compute_first_command,
    get_least_interval,
    lengthen,
    list_levels,
    make_taps,
    make_waves,
    widen,
)

_ROWS, _EVENTS = 4096, 512  # of the buffers
_TURN, _SWING = 1.5, 1.25  # of the loop's series and of a sinusoid's on a stretch; 21 terms leave 1e-16 and 1e-14
_BLOCK, _BLOCKS = 128, 8  # cells of what lasts that are worked out together


@limit_to_one_thread()
def simulate_tapped(
    plant: LinearPlant,
    law: Law,
    settings: Settings,
    *,
    x0: ArrayLike | None = None,
    a0: ArrayLike | None = None,
    progress: Callable[[float], None] | None = None,
) -> Simulation:
    """Simulate ``plant`` under a controller, of which before t = 0 the outputs have been constant.

    Args:
        plant: the actual plant; its order may differ from that of the controller's model.
        law: the controller.
        settings: duration, start, recording, limit and disturbances; ``timestep`` and ``integrator`` are for MuJoCo.
        x0: start of the plant (n,), instead of the named states in ``settings``.
        a0: start of the controller's state (N_a,), right after an event; zero if ``None``.
        progress: called repeatedly with the completed fraction, 0–1.

    Returns:
        Recorded at multiples of ``record_interval``, at every event (values just before it), at every action and where
        what is given jumps (values after it), and at the end. Events are those of the rule or the clock, or, of a
        controller without them, its switches; they are exact to 1e-12 s. What the controller's state means is not known
        here: observer, hold and event function are not recorded.

    Raises:
        SimulationError: if plant and controller do not fit, a start state is unknown, of the wrong shape or not
            finite, or a disturbance names an unknown input or output.
    """
    from icmj.base.compilation import call

    realisation = expect_readings(law, plant)
    x = make_plant_start(plant, settings, x0)
    acting, errors, pushes = everything = make_acting(plant, settings)
    n, n_u, n_y = plant.n, plant.n_u, plant.n_y
    names, units = (tuple(of[i] for i in find_positions(plant)) for of in (plant.states, plant.state_units))
    limits = position_limit.get_limits(settings.limit, names, units)
    fastest = float(max(everything.omega.max(initial=0.0), realisation.signals[:, 2].max(initial=0.0)))
    taps = make_taps(realisation, n_y, max(_rate(plant, realisation) / _TURN, fastest / _SWING), exact=True)
    history, now = begin(
        taps, realisation, plant.C @ x + errors(0.0), make_controller_start(realisation.layout.size, a0)
    )
    E = np.column_stack([np.zeros((n, 0)), *(plant.effect(push) for push in pushes.places)])
    edges = list_points(everything.edges, everything.gaussian, settings.duration)
    breaks = np.append(list_edges(everything, law), np.inf)
    limited = np.flatnonzero(np.isfinite(limits))
    positions = np.zeros((len(limited), n))
    positions[np.arange(len(limited)), find_positions(plant)[limited]] = 1 / limits[limited]
    H, duration = taps.unit, float(settings.duration)
    forced, lasting = _split(make_waves(duration, (acting, plant.B * H), (pushes.size, E * H)), duration, H)
    shown, wrong = _split(make_waves(duration, (errors, np.eye(n_y))), duration, H)
    body = Body(
        A=plant.A * H, B=plant.B * H, C=np.ascontiguousarray(plant.C),
        acting=forced,
        errors=shown, lasting=lasting.reach(0.0), wrong=wrong.reach(0.0),
        edges=np.append(edges, np.inf), levels=list_levels(edges, everything), positions=positions,
        interval=float(settings.record_interval), end=float(settings.duration), F=make_bernstein_matrix(POWERS - 1),
        breaks=breaks,
    )  # fmt: skip
    track = Track(
        t=np.array([0.0, 0.0, breaks[0]]), counts=np.array([1, 0, 0, 0, 0]),
        X=np.zeros((n, POWERS)), y=np.zeros((n_y + 1, POWERS)), room=np.zeros((2, POWERS)),
        high=plant.C @ x, low=plant.C @ x,
        rows=np.zeros((_ROWS + int(min(H / body.interval, 1e7)), 2 + n + n_u)),
        events=np.zeros((_EVENTS, 1 + n + 2 * n_y)),
    )  # fmt: skip
    track.X[:, 0] = x
    rows = [np.concatenate([[0.0], x, compute_first_command(taps, history, now), now.mode[:1]])[None, :]]
    events, march = [track.events[:0].copy()], compile_stretches()

    def advance() -> int:
        nonlocal body, history, now
        status: int = call(march, taps, body, history, now, track)
        t = float(track.t[0])
        body = body._replace(lasting=lasting.reach(t), wrong=wrong.reach(t))
        if status == Status.FULL:
            history, now = widen(history), lengthen(now)
        return status

    def keep(_: bool) -> Array:
        with defer_interrupt():
            rows.append(track.rows[: track.counts[1]].copy())
            events.append(track.events[: track.counts[2]].copy())
            track.counts[1:3] = 0
            return events[-1][:, 0]

    end, least = RunEnd(plant, limits, settings.duration), get_least_interval(realisation)
    outcome = end.pursue(advance, keep, lambda: (float(track.t[0]), track.X[:, 0]), least, progress)
    R, K = np.concatenate(rows), np.concatenate(events)
    kept, jumps, leads, mode = part_rows(R[:, 0], R[:, 1 + n : -1], R[:, -1])
    R = R[kept]
    when, X, u = R[:, 0], R[:, 1 : 1 + n], R[:, 1 + n : -1]
    none, before = np.zeros((len(R), 0)), np.zeros((len(K), 0))
    found = Events(K[:, 0], K[:, 1 : 1 + n], before, before, K[:, 1 + n : 1 + n + n_y], K[:, 1 + n + n_y :])
    drives = collect_drives(law, everything, when)
    return _tell(
        plant,
        everything,
        when,
        X,
        outcome,
        found,
        (lead_jumps(leads, jumps, when, u, drives["edges"]), ()),
        ("Taylor series", H, POWERS),
        jumps=jumps,
        **collect_controls(law, plant, settings, ControllerRows(none, none, u, np.full(len(R), np.nan)), mode[kept]),
        **drives,
    )


def _tell(
    plant: LinearPlant,
    acting: Acting,
    t: Array,
    x: Array,
    outcome: Outcome,
    events: Events,
    leads: tuple[Array, Sequence[Array]],
    series: tuple[str, float, int],
    **more: Any,
) -> Simulation:
    """The run with these rows and events; ``leads`` are commands, and hold and event function, right before rows.

    ``series`` are the integrator's name, its step [s] and its number of terms.
    """
    beside, u = acting.disturbance, more["u"]

    def apply(t: Array, u: Array) -> Array:
        """The input that acts at these times right before a row; of no width if it is that of the commands alone."""
        return beside.beside(t, u) + u if len(beside) else u[:, :0]

    return Simulation(
        plant="linear",
        t=t,
        x=x,
        y=x @ plant.C.T,
        events=events,
        applied=u + beside.at_rows(t, u) if len(beside) else np.zeros((0, 0)),
        outcome=outcome,
        precision={
            "integrator": series[0],
            "order": "exact",
            "event_tolerance": 1e-12,
            "step": series[1],
            "series_terms": series[2],
        },
        leads=keep_leads(leads[0], apply, acting, leads[1]),
        **more,
    )


class _Lasting:
    """Sinusoids that last the whole run, on the cells of a grid: all of a cell are two products of matrices."""

    def __init__(self, effect: Array, terms: Array, unit: float) -> None:
        self._effect, which = np.unique(effect, axis=0, return_inverse=True)
        amplitude, self._omega, self._phase, self._unit = *terms[:, :3].T, unit
        j = np.arange(POWERS)
        scale = amplitude[:, None] * (self._omega[:, None] * unit) ** j / np.array([factorial(n) for n in j])
        scale *= np.array([1.0, -1.0, -1.0, 1.0])[j % 4]  # of the derivatives of a cosine
        self._parts = [np.flatnonzero(which.ravel() == s) for s in range(len(self._effect))]
        self._scale = [(scale[part, 0::2].copy(), scale[part, 1::2].copy()) for part in self._parts]
        angle = np.outer(self._omega, np.arange(_BLOCK) * unit)
        self._turns, self._room = np.stack([np.cos(angle), np.sin(angle)]), np.empty((2, *angle.shape))
        self._grid = Grid(0, np.zeros((0, len(self._effect), POWERS)), np.ascontiguousarray(self._effect))

    def reach(self, t: float) -> Grid:
        """The grid from ``t`` on, for as many cells as are followed at once."""
        from icmj.simulation.native.waves import turn

        if not len(self._effect):
            return self._grid
        cell, (first, f, effect) = int(t // self._unit), self._grid
        if not first <= cell < first + len(f) - _BLOCK // 2:
            first = cell - 1
            f = np.empty((_BLOCKS * _BLOCK, len(effect), POWERS))
            for block in range(_BLOCKS):
                begin = self._omega * ((first + block * _BLOCK + 0.5) * self._unit) + self._phase
                turn(self._turns, np.cos(begin), np.sin(begin), self._room)
                cos, sin = self._room
                rows = f[block * _BLOCK : (block + 1) * _BLOCK]
                for s, (part, (even, odd)) in enumerate(zip(self._parts, self._scale, strict=True)):
                    rows[:, s, 0::2], rows[:, s, 1::2] = cos[part].T @ even, sin[part].T @ odd
            self._grid = Grid(first, f, effect)
        return self._grid


def _split(waves: Waves, duration: float, unit: float) -> tuple[Waves, _Lasting]:
    """What acts for a while only, and what lasts the whole run."""
    lasts = (waves.terms[:, 3] <= 0) & (waves.terms[:, 4] >= duration)
    rest = waves._replace(effect=waves.effect[~lasts], terms=waves.terms[~lasts])
    return rest, _Lasting(waves.effect[lasts], waves.terms[lasts], unit)


def _rate(plant: LinearPlant, realisation: Realisation) -> float:
    """A bound on the rate of the loop's Taylor series: the norm of its matrices with and without undelayed taps."""
    norms = [0.0]
    for mode in realisation.modes:
        read = realisation.read(plant.C, mode)
        feedback = np.vstack([-plant.B @ mode.S[:, : len(read)], mode.N[:, : len(read)]]) @ read
        alone = np.block([[plant.A, -plant.B @ mode.K], [np.zeros((len(mode.M), plant.n)), mode.M]])
        closed = alone + feedback
        norms += [float(np.linalg.norm(balance(M)[0], 2)) for M in (alone, closed)]
    return max(norms)


@limit_to_one_thread()
def simulate(
    plant: LinearPlant,
    controller: Law,
    settings: Settings,
    *,
    x0: ArrayLike | None = None,
    x_o0: ArrayLike | None = None,
    x_h0: ArrayLike | None = None,
    progress: Callable[[float], None] | None = None,
) -> Simulation:
    """Simulate ``plant`` under ``controller`` from a departure from the operating point.

    Args:
        plant: the actual plant; its order may differ from that of the controller's model.
        controller: design, hold and trigger (event, clock or continuous), or any other, by its realisation
            (:func:`icmj.linear.run.simulate_tapped`).
        settings: duration, start, recording, limit and disturbances; ``timestep`` and ``integrator`` are for MuJoCo.
        x0, x_o0: start of plant (n,) and observer (n̂,), instead of the named states in ``settings``.
        x_h0: start of the hold state (n̂,); the observer's by default, because t = 0 is an event.
        progress: called repeatedly with the completed fraction, 0–1.

    Returns:
        Recorded at multiples of ``record_interval``, at every event (values just before the reset), at every action and
        where what is given jumps (values after it), and at the end. Events are exact to 1e-12 s.

    Raises:
        SimulationError: if plant and controller do not fit, a start state is unknown, of the wrong shape or not
            finite, or a disturbance names an unknown input or output.
    """
    x, a = start_states(plant, controller, settings, x0, x_o0, x_h0)
    if not controller.observed:
        return simulate_tapped(plant, controller, settings, x0=x, progress=progress)
    simulator = Simulator(plant, law := expect_intermittent(controller), settings, settings.record_interval)
    loop = simulator.loop
    found, outcome = simulator.run(loop.state(x, a), progress)
    x, rows, at_events = (
        loop.x(found.Z),
        *(keep_rows(law, loop.x_o(Z), loop.x_h(Z), loop.e(Z)) for Z in (found.Z, found.event_Z)),
    )
    events = Events(found.event_t, loop.x(found.event_Z), at_events.x_o, at_events.x_h, found.y_max, found.y_min)
    acting = make_acting(plant, settings, controller)
    drives = collect_drives(controller, acting, found.t)
    return _tell(
        plant,
        acting,
        found.t,
        x,
        outcome,
        events,
        lead_rows(law, found.t, loop.x_o(found.Z), loop.x_h(found.Z), found.event_t, drives["edges"]),
        ("matrix exponential", simulator.tables.step, simulator.tables.A.shape[1]),
        **collect_controls(law, plant, settings, rows, np.zeros(0)),
        **drives,
    )
