"""The composed loop driven from Python as fast as Python allows: lean callbacks, ``mj_step``, exact events.

The package's own plain-Python loop is an oracle, written for reading; this one is written to compare speed with. It
does what the native loop does: any plant, outputs from the sensors and fresh at every stage, recorded at every step for
their extremes. *Stripped*, it does only what this one plant needs: outputs are a known sum of joint angles, folded
into one matrix with the observer, and nothing is recorded.
"""

from __future__ import annotations

from collections.abc import Callable

import mujoco
import numpy as np

from benchmarks.task import Task
from icmj.engine.callbacks import installed
from icmj.engine.composition import block_of
from icmj.engine.native import extremes

STATE = mujoco.mjtState.mjSTATE_INTEGRATION


class PythonLoop:
    """RK4 with Python callbacks; events located by secant on a shortened step."""

    def __init__(self, task: Task, stripped: bool = False) -> None:
        self.stripped = stripped
        loop = task.loop()
        self.model, self._start = loop.model, lambda: loop.start(task.x, task.x_o, task.x_o)
        block = block_of(self.model)
        assert block is not None
        self.K, self.M, self.N = (np.array(M) for M in (block.K, block.M, block.N))
        self.Q_t, self.q2 = np.array(block.Q_t), task.trigger.q_t**2
        # all three outputs are sums of joint angles, so that they are known after a step, too
        self.C = task.controller.design.plant.C[:, :3].copy()
        self.MN = np.hstack([self.M, self.N @ self.C])

    def _callbacks(self) -> tuple[Callable[..., None], Callable[..., float]]:
        K, M, N, MN = self.K, self.M, self.N, self.MN
        if not self.stripped:

            def control_any(model: mujoco.MjModel, data: mujoco.MjData) -> None:
                mujoco.mj_sensorPos(model, data)
                data.ctrl[:3] = -K @ data.act

            def act_dyn_any(model: mujoco.MjModel, data: mujoco.MjData, actuator: int) -> float:
                data.act_dot[:] = M @ data.act + N @ data.sensordata
                return 0.0

            return control_any, act_dyn_any

        def control(model: mujoco.MjModel, data: mujoco.MjData) -> None:
            data.ctrl[:3] = -K @ data.act

        def act_dyn(model: mujoco.MjModel, data: mujoco.MjData, actuator: int) -> float:
            data.act_dot[:] = MN @ np.concatenate([data.act, data.qpos])
            return 0.0

        return control, act_dyn

    def run(self, duration: float, timestep: float) -> tuple[np.ndarray, float]:
        """(event times, peak of the first output over the last interval; zero if stripped)."""
        model, data = self.model, self._start()
        saved = np.empty(mujoco.mj_stateSize(model, STATE))
        times: list[float] = []
        dense = [np.append(data.time, self.C @ data.qpos)]
        peak = 0.0
        with installed(*self._callbacks()):
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
                if not self.stripped:
                    row = np.empty(4)
                    row[0], row[1:] = data.time, self.C @ data.qpos
                    dense.append(row)
                    if fired:
                        rows = np.array(dense)
                        high, low = extremes(rows[:, 0], rows[:, 1:])
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
