"""The exact simulation of the linear plant: times real time, and beside what others need for the same loop."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from benchmarks.others import LAST, SETTINGS, LinearTask, measured
from benchmarks.row import Row, interleaved, least
from benchmarks.task import three_link
from icmj import LinearPlant, Settings, SwitchingPD
from icmj.linear.loop import make_linear_loop
from icmj.linear.open_loop import open_loop
from icmj.linear.run import simulate, simulate_tapped

DURATION = 60.0
COMPARED = 15.0
REPEATS = 200
FASTER = 1e4  # times real time, at least
TARGETS = (1e-6, 1e-8)
GROUP = "linear plant"


def rows() -> list[Row]:
    """Speed of the compiled simulation, of single intervals, and of others."""
    task = three_link()
    plant, controller = task.plant.linearisation.plant, task.controller
    settings = Settings(duration=DURATION, record_interval=0.01, limit=10.0)
    start = {"x0": task.x, "x_o0": task.x_o}
    sparse = replace(settings, record_interval=DURATION)
    fly = open_loop(plant, controller, settings)

    def chain() -> None:
        x, x_o, t = task.x, task.x_o, 0.0
        while t < DURATION:
            flight = fly(x, x_o)
            x, x_o, t = flight.x, flight.x_o, t + flight.length

    ways: dict[str, Callable[[], object]] = {
        "events alone": lambda: simulate(plant, controller, sparse, **start),
        "with a row every 10 ms": lambda: simulate(plant, controller, settings, **start),
        "interval by interval": chain,
    }
    interleaved(ways, 2)
    fast = interleaved(ways, REPEATS)
    run = simulate(plant, controller, settings, **start)
    note = f"{len(run.events)} events in {DURATION:g} s of the three-link; least of {REPEATS}, preparation and all"
    table = [
        Row(GROUP, f"compiled, {way}", DURATION / min(times), "× time", note, FASTER if index < 2 else None, False)
        for index, (way, times) in enumerate(fast.items())
    ]
    return table + _tapped() + _others(task.x, task.x_o)


def _tapped() -> list[Row]:
    """A person of one link under switched feedback of delayed outputs (docs/controllers.md)."""
    A, outputs = np.array([[0.0, 1.0], [1.962, -1 / 15]]), ("theta", "omega")
    person = LinearPlant(A, np.array([0.0, 1 / 60]), np.eye(2), ("lean", "lean_rate"), ("ankle",), outputs)
    law = SwitchingPD(person, *outputs, P=147.15, D=10.0, delay=0.2, slope=-0.4, dead_zone=0.004)
    settings = Settings(duration=DURATION, record_interval=0.01)
    fast = least(lambda: simulate_tapped(person, law, settings, x0=[0.01, 0.0]), REPEATS)
    run = simulate_tapped(person, law, settings, x0=[0.01, 0.0])
    note = f"{len(run.events)} switches in {DURATION:g} s of one link, with a row every 10 ms"
    return [Row(GROUP, "delayed feedback, switched", DURATION / fast, "× time", note)]


def _others(x: np.ndarray, x_o: np.ndarray) -> list[Row]:
    task = three_link()
    plant, controller = task.plant.linearisation.plant, task.controller
    loop = make_linear_loop(plant, controller)
    settings = Settings(duration=COMPARED, record_interval=COMPARED, limit=10.0)
    exact = simulate(plant, controller, settings, x0=x, x_o0=x_o).events.interval[-LAST:]
    ours = least(lambda: simulate(plant, controller, settings, x0=x, x_o0=x_o), 50)
    table = [Row(GROUP, f"icmj, {COMPARED:g} s", 1e3 * ours, "ms", "exact")]
    found = measured(LinearTask(loop.M, controller.faces.R, loop.state(x, np.concatenate([x_o, x_o])), COMPARED), exact)
    for way, (package, _) in SETTINGS.items():
        if way not in found:
            table.append(Row(GROUP, way, None, "ms", f"skipped: {package} is not installed (see --help)"))
            continue
        for target in TARGETS:
            good = [(seconds, tolerance, error) for tolerance, seconds, error in found[way] if error <= target]
            name = f"{way} at {target:g} s"
            if not good:
                table.append(Row(GROUP, name, None, "ms", "no tolerance tried is as accurate"))
                continue
            seconds, tolerance, error = min(good)
            table.append(Row(GROUP, name, 1e3 * seconds, "ms", f"tolerance {tolerance:g}; interval {error:.1e} s"))
    return table
