"""The trajectory of one open-loop interval on the engine: recorded, interpolated, and linearised along it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from icmj.base.array import Array
from icmj.controller.controller import layout_of, realise, start_state
from icmj.engine.open_loop import EngineOpenLoop
from icmj.errors import CycleError, SimulationError
from icmj.simulation.interval import Sample

ROWS = 200  # in an interval: what a spline through them errs by is far below what it is used for
_FEW = 90  # with fewer it is flown again
EPS = 1e-5  # half the distance of a difference; see icmj.engine.linearisation
EPS_U = 1e-4  # the same for a control, relative to its largest value on the way


class EngineCourse:
    """See :class:`icmj.simulation.interval.Course`."""

    def __init__(
        self, flight: EngineOpenLoop, x: Array, x_o: Array, x_h: Array, length: float, rows: Array | None = None
    ) -> None:
        """Take the ``rows`` of a stored simulation, or simulate again to the next event, about ``length`` [s] later.

        Raises:
            SimulationError: if there is none.
        """
        from scipy.interpolate import CubicSpline

        self._flight, self.loop = flight, (loop := flight.loop)
        self._act = loop.block.act
        a = start_state(loop.controller, np.asarray(x_o, float), np.asarray(x_h, float))
        if rows is None or len(rows) < min(_FEW, length / flight.schedule.timestep):
            rows = _flown(flight, np.asarray(x, float), a, length)
        delay = loop.controller.delay.t_d
        length = float(rows[-1, 0])
        self.cuts: tuple[float, ...] = (0.0, delay, length) if 0 < delay < length else (0.0, length)
        self._layout, self._controls = layout_of(loop.controller), realise(loop.controller)
        self._held = self._holds(a)
        self._kept = loop.plant.linearisation.ports.states
        self._nq, self._nv, self._na = loop.model.nq, loop.model.nv, loop.model.na
        splines = []
        for low, high in zip(self.cuts, self.cuts[1:], strict=False):
            here = (rows[:, 0] >= low - 1e-12) & (rows[:, 0] <= high + 1e-12)
            t, values = np.clip(rows[here, 0], low, high), rows[here, 1:]
            kept = np.concatenate([[True], np.diff(t) > 1e-12])
            thin = max(len(t) // ROWS, 1)
            kept[1:-1] &= np.arange(1, len(t) - 1) % thin == 0
            splines.append(CubicSpline(t[kept], values[kept]))
        self._splines = splines
        last = self._whole(np.array([length]), len(splines) - 1)[:, : self._nq + self._nv + self._na]
        self.rate = self._rates(last, np.zeros((1, last.shape[1])))[0, 0]

    def _holds(self, a: Array) -> list[tuple[float, Array]]:
        """Start time and start state of each part in which the hold runs without reset."""
        held = [(0.0, a)]
        if len(self.cuts) > 2:
            before = self._free(a, np.array([self.cuts[1]]))[0]
            held.append((self.cuts[1], self._controls.G @ before))
        return held

    def _free(self, a: Array, tau: Array) -> Array:
        """The controller's state at times ``tau`` into a part: the hold in closed form, the observer unchanged."""
        after, h = np.tile(a, (len(tau), 1)), self._layout["x_h"]
        after[:, h] = self.loop.controller.hold.free(a[h], tau)
        return after

    def _part(self, t: Array) -> np.ndarray:
        return np.clip(np.searchsorted(np.array(self.cuts), t, side="right") - 1, 0, len(self._splines) - 1)

    def _whole(self, t: Array, part: int) -> Array:
        """Rows (qpos, qvel, act, sensordata) at times within a part."""
        rows = self._splines[part](t)
        start, a = self._held[part]
        free = self._free(a, t - start)
        first = self._nq + self._nv + self._act.start
        o = self._layout["x_o"]
        free[:, o] = rows[:, first + o.start : first + o.stop]
        rows[:, first : first + free.shape[1]] = free
        return rows

    def sample(self, t: Array) -> Sample:
        """Its states at given times."""
        loop, parts = self.loop, self._part(t)
        rows = np.concatenate([self._whole(t[parts == part], part) for part in range(len(self._splines))])
        at = loop.departures(np.hstack([t[:, None], rows]))
        u = -at.x_h @ loop.controller.design.k.T
        return Sample(t, at.x, at.x_o, at.x_h, at.y, u, rows[:, : self._nq])

    def generators(self, t: Array, part: int) -> Array:
        """F by centred differences of the closed loop's right-hand side.

        Raises:
            CycleError: if joints turn freely in space, whose positions do not depart as their velocities do.
        """
        if self._nq != self._nv:
            raise CycleError("the equation of variation is written for joints that turn about one axis, and slides")
        kept, K = self._kept, self._controls.K
        n, size = len(kept), len(kept) + K.shape[1]
        rows = self._whole(t, part)[:, : self._nq + self._nv + self._na]
        first = self._nq + self._nv + self._act.start
        u = rows[:, first : first + K.shape[1]] @ K.T
        reach = EPS_U * np.maximum(np.abs(u).max(axis=0), 1e-6 * max(float(np.abs(u).max()), 1e-300))
        # moves: along each state, and along directions of a that move one input each
        moves = np.zeros((n + len(reach), rows.shape[1]))
        moves[np.arange(n), kept] = EPS
        moves[n:, first : first + K.shape[1]] = (np.linalg.pinv(K) * reach).T
        ends = self._rates(rows, np.stack([moves, -moves], axis=1).reshape(-1, rows.shape[1]))
        slopes = (ends[:, 0::2] - ends[:, 1::2]) / (2 * np.append(np.full(n, EPS), reach))[:, None]
        F = np.zeros((len(t), size, size))
        F[:, :, :n] = slopes[:, :n].transpose(0, 2, 1)
        F[:, :n, n:] = np.einsum("tij,ik->tjk", slopes[:, n:, :n], K)
        F[:, n:, n:] = self._controls.M
        return F

    def _rates(self, rows: Array, moves: Array) -> Array:
        """d/dt of (x, a) at all ``rows``, moved by each of ``moves``; shapes (T, w), (m, w) → (T, m, n + N_a)."""
        rates = self._flight.rates(rows, moves)
        x, a = rates[..., : 2 * self._nv + self._act.start], rates[..., 2 * self._nv :]
        return np.concatenate([x[..., self._kept], a[..., self._act]], axis=-1)


def _flown(flight: EngineOpenLoop, x: Array, a: Array, length: float) -> Array:
    # adapted steps are long, and rows lie within them
    every = length / ROWS if flight.schedule.tolerance else max(length / ROWS, flight.schedule.timestep)
    record = flight.loop.run(flight.loop.data(x, a), replace(flight.schedule, events=1, record_interval=every))
    if len(record.events) != 1:
        raise SimulationError(f"the interval {record.outcome.message}, without an event at its end")
    return record.rows
