"""What lies between the engine's stages: of a step that adapts, against those that it calls; of noise, against none."""

from collections.abc import Callable
from pathlib import Path

import numpy as np

import icmj
from benchmarks.row import Row, interleaved, median
from benchmarks.task import three_link
from icmj.engine.closed_loop import close_loop
from icmj.engine.native.adapted_steps import AdaptedSteps
from icmj.engine.native.state import neighbours_of, rates_at
from icmj.engine.schedule import recording
from icmj.simulation.native.loop import Status
from icmj.simulation.settings import Settings

DURATION, RECORD_INTERVAL = 15.0, 0.01
REPEATS = 30
NOISY = Path(__file__).resolve().parent.parent / "benchmarks" / "standing.toml"
MINUTES = 7  # repeats of a minute with noise
STAGES, NOISE = 1.6, 1.3


def rows() -> list[Row]:
    """Both, in turns."""
    return [*(row for tolerance in (1e-6, 1e-8) for row in _adaptive(tolerance)), *_noisy()]


def _adaptive(tolerance: float) -> list[Row]:
    """A step with rows and outputs' samples in it, against the engine's rates at the states of the same motion."""
    task = three_link()
    loop = task.loop()
    schedule = loop.schedule(Settings(duration=DURATION, record_interval=RECORD_INTERVAL), 1e-2, tolerance)
    data = loop.data(task.x, np.tile(task.x_o, 2))
    record = recording(8000, loop.model.nsensordata, loop.width)
    steps = passes = 0
    with loop.ready():
        stepper = loop.stepper(data, schedule)
        assert isinstance(stepper, AdaptedSteps)

        def run() -> None:
            nonlocal steps, passes
            loop.place(data, task.x, np.tile(task.x_o, 2))
            stepper.begin()
            record.clear()
            before = stepper.passes
            assert stepper.advance(record, 8000) == Status.COMPLETED
            steps, passes = int(record.count[3]), stepper.passes - before

        run()
        states = record.rows[: record.count[1], 1 : loop.width - loop.model.nsensordata].copy()
        engine, still = (
            neighbours_of(loop.model, loop.data(task.x, np.tile(task.x_o, 2))),
            np.zeros((1, states.shape[1])),
        )
        runs = {"run": run, "stages": lambda: rates_at(engine, states, still)}
        interleaved(runs, 3)
        times = interleaved(runs, REPEATS)
    # the least of each: a turn is short, and other work may take the processor in the middle of it
    whole, stage = min(times["run"]), min(times["stages"]) / len(states)
    step, ratio = 1e6 * whole / steps, whole / (passes * stage)
    note = f"tolerance {tolerance:g}, {steps} steps with {passes} stages of {1e6 * stage:.2f} µs, {len(states)} rows"
    return [
        Row("per step", f"adaptive step at {tolerance:g}", step, "µs", note),
        Row("per step", f"adaptive step at {tolerance:g} / its stages", ratio, "×", "of the engine", STAGES),
    ]


def _noisy() -> list[Row]:
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
        runs[name] = lambda loop=loop, x=x, a=a, schedule=schedule: loop.run(loop.data(x, a), schedule)
    interleaved(runs, 1)
    times = interleaved(runs, MINUTES)
    ratio = median(a / b for a, b in zip(times["noisy"], times["quiet"], strict=True))
    note = f"{NOISY.stem}, six noises of 60 sinusoids, {1e3 * median(times['noisy']):.0f} ms a minute"
    return [Row("per step", "engine with noise / without", ratio, "×", note, NOISE)]
