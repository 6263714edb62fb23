"""Work and precision: time of one task against the error of its last intervals and of its last peak."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from benchmarks import naive_loop
from benchmarks.python_loop import PythonLoop
from benchmarks.row import Row, least
from benchmarks.scipy_loop import ScipyLoop
from benchmarks.task import Task, three_link
from icmj.engine.flow import Record, follow
from icmj.simulation.settings import Settings

DURATION = 15.0
LAST = 5
REPEATS = 3  # of every way alike
TIMESTEPS = np.array([20, 16, 13, 11, 10, 8, 7, 6, 5, 4.5, 4, 3.5, 3, 2.5, 2]) * 1e-3
PYTHON_TIMESTEPS = np.array([16, 13, 11, 10, 8, 5, 4.5, 4]) * 1e-3
# as fine as the timesteps, and loose enough that the loosest miss the target: nobody is held to more than is asked
RTOL = {
    "RK45": (0.3, 0.1, 0.03, 1e-2, 3e-3, 1e-3, 3e-4, 1e-4, 1e-5, 1e-6, 3e-7, 1e-7, 3e-8, 1e-8),
    "DOP853": (0.3, 0.1, 0.03, 1e-2, 3e-3, 1e-3, 3e-4, 1e-4, 3e-5, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9),
}
ATOL = (1.0, 1e-1, 1e-2, 1e-3)  # relative to rtol; SciPy's default is 1e-3 at its default rtol
GROUP = "work–precision"


@dataclass(frozen=True, eq=False)
class Exact:
    """The last intervals [s] and the last peak [rad], by SciPy's DOP853 at 1e-12."""

    intervals: np.ndarray
    peak: float

    def interval_error(self, times: np.ndarray) -> float:
        """Largest error of the last intervals: one alone may be right by luck."""
        intervals = np.diff(times)[-LAST:]
        return float(np.abs(intervals - self.intervals).max()) if len(intervals) == LAST else float("inf")


@dataclass(frozen=True)
class Point:
    """One setting of one way: its time [s], and errors of interval [s] and peak [rad]."""

    way: str
    setting: str
    seconds: float
    interval: float
    peak: float


def rows() -> list[Row]:
    """The best setting of each way at two interval errors, and how they compare."""
    task = three_link()
    scipy = ScipyLoop(task)
    times, state = scipy.run(DURATION, "DOP853", 1e-12, 1e-15)
    exact = Exact(np.diff(times)[-LAST:], scipy.peak(state, "DOP853", 1e-12, 1e-15))
    points = [*_engine(task, exact), *_python(task, exact), *_scipy(scipy, exact), *_naive(task, exact)]
    table = []
    for target in (1e-6, 1e-8):
        best = {way: _best(points, way, target) for way in dict.fromkeys(p.way for p in points)}
        for way, point in best.items():
            if point is None:
                table.append(Row(GROUP, f"{way} at {target:g} s", None, "ms", "no setting tried is as accurate"))
            else:
                note = f"{point.setting}; interval {point.interval:.1e} s, peak {point.peak:.1e} rad"
                table.append(Row(GROUP, f"{way} at {target:g} s", 1e3 * point.seconds, "ms", note))
        ours = best["icmj"]
        others = [p for way in RTOL if (p := best[f"SciPy {way}"]) is not None]
        if ours is not None and others:
            factor = min(p.seconds for p in others) / ours.seconds
            bound = 6.0 if target == 1e-6 else 5.0
            table.append(Row(GROUP, f"best SciPy / icmj at {target:g} s", factor, "×", ours.way, bound, at_most=False))
        python = best["Python callbacks"]
        if target == 1e-6 and ours is not None and python is not None:
            factor = python.seconds / ours.seconds
            table.append(Row(GROUP, f"Python callbacks / icmj at {target:g} s", factor, "×", "", 6.0, at_most=False))
    table += [
        Row(GROUP, f"naive Euler, {p.setting}", 1e3 * p.seconds, "ms", f"{p.interval:.1e} s, peak {p.peak:.1e}")
        for p in points
        if p.way == "naive Euler"
    ]
    return table


def _best(points: Iterable[Point], way: str, target: float) -> Point | None:
    """The fastest setting of ``way`` whose interval error is at most ``target``."""
    good = [p for p in points if p.way == way and p.interval <= target]
    return min(good, key=lambda p: p.seconds, default=None)


def _engine(task: Task, exact: Exact) -> Iterable[Point]:
    loop = task.loop()
    settings = Settings(duration=DURATION, record_interval=0.01)

    def run(h: float) -> Record:
        return follow(loop, loop.data(task.x, np.tile(task.x_o, 2)), loop.schedule(settings, h))

    for h in TIMESTEPS:
        rows = run(h)
        error = abs(max(rows.y_max[-1, 0], -rows.y_min[-1, 0]) - exact.peak)
        seconds = least(lambda: run(h), REPEATS)  # noqa: B023 - called at once
        yield Point("icmj", f"RK4 {1e3 * h:g} ms", seconds, exact.interval_error(rows.events[:, 0]), error)


def _python(task: Task, exact: Exact) -> Iterable[Point]:
    for way, folded in (("Python callbacks", False), ("folded Python callbacks", True)):
        loop = PythonLoop(task, folded)
        for h in PYTHON_TIMESTEPS:
            times, peak = loop.run(DURATION, h)
            seconds = least(lambda: loop.run(DURATION, h), REPEATS)  # noqa: B023 - called at once
            yield Point(way, f"RK4 {1e3 * h:g} ms", seconds, exact.interval_error(times), abs(peak - exact.peak))


def _scipy(loop: ScipyLoop, exact: Exact) -> Iterable[Point]:
    for method, tolerances in RTOL.items():
        for rtol in tolerances:
            for ratio in ATOL:
                atol = rtol * ratio
                times, state = loop.run(DURATION, method, rtol, atol)
                peak = loop.peak(state, method, rtol, atol)
                seconds = least(lambda: loop.run(DURATION, method, rtol, atol), REPEATS)  # noqa: B023 - called at once
                setting, error = f"rtol {rtol:g}, atol {atol:g}", exact.interval_error(times)
                yield Point(f"SciPy {method}", setting, seconds, error, abs(peak - exact.peak))


def _naive(task: Task, exact: Exact) -> Iterable[Point]:
    for h in (1e-3, 1e-4):
        times, peak = naive_loop.run(task, DURATION, h)
        seconds = least(lambda: naive_loop.run(task, DURATION, h), 1)  # noqa: B023 - called at once
        yield Point("naive Euler", f"{1e3 * h:g} ms", seconds, exact.interval_error(times), abs(peak - exact.peak))
