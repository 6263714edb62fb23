"""A branch of exact cycles against simulating three of its points until they close as well."""

from __future__ import annotations

from pathlib import Path
from time import process_time

import numpy as np

from benchmarks.row import Row
from icmj.case.case import prepare, simulate
from icmj.cycle.follow import follow
from icmj.measurement.measurement import event_states
from icmj.runfile.reading import load_run
from icmj.runfile.schema import RunFile

RUNS = Path(__file__).resolve().parent.parent / "runs"
POINTS = 40
CLOSED = 1e-10  # relative closure of both
LONGER = 1.25  # by which a run that has not closed is made longer
# case, parameter, from, to: one whose cycles attract strongly, one whose cycles attract ever more weakly
BRANCHES = (("three-link-0.9", "b", 0.9, 0.8), ("three-link-0.9", "b", 0.9, 0.6))


def rows() -> list[Row]:
    """Processor time of a branch of 40 cycles, of simulating its first, middle and last one, and their ratio."""
    found = []
    for name, parameter, first, last in BRANCHES:
        run = load_run(RUNS / f"{name}.toml").with_(**{"simulation.limit": 3.0})
        follow(run, parameter, first + 0.1 * (last - first), start_at=first, points=3)  # compile and load
        start = process_time()
        branch = follow(run, parameter, last, start_at=first, points=POINTS)
        walked = process_time() - start
        simulated = sum(_to_closure(run.with_(**{"actual.gain": b})) for b in np.linspace(first, last, 3).tolist())
        what = f"{name}, {parameter} {first:g}–{last:g}"
        found += [
            Row("cycles", f"{what}: {len(branch)} cycles", walked, "s", "processor time, first guess and all"),
            Row(
                "cycles",
                f"{what}: 3 simulations",
                simulated,
                "s",
                f"from the run file's start to a closure of {CLOSED:g}",
            ),
            Row("cycles", f"{what}: ratio", walked / simulated, "", "branch over simulations"),
        ]
    return found


def _to_closure(run: RunFile) -> float:
    """Processor time of the shortest run that closes [s]; the shorter ones tried before are not counted."""
    case, duration = prepare(run), 10.0
    while True:
        start = process_time()
        simulation = simulate(case, "mujoco", duration=duration)
        took = process_time() - start
        states = event_states(simulation, case.system.T_hat)
        if len(states) > 1 and np.abs(states[-1] - states[-2]).max() <= CLOSED * np.abs(states[-1]).max():
            return took
        duration *= LONGER
