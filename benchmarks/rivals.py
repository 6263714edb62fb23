"""The other controllers of the one-link person beside the event-driven one: the same body, delay and seconds."""

from collections.abc import Callable
from pathlib import Path
from typing import Any, Literal

from benchmarks.row import Row, interleaved, median
from icmj import load_run, prepare, simulate

RUNS = Path(__file__).resolve().parent.parent / "runs" / "rivals"
GROUP = "rivals"
EVENT, RIVALS = "one-link-event", ("one-link-switching", "one-link-predictor", "one-link-delayed-pd")
DURATION, REPEATS = 120.0, 7
NOISE = {"kind": "noise", "input": "ankle_torque", "size": 0.5, "bandwidth": 5.0, "seed": 1}
ASKED = 2.0  # times the event-driven one, at most
PLANTS: tuple[Literal["linear", "mujoco"], ...] = ("linear", "mujoco")


def rows() -> list[Row]:
    """How much longer each takes than the event-driven controller, on both plants, with noise and without."""
    found = []
    for words, noises in (("quiet", []), ("noise", [NOISE])):
        for plant in PLANTS:
            ways: dict[str, Callable[[], object]] = {name: _run(name, noises, plant) for name in (EVENT, *RIVALS)}
            interleaved(ways, 1)
            times = interleaved(ways, REPEATS)
            for name in RIVALS:
                ratio = median(a / b for a, b in zip(times[name], times[EVENT], strict=True))
                what = f"{name.removeprefix('one-link-')} / event, {plant}, {words}"
                found.append(Row(GROUP, what, ratio, "×", f"{DURATION:g} s; median of {REPEATS} turns", ASKED))
    return found


def _run(name: str, noises: list[Any], plant: Literal["linear", "mujoco"]) -> Callable[[], object]:
    changes = {"simulation.duration": DURATION, "simulation.disturbance": noises}
    case = prepare(load_run(RUNS / f"{name}.toml").with_(**changes))
    return lambda: simulate(case, plant)
