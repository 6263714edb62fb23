"""What noise adds to the engine's steps."""

from collections.abc import Callable
from pathlib import Path

import numpy as np

import icmj
from benchmarks.row import Row, interleaved, median
from icmj.engine.closed_loop import close_loop
from icmj.engine.flow import follow

NOISY = Path(__file__).resolve().parent.parent / "benchmarks" / "standing.toml"
MINUTES = 7  # repeats of a minute with noise
NOISE = 1.3


def rows() -> list[Row]:
    """A minute of quiet standing, with its six noises and without."""
    runs: dict[str, Callable[[], object]] = {}
    whole = icmj.load_run(NOISY)
    for name, run in {"noisy": whole, "quiet": whole.with_(**{"simulation.disturbance": ()})}.items():
        case = icmj.prepare(run)
        assert case.actual is not None
        loop = close_loop(case.actual, case.controller, case.settings)
        schedule = loop.schedule(case.settings, float(case.settings.timestep or loop.model.opt.timestep))
        a = np.zeros(loop.block.act.stop - loop.block.act.start)
        x = np.eye(1, loop.plant.linearisation.plant.n)[0] * 0.002
        runs[name] = lambda loop=loop, x=x, a=a, schedule=schedule: follow(loop, loop.data(x, a), schedule)
    interleaved(runs, 1)
    times = interleaved(runs, MINUTES)
    ratio = median(a / b for a, b in zip(times["noisy"], times["quiet"], strict=True))
    note = f"{NOISY.stem}, six noises of 60 sinusoids, {1e3 * median(times['noisy']):.0f} ms a minute"
    return [Row("per step", "engine with noise / without", ratio, "×", note, NOISE)]
