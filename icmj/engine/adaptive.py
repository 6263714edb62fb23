"""The adaptive loop in plain Python: what the compiled one does, to be compared with it."""

from __future__ import annotations

from itertools import pairwise

import mujoco
import numpy as np
from numpy.polynomial import Polynomial

from icmj.base.array import Array
from icmj.base.bernstein import first_root
from icmj.engine.block import Slot
from icmj.engine.recording import Recording, Status
from icmj.engine.reference import ReferenceLoop
from icmj.engine.schedule import EVENT_TOLERANCE
from icmj.engine.tableau import (
    GROWTH,
    NUDGE,
    SAFETY,
    SHORTEST,
    SHRINKAGE,
    dense,
    error_norm,
    rounded,
    within,
)


class AdaptiveLoop(ReferenceLoop):
    """Steps whose length and order the tolerance decides, on the rates that ``mj_forward`` gives.

    A step ends where something is planned: the run's end, an event of the clock, an action, an edge of a disturbance.
    Events of the rule and recorded rows lie within steps: the first are found on the dense output and reached by a
    step of their own, the others are read from it.
    """

    def begin(self) -> None:
        """Start, or start anew, from where the data stand, right after an event."""
        super().begin()
        plan = self.schedule
        self._method = plan.method
        self._next_step = self._first_step = rounded(plan.first_step)
        self._fresh = True
        self._reach = np.zeros(len(self._state()))
        self._rates = self._flow()

    def advance(self, record: Recording, steps: int) -> Status:
        """Take up to ``steps`` steps, fewer where the rows of one more might not fit into ``record``."""
        status, room = Status.RUNNING, len(record.dense) // 4 + self._method.looks + 2
        for _ in range(steps):
            if status != Status.RUNNING or len(record.dense) - record.count[0] < room:
                break
            status = self._advance(record)
            record.count[3] += 1
        return status

    def _state(self) -> Array:
        data = self.data
        return np.concatenate([data.qpos, data.qvel, data.act])

    def _put(self, state: Array, t: float) -> None:
        data, nq, nv = self.data, self.model.nq, self.model.nv
        data.qpos[:], data.qvel[:], data.act[:] = np.split(state, [nq, nq + nv])
        data.time = t

    def _flow(self) -> Array:
        """Rates of the state where the engine is; quaternions turn with the body's own angular velocity."""
        model, data = self.model, self.data
        mujoco.mj_forward(model, data)
        turn = np.zeros(model.nq)
        for kind, q, v in zip(model.jnt_type, model.jnt_qposadr, model.jnt_dofadr, strict=True):
            if mujoco.mjtJoint(kind) in (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE):
                turn[q] = data.qvel[v]
                continue
            if kind == mujoco.mjtJoint.mjJNT_FREE:
                turn[q : q + 3] = data.qvel[v : v + 3]
                q, v = q + 3, v + 3
            w, x, y, z = data.qpos[q : q + 4]
            turn[q : q + 4] = 0.5 * np.array([[-x, -y, -z], [w, -z, y], [z, w, -x], [-y, x, w]]) @ data.qvel[v : v + 3]
        return np.concatenate([turn, data.qacc, data.act_dot])

    def _normalise(self) -> None:
        if self.model.nq != self.model.nv:
            mujoco.mj_normalizeQuat(self.model, self.data.qpos)

    def _departure(self, state: Array) -> Array:
        origin = np.zeros(len(state))
        origin[: self.model.nq] = self.qpos_0
        return np.abs(state - origin)

    def _take(self, start: Array, K: Array, t: float, step: float) -> Array:
        """The state a step from ``start``, K[0] being its rates there; leaves the engine there and K filled so far."""
        table = self._method
        state = start
        for stage in range(1, table.stages + 1):
            state = start + step * (table.A[stage, :stage] @ K[:stage])
            self._put(state, t + table.c[stage] * step)
            K[stage] = self._flow()
        return state

    def _advance(self, record: Recording) -> Status:
        plan, data = self.schedule, self.data
        t = data.time
        watched = len(self.faces) > 0
        arm = self._last + max(plan.delta_min, plan.delay) if watched else np.inf
        clock = self._clock * plan.clock if np.isfinite(plan.clock) else np.inf
        edge = plan.edges[self._edge] if self._edge < len(plan.edges) else np.inf
        act = self._next_action()
        # an action comes before a look at E at the same instant: it resets the hold
        watched_from = arm if arm < act else np.inf
        target = min(plan.t_end, clock, edge, act)
        self._length = target - t
        fired, status = False, Status.RUNNING
        if self._i == 0 and arm <= t and self._levels()[0].max() >= 0:
            fired, self._length = True, 0.0
        elif target > t:
            fired, status = self._fly(target, watched_from, record)
        self._i += 1
        lands = data.time >= target
        status = self._status() if status == Status.RUNNING else status
        acts = status == Status.RUNNING and lands and data.time >= act
        if acts:
            data.act[self.block.act] = self.block.G @ data.act[self.block.act]
            self._acted += 1
            self._rates = self._flow()
        if status == Status.RUNNING and lands:
            if data.time >= arm:
                fired = fired or bool(self._levels()[0].max() >= 0)
            if data.time >= clock:
                self._clock += 1
                fired = True
            if data.time >= plan.t_end:
                status = Status.COMPLETED
        if fired:
            self._events += 1
            if status == Status.RUNNING and self._events >= plan.events:
                status = Status.REACHED
        due = acts or data.time >= self._next_record - 1e-9 * plan.timestep or status != Status.RUNNING
        self._record(record, fired, due)
        if fired:
            a = data.act[self.block.act]
            a[:] = self.block.J @ a
            self._last, self._next_step, self._fresh = data.time, self._first_step, True
            self._reach[:] = 0.0
        passed = lands and data.time >= edge
        if passed:
            self._edge += 1
            self.block.header[Slot.PHASE] = plan.phases[self._edge]
        if fired or passed:
            self._rates = self._flow()
        return status

    def _fly(self, target: float, arm: float, record: Recording) -> tuple[bool, Status]:
        """One step towards ``target``; whether an event ends it, and whether it could be taken."""
        plan, data = self.schedule, self.data
        t, start = data.time, self._state()
        method = self._method
        K = np.empty((method.rates, len(start)))
        K[0] = self._rates
        room, step, rejected = target - t, self._next_step, False
        while True:
            whole = step >= room
            length = room if whole else room / 2 if step > room / 2 else step
            length = min(length, len(record.dense) // 4 * plan.record_interval)
            whole = length == room
            end = self._take(start, K, t, length)
            reach = np.maximum(self._reach, np.maximum(self._departure(start), self._departure(end)))
            scale = method.allowed * plan.tolerance * (reach + 1e-14 / plan.tolerance * (1 + np.abs(start)))
            error = error_norm(method, K, length, scale)
            if error <= 1:
                break
            factor = max(SHRINKAGE, SAFETY * error**method.exponent) if np.isfinite(error) else SHRINKAGE
            step, rejected = rounded(length * factor), True
            if step < SHORTEST:
                self._put(start, t)
                self._flow()
                return False, Status.COLLAPSED
        self._reach = reach
        growth = min(GROWTH, SAFETY * error**method.exponent) if error > 0 else GROWTH
        proposed = rounded(length * (min(growth, 1.0) if rejected else growth))
        if self._fresh and length < room:
            self._first_step = proposed
        self._next_step = proposed if length == step or rejected else max(proposed, step)
        self._fresh = False
        stop = target if whole else t + length
        for extra in range(method.stages + 1, method.rates):
            self._put(start + length * (method.A[extra, :extra] @ K[:extra]), t + method.c[extra] * length)
            K[extra] = self._flow()
        F = dense(method, start, K, length, end)
        s, exact = self._event(start, F, t, length, arm)
        status = self._samples(record, start, F, t, length, min(s, length))
        if status != Status.RUNNING:
            return False, status
        if s <= length:
            self._polish(start, K, t, s, length, exact)
            return True, Status.RUNNING
        self._put(end, stop)
        self._normalise()
        self._rates = self._flow()
        return False, Status.RUNNING

    def _event(self, start: Array, F: Array, t: float, length: float, arm: float) -> tuple[float, bool]:
        """Where the event function first reaches zero in the step, at ``arm`` or later, counted from the step's start.

        Infinity where it does not; and whether it had been reached before ``arm``.
        """
        at = max((arm - t) / length, 0.0)
        if not at <= 1:
            return np.inf, False
        powers = F.T @ self._method.powers
        powers[:, 0] += start
        a = powers[self.model.nq + self.model.nv :][self.block.act]
        roots = [np.inf]
        for first, last in pairwise(self.block.edges.tolist()):
            E = Polynomial([-1.0])
            for row in self.block.R[first:last]:
                E = E + Polynomial(row @ a) ** 2
            if at > 0 and E(at) >= 0:
                return arm - t, True
            if at < 1 and (root := first_root(np.asarray(E(Polynomial([at, 1 - at])).coef, float))) is not None:
                roots.append(at + (1 - at) * root)
        return min(roots) * length, False

    def _polish(self, start: Array, K: Array, t: float, s: float, length: float, exact: bool) -> None:
        """A step of its own to the event, then Newton's steps until its time is right."""
        again = np.empty_like(K)
        again[0] = K[0]
        limit = NUDGE / self.schedule.rate
        self._take(start, again, t, s)
        self._normalise()
        for _ in range(8):
            self.data.time = t + s
            self._rates = self._flow()
            levels, rates = self._levels()
            E, dE = levels.max(), rates[levels.argmax()]
            if exact or dE <= 0:
                return
            more = -E / dE
            if abs(more) <= EVENT_TOLERANCE or not 0 < s + more < 2 * length:
                return
            s += more
            if abs(more) > limit:
                self._take(start, again, t, s)
                self._normalise()
                continue
            here = self._state()
            self._put(here + more / 2 * self._rates, t + s - more / 2)
            self._put(here + more * self._flow(), t + s)
            self._normalise()
        self._rates = self._flow()

    def _samples(self, record: Recording, start: Array, F: Array, t: float, length: float, stop: float) -> Status:
        """Outputs, and the rows that are due, within the step; leaves the engine where the plant has fallen in it."""
        spacing, j = length / self._method.looks, 1
        margin = 1e-9 * length
        while True:
            sample, row = j * spacing, self._next_record - t
            if min(sample, row) >= stop - margin:
                return Status.RUNNING
            due = row <= sample + 0.25 * spacing
            s = row if due else sample
            if due and s >= stop - margin:
                return Status.RUNNING
            if s >= sample - 0.25 * spacing:
                j += 1
            self._put(within(start, F, s / length), t + s)
            self._normalise()
            mujoco.mj_forward(self.model, self.data)
            if self._status() != Status.RUNNING:
                return self._status()
            self._record(record, False, due)
