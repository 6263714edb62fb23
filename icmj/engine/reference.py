"""The controller and the event loop in plain Python: slow, short, and the oracle for the native ones."""

from __future__ import annotations

from collections.abc import Callable

import mujoco
import numpy as np

from icmj.base.array import Array
from icmj.controller.trigger import Faces
from icmj.engine.actuator import second_order_lag
from icmj.engine.block import Block, Slot, block_of
from icmj.engine.bracket import SPLITS, any_may_reach_zero, hermite_root
from icmj.engine.pushing import forces
from icmj.engine.recording import Recording, Status
from icmj.engine.schedule import EVENT_TOLERANCE, Schedule

INTEGRATORS: dict[int, Callable[[mujoco.MjModel, mujoco.MjData], None]] = {
    mujoco.mjtIntegrator.mjINT_RK4: lambda m, d: mujoco.mj_RungeKutta(m, d, 4),
    mujoco.mjtIntegrator.mjINT_EULER: mujoco.mj_Euler,
    mujoco.mjtIntegrator.mjINT_IMPLICIT: mujoco.mj_implicit,
    mujoco.mjtIntegrator.mjINT_IMPLICITFAST: mujoco.mj_implicit,
    # not exported on its own: a whole step, which repeats the forward pass
    mujoco.mjtIntegrator.mjINT_DISCRETE: mujoco.mj_step,
}


def control(model: mujoco.MjModel, data: mujoco.MjData) -> None:
    """MuJoCo control callback: fresh outputs, then ctrl = ctrl_0 − K a + d(t), and the forces of pushes."""
    block = block_of(model)
    if block is None or model.nu != len(block.ctrl_0) + 1:
        return
    mujoco.mj_sensorPos(model, data)
    if block.header[Slot.STAGE] >= int(mujoco.mjtStage.mjSTAGE_VEL):
        mujoco.mj_sensorVel(model, data)
    data.ctrl[: len(block.ctrl_0)] = command(block, data)
    if len(block.pushes):
        sizes = _sum(block.sizes, len(block.pushes), data.time, block.header[Slot.PHASE])
        data.qfrc_applied[:] = forces(model, data, block.pushes, sizes)


def act_dyn(model: mujoco.MjModel, data: mujoco.MjData, actuator: int) -> float:
    """MuJoCo activation callback: ȧ = M a + N (y + n(t) − y_0), and the plant's own second-order lags."""
    block = block_of(model)
    if block is None:
        return 0.0
    if actuator < model.nu - 1:
        return second_order_lag(model, data, actuator)
    data.act_dot[block.act] = rates(block, data)
    return 0.0


def command(block: Block, data: mujoco.MjData) -> Array:
    """ctrl_0 − K a + d(t)."""
    d = _sum(block.terms, len(block.ctrl_0), data.time, block.header[Slot.PHASE])
    return block.ctrl_0 - block.K @ data.act[block.act] + d


def rates(block: Block, data: mujoco.MjData) -> Array:
    """ȧ = M a + N (y + n(t) − y_0)."""
    n = _sum(block.errors, len(block.y_0), data.time, block.header[Slot.PHASE])
    return block.M @ data.act[block.act] + block.N @ (data.sensordata[: len(block.y_0)] - block.y_0 + n)


def _sum(terms: Array, inputs: int, t: float, phase: float) -> Array:
    """The sum of the terms on each input."""
    total = np.zeros(inputs)
    phase = t if phase < 0 else phase
    for i, amplitude, omega, phi, start, end in terms:
        if start <= phase < end:
            total[int(i)] += amplitude * np.cos(omega * t + phi)
    return total


