"""The same closed loop as one would write it with SciPy: ``solve_ivp`` with events, on ``mj_forward``."""

import mujoco
import numpy as np
from scipy.integrate import solve_ivp

from benchmarks.task import Task


class ScipyLoop:
    """Plant, observer and hold as one system, restarted at every event."""

    def __init__(self, task: Task) -> None:
        spec = task.plant.spec.copy()
        spec.compiler.discardvisual = True  # as the closed loop does
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        gains, self.trigger = task.controller.design, task.trigger
        self.b_k = task.plant.linearisation.ports.b[:, None] * gains.k
        self.L, self.A_h = gains.L, task.controller.hold.A_h
        self.A_o, self.Bk = gains.A_o, gains.plant.B @ gains.k
        self.start = np.concatenate([task.x, task.x_o, task.x_o])

        def event(t: float, s: np.ndarray) -> float:
            e = s[12:] - s[6:12]
            return float(e @ (self.trigger.Q_t @ e) - self.trigger.q_t**2)

        event.terminal, event.direction = True, 1  # type: ignore[attr-defined]
        self.event = event

    def flow(self, t: float, s: np.ndarray) -> np.ndarray:
        """d/dt of (q, q̇, x_o, x_h)."""
        data, x_o, x_h = self.data, s[6:12], s[12:]
        data.qpos[:], data.qvel[:] = s[:3], s[3:6]
        data.ctrl[:] = -self.b_k @ x_h
        mujoco.mj_forward(self.model, data)
        rate = np.empty(18)
        rate[:3], rate[3:6] = s[3:6], data.qacc
        rate[6:12] = self.A_o @ x_o - self.Bk @ x_h + self.L @ data.sensordata
        rate[12:] = self.A_h @ x_h
        return rate

    def run(self, duration: float, method: str, rtol: float, atol: float) -> tuple[np.ndarray, np.ndarray]:
        """(event times, state after the last but one event)."""
        t, state, times = 0.0, self.start.copy(), []
        before = last = state
        while True:
            run = solve_ivp(self.flow, (t, duration), state, method, events=self.event, rtol=rtol, atol=atol)
            if run.status != 1:
                return np.array(times), before
            t, state = float(run.t[-1]), run.y[:, -1].copy()
            state[12:] = state[6:12]
            times.append(t)
            before, last = last, state

    def peak(self, state: np.ndarray, method: str, rtol: float, atol: float) -> float:
        """Peak of the first output over the interval that begins at ``state``, from SciPy's dense output."""
        run = solve_ivp(self.flow, (0, 2), state, method, events=self.event, rtol=rtol, atol=atol, dense_output=True)
        return float(np.abs(run.sol(np.linspace(0, run.t[-1], 20001))[0]).max())
