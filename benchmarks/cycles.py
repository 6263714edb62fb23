"""A branch of exact cycles against simulating three of its points until they close as well, both from run files."""

from pathlib import Path
from time import process_time

import numpy as np

from benchmarks.row import Row
from icmj import Case, RunFile, follow, load_run, prepare, simulate
from icmj.cycle.parameter import find_parameter
from icmj.measurement.measurement import event_states

RUNS = Path(__file__).resolve().parent.parent / "runs"
POINTS = 40
CLOSED = 1e-10  # relative closure of both
LONGER = 1.25  # by which a run that has not closed is made longer
# case, parameter, from, to, and whether simulating is dear there: cycles that attract ever more weakly
BRANCHES = (
    ("three-link-0.9", "b", 0.9, 0.6, True),
    ("three-link-1.1", "b", 1.1, 1.3, True),
    ("three-link-0.9", "b", 0.9, 0.8, False),
    ("three-link-0.9", "q_t", 0.01, 0.3, False),
)


def rows() -> list[Row]:
    """Processor time of a branch of 40 cycles, of simulating its first, middle and last one, and their ratio."""
    found = []
    for name, of, first, last, weak in BRANCHES:
        run = load_run(RUNS / f"{name}.toml").with_(**{"simulation.limit": 3.0})
        follow(run, of, first + 0.1 * (last - first), start_at=first, points=3)  # compile and load
        start = process_time()
        branch = follow(run, of, last, start_at=first, points=POINTS)
        walked = process_time() - start
        simulated = _three(run, of, first, last)
        what = f"{name}, {of} {first:g}–{last:g}"
        bound = 1.0 if weak else None
        found += [
            Row("cycles", f"{what}: {len(branch)} cycles", walked, "s", "processor time, first guess and all"),
            Row("cycles", f"{what}: 3 simulations", simulated, "s", f"shortest that close to {CLOSED:g}, prepared"),
            Row("cycles", f"{what}: ratio", walked / simulated, "", "branch over simulations", bound),
        ]
    return found


def _three(run: RunFile, name: str, first: float, last: float) -> float:
    """Processor time of simulating three cycles [s]."""
    total, case = 0.0, None
    for value in np.linspace(first, last, 3).tolist():
        took, case = _to_closure(find_parameter(name).put(run, value), case)
        total += took
    return total


def _to_closure(run: RunFile, like: Case | None) -> tuple[float, Case]:
    """Processor time of the shortest run that closes [s], and its case; shorter ones tried before are not counted."""
    start = process_time()
    case = prepare(run, like=like)
    prepared, duration = process_time() - start, 10.0
    while True:
        start = process_time()
        simulation = simulate(case, "mujoco", duration=duration)
        took = process_time() - start
        states = event_states(simulation, case.system.T_hat)
        if len(states) > 1:
            closures = [np.abs(states[-1] - sign * states[-2]).max() for sign in (1, -1)]
            if min(closures) <= CLOSED * np.abs(states[-1]).max():
                return prepared + took, case
        duration *= LONGER