class ReferenceLoop:
    """Steps a composed model from event to event.

    Each step is taken from a forward pass at its start to one at its end, which gives the outputs and, from the
    activation rates, E and dE/dt at both ends. Their Hermite cubic decides whether E may have reached zero in
    between, however shortly; the event is then located by repeating the step, shortened.
    """

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, schedule: Schedule, qpos_0: Array) -> None:
        block = block_of(model)
        assert block is not None
        self.model, self.data, self.block, self.schedule, self.qpos_0 = model, data, block, schedule, qpos_0
        self.faces = Faces(block.R, block.edges)
        self.integrate = INTEGRATORS[model.opt.integrator]
        self._saved = np.empty(mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_INTEGRATION))
        self.begin()

    def begin(self) -> None:
        """Start, or start anew, from where the data stand, right after an event."""
        model, data, block, schedule = self.model, self.data, self.block, self.schedule
        t = data.time
        self._grid, self._i = t, 0  # the step grid starts at ``grid``; ``i`` steps of it are done
        self._last, self._armed, self._events = t, False, 0
        self._clock, self._edge = schedule.first_clock(t), schedule.first_edge(t)
        self._acted = self._clock - 1 if np.isfinite(schedule.clock) else 0
        self._begin, self._end, self._length = t, t, 0.0
        self._next_record = t + schedule.record_interval
        block.header[Slot.PHASE] = schedule.phases[self._edge]
        mujoco.mj_forward(model, data)

    def advance(self, record: Recording, steps: int) -> Status:
        """Take up to ``steps`` steps, writing into ``record``."""
        status = Status.RUNNING
        for _ in range(steps):
            status = self._advance(record)
            record.count[3] += 1
            if status != Status.RUNNING:
                break
        return status

    def _advance(self, record: Recording) -> Status:
        plan, data = self.schedule, self.data
        t = data.time
        least = max(plan.delta_min, plan.delay)
        arm = self._last + least if len(self.faces) and not self._armed else np.inf
        clock = self._clock * plan.clock if np.isfinite(plan.clock) else np.inf
        edge = plan.edges[self._edge] if self._edge < len(plan.edges) else np.inf
        act = self._next_action()
        target = min(plan.t_end, arm, clock, edge, act)
        lands = target - t <= plan.timestep * (1 + 1e-9)
        step = target - t if lands else plan.timestep
        fired = False
        self._length = step
        if step > 0:
            levels = self._levels()
            mujoco.mj_getState(self.model, data, self._saved, mujoco.mjtState.mjSTATE_INTEGRATION)
            self._begin = t
            self._end = target if lands else self._grid + (self._i + 1) * plan.timestep
            self._step(step, first=True)
            if self._armed:
                fired = self._event_in(step, *levels)
                lands = lands and data.time >= target
        if fired or lands:
            self._grid, self._i = data.time, 0
        else:
            self._i += 1
        status = self._status()
        acts = status == Status.RUNNING and lands and data.time >= act
        if acts:
            data.act[self.block.act] = self.block.G @ data.act[self.block.act]
            self._acted += 1
            mujoco.mj_forward(self.model, data)
        if status == Status.RUNNING and lands:
            # what was planned for this time
            if data.time >= arm:
                self._armed = True
                fired = fired or self._levels()[0].max() >= 0
            if data.time >= clock:
                self._clock += 1
                fired = True
            if data.time >= plan.t_end:
                status = Status.COMPLETED
        if fired:
            self._events += 1
            if status == Status.RUNNING and self._events >= plan.events:
                status = Status.REACHED
        due = acts or data.time >= self._next_record - 1e-9 * plan.timestep
        self._record(record, fired, due or status != Status.RUNNING)
        if fired:
            a = data.act[self.block.act]
            a[:] = self.block.J @ a
            self._last, self._armed = data.time, len(self.faces) > 0 and least == 0
        passed = lands and data.time >= edge
        if passed:
            self._edge += 1
            self.block.header[Slot.PHASE] = plan.phases[self._edge]
        if fired or passed:
            mujoco.mj_forward(self.model, data)
        return status

    def _next_action(self) -> float:
        """When the oldest event that has not acted yet will; infinity if there is none."""
        plan = self.schedule
        if plan.delay == 0:
            return float("inf")
        if np.isfinite(plan.clock):
            return plan.clock_action(self._acted) if self._acted < self._clock else float("inf")
        return self._last + plan.delay if self._acted <= self._events else float("inf")

    def _step(self, step: float, first: bool = False) -> None:
        """One step of the length given from the saved state, and the forward pass at its end."""
        if not first:
            mujoco.mj_setState(self.model, self.data, self._saved, mujoco.mjtState.mjSTATE_INTEGRATION)
            mujoco.mj_forward(self.model, self.data)
        self.model.opt.timestep = step
        self.integrate(self.model, self.data)
        # not the sum that the engine keeps: its rounding errors add up over many equal steps
        self.data.time = self._end if step == self._length else self._begin + step
        mujoco.mj_forward(self.model, self.data)

    def _levels(self) -> tuple[Array, Array]:
        """E_j and dE_j/dt of every face of the event rule, after a forward pass; shapes (F,), (F,)."""
        a, rate = (vector[self.block.act] for vector in (self.data.act, self.data.act_dot))
        return self.faces.levels(a), self.faces.rates(a, rate)

    def _event_in(self, step: float, E_0: Array, dE_0: Array) -> bool:
        """Whether E reaches zero within the step just taken; leaves the state at the first event, or at the end."""
        E_1, dE_1 = self._levels()
        if not np.isfinite(E_1).all():
            return False
        top = np.maximum(np.abs(E_0 + 1), np.abs(E_1 + 1))
        if not any_may_reach_zero(E_0, dE_0, E_1, dE_1, step, self.schedule.margin(step) * top):
            if E_1.max() >= 0:
                self._locate(0.0, E_0, dE_0, step, E_1, dE_1)
            return bool(E_1.max() >= 0)
        # E may have touched zero between the ends: look inside, ever finer
        pieces = 2
        while pieces <= SPLITS:
            s_a, E_a, dE_a = 0.0, E_0, dE_0
            margin = self.schedule.margin(step / pieces) * top
            settled = True
            for j in range(1, pieces + 1):
                s_b = step * j / pieces
                self._step(s_b)
                E_b, dE_b = self._levels()
                if E_b.max() >= 0:
                    self._locate(s_a, E_a, dE_a, s_b, E_b, dE_b)
                    return True
                settled = settled and not any_may_reach_zero(E_a, dE_a, E_b, dE_b, s_b - s_a, margin)
                s_a, E_a, dE_a = s_b, E_b, dE_b
            if settled:
                break
            pieces *= 2
        return False

    def _locate(self, low: float, E_l: Array, dE_l: Array, high: float, E_h: Array, dE_h: Array) -> None:
        """Find the root of max E_j between ``low`` (all negative) and ``high`` (one is not); leave the state there."""
        reached = np.flatnonzero(E_h >= 0)
        s = min(hermite_root(low, E_l[j], dE_l[j], high, E_h[j], dE_h[j]) for j in reached)
        for trial in range(60):
            self._step(s)
            levels, rates = self._levels()
            E, dE = levels.max(), rates[levels.argmax()]
            if E >= 0:
                high = s
            else:
                low = s
            newton = s - E / dE if dE > 0 else np.inf
            if abs(newton - s) <= EVENT_TOLERANCE or high - low <= EVENT_TOLERANCE:
                break
            # bisection now and then, for a touch so slight that Newton converges slowly
            s = newton if low < newton < high and trial % 8 != 7 else (low + high) / 2

    def _status(self) -> Status:
        model, data = self.model, self.data
        if not (np.abs(data.qpos).sum() + np.abs(data.qvel).sum() + np.abs(data.act).sum() < mujoco.mjMAXVAL):
            return Status.DIVERGED
        if any(w.number for w in data.warning):
            return Status.WARNED
        departure = np.empty(model.nv)
        mujoco.mj_differentiatePos(model, departure, 1.0, self.qpos_0, data.qpos)
        return Status.FELL if (np.abs(departure) > self.schedule.limits).any() else Status.RUNNING

    def _record(self, record: Recording, fired: bool, due: bool) -> None:
        data = self.data
        y = data.sensordata
        n_dense, n_rows, n_events, _ = record.count
        record.dense[n_dense] = [data.time, *y]
        if fired or due:
            row = np.concatenate([[data.time], data.qpos, data.qvel, data.act, y])
            if self._length > 0:  # else an event at the very start, whose row is there already
                record.rows[n_rows] = row
                record.count[1] += 1
            if fired:
                record.events[n_events] = row
                record.event_at[n_events] = n_dense
                record.count[2] += 1
            self._next_record = data.time + self.schedule.record_interval
        record.count[0] += 1
