"""Closed-loop time per step, events and recording decision included, against bare steps of the same plant."""

from __future__ import annotations

import mujoco
import numpy as np

from benchmarks.row import Row, interleaved, median
from benchmarks.task import three_link
from icmj.engine.callbacks import installed
from icmj.engine.native import NativeLoop, callbacks
from icmj.engine.recording import Status, recording
from icmj.engine.reference import ReferenceLoop, act_dyn, control
from icmj.runfile import SimulationSettings

STEPS = 2000
REPEATS = 60
BOUND = 1.2


def rows() -> list[Row]:
    """Time per step of both loops and of the bare plant, in turns."""
    task = three_link()
    bare = task.plant.spec.copy().compile()
    state = mujoco.MjData(bare)
    loop, python = task.loop(), task.loop(native=False)
    model = loop.model
    record = recording(STEPS, 3, 1 + model.nq + model.nv + model.na + 3)
    schedule = loop.schedule(SimulationSettings(duration=1e6), model.opt.timestep)
    point = task.plant.linearisation.point.qpos
    with installed(*callbacks()):
        native = NativeLoop(model, loop.start(task.x, task.x_o, task.x_o), schedule, point)
    with installed(control, act_dyn):
        oracle = ReferenceLoop(python.model, python.start(task.x, task.x_o, task.x_o), schedule, point)
    events = 0

    def step_bare() -> None:
        mujoco.mj_resetData(bare, state)
        state.qpos[:] = task.x[:3]
        mujoco.mj_step(bare, state, nstep=STEPS)

    def step_native() -> None:
        nonlocal events
        record.clear()
        with installed(*callbacks()):
            assert native.advance(record, STEPS) == Status.RUNNING
        events += int(record.count[2])

    def step_python() -> None:
        record.clear()
        with installed(control, act_dyn):
            assert oracle.advance(record, STEPS // 20) == Status.RUNNING

    runs = {"bare": step_bare, "native": step_native}
    interleaved(runs, 3)
    times = interleaved(runs, REPEATS)
    slow = interleaved({"bare": step_bare, "python": step_python}, 5)
    microseconds = {name: 1e6 * median(values) / STEPS for name, values in times.items()}
    ratio = median(np.array(times["native"]) / np.array(times["bare"]))
    ratio_python = 20 * median(np.array(slow["python"]) / np.array(slow["bare"]))
    group = "per step"
    return [
        Row(group, "bare mj_step(nstep=…)", microseconds["bare"], "µs", "three-link, RK4, median"),
        Row(group, "closed loop", microseconds["native"], "µs", f"{events} events located on the way"),
        Row(group, "closed loop / bare", ratio, "×", f"median of {REPEATS} pairs in turns", BOUND),
        Row(group, "Python callbacks and loop / bare", ratio_python, "×", "the oracle"),
    ]
