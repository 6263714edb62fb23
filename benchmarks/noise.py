"""A person who stands quietly under noise: the exact simulation beside Euler–Maruyama steps."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from resource import RUSAGE_CHILDREN, RUSAGE_SELF, getrusage

import numpy as np
from scipy.integrate import solve_ivp

from benchmarks.euler_maruyama import EulerMaruyama
from benchmarks.row import Row, interleaved, median
from icmj import Case, load_run, prepare, simulate_many
from icmj.linear.simulator import Simulator
from icmj.simulation.disturbance import make_disturbance, make_reading_error
from icmj.simulation.sources import Gaussian
from icmj.simulation.start import start_states

RUN = Path(__file__).resolve().parent.parent / "benchmarks" / "standing.toml"
GROUP = "noise"
STEP, INTERVAL = 2e-3, 1e-2
REPEATS = 60
SHORT = 1.6  # s: before rounding, which noise and events magnify, is all that is left to compare
FASTER = 2e3  # times real time, at least


def rows() -> list[Row]:
    """Speed of both, and what either errs by under one and the same noise."""
    case = prepare(load_run(RUN))
    plant, controller = case.actual.linearisation.plant, case.controller
    settings = case.settings
    x, a = start_states(plant, controller, settings, None, None, None)
    sources = settings.disturbance
    loop = EulerMaruyama(plant, controller, *np.array([(of.size, of.corner) for of in sources]).T)
    prepared = Simulator(plant, controller, settings, INTERVAL)
    w = prepared.loop.state(x, a)
    drawn = tuple(
        Gaussian(input=of.input, output=of.output, size=of.size, corner=of.corner, seed=of.seed) for of in sources
    )
    gaussian = Simulator(plant, controller, replace(settings, disturbance=drawn), INTERVAL)
    ways = {
        "icmj": lambda: prepared.run(w),
        "icmj, Gaussian noise": lambda: gaussian.run(w),
        "Euler–Maruyama": lambda: loop.run(x, settings.duration, STEP, INTERVAL, 1),
    }
    interleaved(ways, 3)
    times = interleaved(ways, REPEATS)
    speed = {way: settings.duration / min(seconds) for way, seconds in times.items()}
    ratio = median(a / b for a, b in zip(times["icmj"], times["Euler–Maruyama"], strict=True))

    like = median(a / b for a, b in zip(times["icmj, Gaussian noise"], times["Euler–Maruyama"], strict=True))
    torque, reading = make_disturbance(sources, plant.inputs), make_reading_error(sources, plant.outputs)

    def noise(t: np.ndarray | float) -> np.ndarray:
        return np.concatenate([torque(t), reading(t)], axis=-1)

    exact = _reference(loop, plant.n, x, noise)
    ours = prepared.run(w)[0].event_t
    theirs = loop.run(x, SHORT, STEP, INTERVAL, 1, noise(STEP * np.arange(round(SHORT / STEP) + 1)))[0][:, 0]
    known = len(exact)
    errors = [float(np.abs(found[:known] - exact).max()) for found in (ours, theirs)]
    what = f"a minute of {RUN.stem}: {len(sources)} noises, rows every {1e3 * INTERVAL:g} ms; least of {REPEATS}"
    against = f"largest of the first {known} events' times, against DOP853 under the same noise"
    return [
        Row(GROUP, "icmj", speed["icmj"], "× time", what, FASTER, False),
        Row(GROUP, "icmj, Gaussian noise", speed["icmj, Gaussian noise"], "× time", "of Euler–Maruyama's law"),
        Row(GROUP, "Euler–Maruyama", speed["Euler–Maruyama"], "× time", f"steps of {1e3 * STEP:g} ms in numba"),
        Row(GROUP, "icmj / Euler–Maruyama", ratio, "×", f"median of {REPEATS} turns", 1.0),
        Row(GROUP, "the same under Gaussian noise", like, "×", "its noise every 10 ms, theirs every 2 ms", 1.0),
        Row(GROUP, "icmj, error", errors[0], "s", against),
        Row(GROUP, "Euler–Maruyama, error", errors[1], "s", against),
        *_many(case),
    ]


def _reference(loop: EulerMaruyama, n: int, x: np.ndarray, noise: Callable[[float], np.ndarray]) -> np.ndarray:
    """Times of the events until ``SHORT`` by SciPy's integrator, restarted wherever something is due."""
    n_hat = len(loop.predictor)
    w, t, action, ready, times = np.concatenate([x, np.zeros(2 * n_hat)]), 0.0, np.inf, loop.least, []
    pending = np.zeros(0)

    def level(t: float, w: np.ndarray) -> float:
        e = loop.R @ (w[n + n_hat :] - w[n : n + n_hat])
        return float(e @ e - 1)

    level.terminal, level.direction = True, 1  # type: ignore[attr-defined]
    while t < SHORT:
        if t >= ready and level(t, w) >= 0:
            times.append(t)
            pending, action, ready = loop.predictor @ w[n:], t + loop.delay, t + loop.least
        until = min(action, ready if t < ready else SHORT, SHORT)
        done = solve_ivp(
            lambda t, w: loop.M @ w + loop.D @ noise(t), (t, until), w, "DOP853", events=level if t >= ready else None,
            rtol=1e-12, atol=1e-15, max_step=0.02,
        )  # fmt: skip
        t, w = float(done.t[-1]), done.y[:, -1].copy()
        if done.status == 1:
            continue
        if t == action:
            w[n + n_hat :], action = pending, np.inf
    return np.array(times)


def _many(case: Case) -> list[Row]:
    """Runs with their measures, by two processes: many less few, so that what starting them takes is left out."""
    few, many = 24, 224
    before = getrusage(RUSAGE_CHILDREN)
    taken = [before.ru_utime + before.ru_stime]
    for n in (few, many):
        simulate_many(case, n, keep=("sway",), jobs=2)
        used = getrusage(RUSAGE_CHILDREN)
        taken.append(used.ru_utime + used.ru_stime)
    each = (taken[2] - 2 * taken[1] + taken[0]) / (many - few) / 2
    own, theirs = (getrusage(who).ru_maxrss / 1e6 for who in (RUSAGE_SELF, RUSAGE_CHILDREN))
    note = f"processor time of each of two processes; {many - few} runs, extrapolated"
    return [
        Row(GROUP, "10,000 runs with their sway", 1e4 * each, "s", note, 300),
        Row(GROUP, "memory of both processes", 2 * theirs, "GB", f"at most; {own:.2g} GB of the one that asks", 1.0),
    ]
