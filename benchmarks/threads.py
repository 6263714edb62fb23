"""Independent runs on one thread and on two."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import mujoco
import numpy as np

from benchmarks.row import Row, interleaved, median
from benchmarks.task import three_link
from icmj.engine.closed_loop import ComposedLoop
from icmj.engine.flow import follow
from icmj.simulation.settings import Settings

RUNS = 8
DURATION = 15.0
REPEATS = 9


def rows() -> list[Row]:
    """Time of the same runs on one thread and on two, and the same of bare steps as the machine's own limit."""
    task = three_link()
    loops = [task.loop() for _ in range(RUNS)]
    settings = Settings(duration=DURATION)
    bare = [task.plant.spec.copy().compile() for _ in range(RUNS)]

    def run(loop: ComposedLoop) -> None:
        follow(loop, loop.data(task.x, np.tile(task.x_o, 2)), loop.schedule(settings, 2e-3))

    def step(model: mujoco.MjModel) -> None:
        mujoco.mj_step(model, mujoco.MjData(model), nstep=round(DURATION / 2e-3))

    def on(threads: int, work: Callable[[Any], None], items: list[Any]) -> Callable[[], None]:
        def all_runs() -> None:
            with ThreadPoolExecutor(threads) as pool:
                list(pool.map(work, items))

        return all_runs

    ways = {"1": on(1, run, loops), "2": on(2, run, loops), "bare 1": on(1, step, bare), "bare 2": on(2, step, bare)}
    interleaved(ways, 1)
    times = interleaved(ways, REPEATS)

    def efficiency(one: str, two: str) -> float:
        return median(a / (2 * b) for a, b in zip(times[one], times[two], strict=True))

    limit = efficiency("bare 1", "bare 2")
    note = f"{RUNS} runs of {DURATION:g} s"
    free = "" if limit > 0.95 else "; the machine had not two cores free"
    pairs = f"median of {REPEATS} pairs{free}"
    return [
        Row("threads", "1 thread", median(times["1"]), "s", note),
        Row("threads", "2 threads", median(times["2"]), "s", note),
        Row("threads", "bare mj_step, efficiency of 2 threads", limit, "", "what the machine gives" + free),
        Row("threads", "efficiency of 2 threads", efficiency("1", "2"), "", pairs, 0.9, at_most=False),
    ]
