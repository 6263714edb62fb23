"""The course of one open-loop interval on the engine: recorded, interpolated, and differentiated along the way."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

import mujoco
import numpy as np

from icmj.base.array import Array
from icmj.controller.controller import layout_of, realise, start_state
from icmj.engine.callbacks import installed
from icmj.engine.open_loop import EngineOpenLoop
from icmj.errors import SimulationError
from icmj.simulation.course import Sample

ROWS = 200  # in an interval: what a spline through them errs by is far below what it is used for
_FEW = 100  # with fewer it is flown again
EPS = 1e-5  # half the distance of a difference; see icmj.engine.linearisation
EPS_U = 1e-4  # the same for a control, relative to its largest value on the way


class EngineCourse:
    """See :class:`icmj.simulation.course.Course`."""

    def __init__(
        self, flight: EngineOpenLoop, x: Array, x_o: Array, x_h: Array, length: float, rows: Array | None = None
    ) -> None:
        """Take the ``rows`` that a flight kept, or fly again, from an event to the next, about ``length`` [s] on.

        Raises:
            SimulationError: if there is none.
        """
        from scipy.interpolate import CubicSpline

        self.loop = loop = flight.loop
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
        self._nq, self._nv = loop.model.nq, loop.model.nv
        splines = []
        for low, high in zip(self.cuts, self.cuts[1:], strict=False):
            here = (rows[:, 0] >= low - 1e-12) & (rows[:, 0] <= high + 1e-12)
            t, values = np.clip(rows[here, 0], low, high), rows[here, 1:]
            kept = np.concatenate([[True], np.diff(t) > 1e-12])
            splines.append(CubicSpline(t[kept], values[kept]))
        self._splines = splines
        self._data = flight.data
        with self._lent():
            self._place(self._whole(np.array([length]), len(splines) - 1)[0])
            self.rate = self._rate()

    def _holds(self, a: Array) -> list[tuple[float, Array]]:
        """When and from where the hold runs free, one entry for each part."""
        held = [(0.0, a)]
        if len(self.cuts) > 2:
            before = self._free(a, np.array([self.cuts[1]]))[0]
            held.append((self.cuts[1], self._controls.G @ before))
        return held

    def _free(self, a: Array, tau: Array) -> Array:
        """The controller's state after times ``tau`` of hold; its observer, which needs outputs, left as it is."""
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

    @contextmanager
    def _lent(self) -> Iterator[None]:
        with installed(*self.loop.implementation().callbacks), self.loop.lent():
            mujoco.mj_resetData(self.loop.model, self._data)
            yield

    def _place(self, row: Array) -> None:
        data, nq, nv = self._data, self._nq, self._nv
        data.qpos[:], data.qvel[:], data.act[:] = row[:nq], row[nq : nq + nv], row[nq + nv : nq + nv + len(data.act)]

    def _rate(self) -> Array:
        """d/dt of (x, a) where the data stand."""
        data = self._data
        mujoco.mj_forward(self.loop.model, data)
        x = np.concatenate([data.qvel, data.qacc, data.act_dot[: self._act.start]])
        return np.concatenate([x[self._kept], data.act_dot[self._act]])

    def sample(self, t: Array) -> Sample:
        """What it does at times within it."""
        loop, parts = self.loop, self._part(t)
        rows = np.concatenate([self._whole(t[parts == part], part) for part in range(len(self._splines))])
        at = loop.departures(np.hstack([t[:, None], rows]))
        u = -at.x_h @ loop.controller.design.k.T
        return Sample(t, at.x, at.x_o, at.x_h, at.y, u, rows[:, : self._nq])

    def generators(self, t: Array, part: int) -> Array:
        """F by centred differences of the closed loop's right-hand side."""
        kept, K = self._kept, self._controls.K
        n, size = len(kept), len(kept) + K.shape[1]
        rows = self._whole(t, part)
        # directions of a that move one input each
        push = np.asarray(np.linalg.pinv(K), float)
        first = self._nq + self._nv + self._act.start
        a = rows[:, first : first + K.shape[1]]
        reach = EPS_U * np.maximum(np.abs(a @ K.T).max(axis=0), 1e-6 * max(float(np.abs(a @ K.T).max()), 1e-300))
        F = np.zeros((len(t), size, size))
        with self._lent():
            for F_t, row in zip(F, rows, strict=True):
                for j, state in enumerate(kept):
                    F_t[:, j] = self._slope(row, int(state), None, EPS)
                for i in range(K.shape[0]):
                    column = self._slope(row, -1, push[:, i], float(reach[i]))
                    F_t[:n, n:] += np.outer(column[:n], K[i])
                F_t[n:, n:] = self._controls.M
        return F

    def _slope(self, row: Array, state: int, direction: Array | None, eps: float) -> Array:
        """One column of F: along a state of the model, or a direction of the controller's."""
        data, nv = self._data, self._nv
        ends = []
        for sign in (1, -1):
            self._place(row)
            if direction is not None:
                data.act[self._act] += sign * eps * direction
            elif state < nv:
                move = np.zeros(nv)
                move[state] = sign * eps
                mujoco.mj_integratePos(self.loop.model, data.qpos, move, 1.0)
            elif state < 2 * nv:
                data.qvel[state - nv] += sign * eps
            else:
                data.act[state - 2 * nv] += sign * eps
            ends.append(self._rate())
        return (ends[0] - ends[1]) / (2 * eps)


def _flown(flight: EngineOpenLoop, x: Array, a: Array, length: float) -> Array:
    # adapted steps are long, and rows lie within them
    every = length / ROWS if flight.schedule.tolerance else max(length / ROWS, flight.schedule.timestep)
    record = flight.loop.run(flight.loop.data(x, a), replace(flight.schedule, events=1, record_interval=every))
    if len(record.events) != 1:
        raise SimulationError(f"the interval {record.outcome.message}, without an event at its end")
    return record.rows
