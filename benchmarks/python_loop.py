"""The composed loop driven from Python: RK4 with Python callbacks, ``mj_step``, events as exact as the native loop's.

It does what the native loop does: outputs from the sensors and fresh at every stage, recorded at every step for their
extremes. The equations stand as in the paper; *folded*, they are multiplied out beforehand into one matrix each for
states and outputs, which is as fast as Python gets. (The package's own loop, interpreted, is for debugging, written for
reading, and slower than both.)
"""

from collections.abc import Callable

import mujoco
import numpy as np

from benchmarks.task import Task
from icmj.engine.block import find_block
from icmj.engine.extremes import find_extremes
from icmj.engine.isolation import isolate_engine

STATE = mujoco.mjtState.mjSTATE_INTEGRATION


class PythonLoop:
    """RK4 with Python callbacks; events located by secant on a shortened step."""

    def __init__(self, task: Task, folded: bool) -> None:
        self.folded = folded
        loop = task.loop()
        self.model, self._start = loop.model, lambda: loop.data(task.x, np.tile(task.x_o, 2))
        self.block = find_block(self.model)
        self.controller, self.b = task.controller, task.plant.linearisation.ports.b
        self.Q_t, self.q2 = task.trigger.Q_t, task.trigger.q_t**2
        # all three outputs are sums of joint angles, so that they are known after a step, too
        self.C = task.controller.design.plant.C[:, :3].copy()

    def _callbacks(self) -> tuple[Callable[..., None], Callable[..., float]]:
        gains, A_h = self.controller.design, self.controller.hold.A_h
        b = self.b
        A, B, C, k, L = gains.plant.A, gains.plant.B, gains.plant.C, gains.k, gains.L
        b_k = b[:, None] * k
        assert self.block is not None
        K, M, N = (np.array(matrix) for matrix in (self.block.K, self.block.M, self.block.N))

        def control(model: mujoco.MjModel, data: mujoco.MjData) -> None:
            mujoco.mj_sensorPos(model, data)
            data.ctrl[:3] = -b_k @ data.act[6:]

        def act_dyn(model: mujoco.MjModel, data: mujoco.MjData, actuator: int) -> float:
            x_o, x_h, u = data.act[:6], data.act[6:], data.ctrl[:3] / b
            data.act_dot[:6] = A @ x_o + B @ u - L @ (C @ x_o - data.sensordata)
            data.act_dot[6:] = A_h @ x_h
            return 0.0

        def control_folded(model: mujoco.MjModel, data: mujoco.MjData) -> None:
            mujoco.mj_sensorPos(model, data)
            data.ctrl[:3] = -K @ data.act

        def act_dyn_folded(model: mujoco.MjModel, data: mujoco.MjData, actuator: int) -> float:
            data.act_dot[:] = M @ data.act + N @ data.sensordata
            return 0.0

        return (control_folded, act_dyn_folded) if self.folded else (control, act_dyn)

    def run(self, duration: float, timestep: float) -> tuple[np.ndarray, float]:
        """(event times, peak of the first output over the last interval)."""
        model, data = self.model, self._start()
        saved = np.empty(mujoco.mj_stateSize(model, STATE))
        times: list[float] = []
        dense = [np.append(data.time, self.C @ data.qpos)]
        peak = 0.0
        with isolate_engine(*self._callbacks()):
            E = -self.q2
            while data.time < duration:
                mujoco.mj_getState(model, data, saved, STATE)
                model.opt.timestep = timestep
                mujoco.mj_step(model, data)
                E_1 = self._event(data)
                fired = E_1 >= 0
                if fired:
                    self._locate(data, saved, timestep, E, E_1)
                    times.append(data.time)
                    data.act[6:] = data.act[:6]
                    E_1 = -self.q2
                row = np.empty(4)
                row[0], row[1:] = data.time, self.C @ data.qpos
                dense.append(row)
                if fired:
                    rows = np.array(dense)
                    (high,), (low,) = find_extremes(rows[:, 0], rows[:, 1:], np.array([[0, len(rows) - 1]]))
                    peak, dense = max(high[0], -low[0]), dense[-1:]
                E = E_1
        return np.array(times), peak

    def _event(self, data: mujoco.MjData) -> float:
        e = data.act[6:] - data.act[:6]
        return float(e @ (self.Q_t @ e)) - self.q2

    def _locate(self, data: mujoco.MjData, saved: np.ndarray, step: float, E_0: float, E_1: float) -> None:
        """Leave the state where E = 0, by the secant method from both ends of the step."""
        s_0, s_1 = 0.0, step
        for _ in range(8):
            s = s_1 - E_1 * (s_1 - s_0) / (E_1 - E_0)
            mujoco.mj_setState(self.model, data, saved, STATE)
            self.model.opt.timestep = s
            mujoco.mj_step(self.model, data)
            s_0, E_0, s_1, E_1 = s_1, E_1, s, self._event(data)
            if abs(s_1 - s_0) < 1e-12 or E_1 == E_0:
                break
