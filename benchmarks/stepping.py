"""Closed-loop time per step, events and recording decision included, against bare steps of the same plant."""

from collections.abc import Callable

import mujoco
import numpy as np

from benchmarks import overhead
from benchmarks.python_loop import PythonLoop
from benchmarks.row import Row, interleaved, median
from benchmarks.task import three_link
from icmj.engine.flow import CHUNK, Flow
from icmj.simulation.native.loop import Status
from icmj.simulation.settings import Settings

STEPS = CHUNK
REPEATS = 60
BOUND = 1.1


def rows() -> list[Row]:
    """Time per step of both loops and of the bare plant, in turns."""
    task = three_link()
    spec = task.plant.spec.copy()
    bare = spec.compile()
    spec.compiler.discardvisual = True
    lean = spec.compile()
    loop, python, folded = task.loop(), PythonLoop(task, False), PythonLoop(task, True)
    model = loop.model
    schedule = loop.schedule(Settings(duration=1e4), model.opt.timestep)
    with loop.ready():
        native = Flow(loop, loop.data(task.x, np.tile(task.x_o, 2)), schedule)
    events = 0

    def stepping(plant: mujoco.MjModel) -> Callable[[], None]:
        state = mujoco.MjData(plant)

        def step() -> None:
            mujoco.mj_resetData(plant, state)
            state.qpos[:] = task.x[:3]
            mujoco.mj_step(plant, state, nstep=STEPS)

        return step

    def step_native() -> None:
        nonlocal events
        native.record.clear()
        with loop.ready():
            assert native.advance() == Status.RUNNING
        events += int(native.record.count[2])

    def in_python(loop: PythonLoop) -> Callable[[], None]:
        return lambda: loop.run(STEPS // 20 * model.opt.timestep, model.opt.timestep) and None

    runs = {"bare": stepping(bare), "lean": stepping(lean), "native": step_native}
    interleaved(runs, 3)
    times = interleaved(runs, REPEATS)
    slow = interleaved({"bare": stepping(bare), "python": in_python(python), "folded": in_python(folded)}, 5)

    def ratio_of(times: dict[str, list[float]], one: str, other: str) -> float:
        return median(a / b for a, b in zip(times[one], times[other], strict=True))

    microseconds = {name: 1e6 * median(values) / STEPS for name, values in times.items()}
    ratio, like_for_like = (ratio_of(times, "native", name) for name in ("bare", "lean"))
    ratio_python, ratio_folded = (20 * ratio_of(slow, name, "bare") for name in ("python", "folded"))
    group, skips = "per step", "like for like; it skips stages that have nothing to do"
    return [
        Row(group, "bare mj_step(nstep=…)", microseconds["bare"], "µs", "three-link, RK4, median"),
        Row(group, "bare, without visual geoms", microseconds["lean"], "µs", "as the closed loop leaves them out"),
        Row(group, "closed loop", microseconds["native"], "µs", f"{events} events located on the way"),
        Row(group, "closed loop / bare", ratio, "×", f"median of {REPEATS} turns", BOUND),
        Row(group, "closed loop / bare without visual geoms", like_for_like, "×", skips, BOUND),
        Row(group, "Python callbacks and loop / bare", ratio_python, "×", "equations as in the paper"),
        Row(group, "folded Python callbacks and loop / bare", ratio_folded, "×", "equations multiplied out"),
        *overhead.rows(),
    ]
