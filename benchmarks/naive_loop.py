"""The closed loop as one writes it first: Euler steps with a Python callback that looks for events once a step."""

import mujoco
import numpy as np

from benchmarks.task import Task
from icmj.engine.isolation import isolate_engine


def run(task: Task, duration: float, timestep: float) -> tuple[np.ndarray, float]:
    """(event times, peak of the first output over the last interval)."""
    model = task.plant.spec.copy().compile()
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_EULER
    model.opt.timestep = timestep
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = task.x[:3], task.x[3:]
    gains, trigger, A_h = task.controller.design, task.trigger, task.controller.hold.A_h
    b = task.plant.linearisation.ports.b
    x_o, x_h = task.x_o.copy(), task.x_o.copy()
    times: list[float] = []
    peak = last_peak = 0.0

    def control(model: mujoco.MjModel, data: mujoco.MjData) -> None:
        nonlocal x_o, x_h, peak, last_peak
        e = x_h - x_o
        y = data.sensordata
        peak = max(peak, abs(y[0]))
        if e @ trigger.Q_t @ e >= trigger.q_t**2:
            times.append(data.time)
            x_h = x_o.copy()
            last_peak, peak = peak, abs(y[0])
        u = -gains.k @ x_h
        data.ctrl[:] = b * u
        x_o = x_o + timestep * (gains.plant.A @ x_o + gains.plant.B @ u - gains.L @ (gains.plant.C @ x_o - y))
        x_h = x_h + timestep * (A_h @ x_h)

    with isolate_engine(control):
        for _ in range(round(duration / timestep)):
            mujoco.mj_step(model, data)
    return np.array(times), last_peak
