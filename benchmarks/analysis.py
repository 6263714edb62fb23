"""Time of the linear analysis: ``python benchmarks/analysis.py`` prints it, ``rows()`` returns it.

The plant is the three-link model from its MJCF file, linearised and designed on before the clock starts; then standing
chains of ever more links, to see how the analysis grows with the number of states.
"""

import statistics
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

from icmj import EventTrigger, LinearPlant, design_lq, output_weight
from icmj.engine.linearisation import linearise
from icmj.engine.model import load_spec
from icmj.theory.crossings import search
from icmj.theory.error_system import ErrorSystem, error_system
from icmj.theory.event_maps import compute_jacobians, compute_multipliers
from icmj.theory.flow import make_flow
from icmj.theory.locus import follow_locus
from icmj.theory.orbit import compute_orbit
from icmj.theory.prediction import find_critical_crossing, predict

MODELS = Path(__file__).resolve().parent.parent / "models"
REPEATS = 21
DELTA_MAX = 3.0
LINKS = (6, 12, 27)


def three_link(gain: float = 0.9) -> ErrorSystem:
    """The three-link error system with every joint torque scaled by ``gain``."""
    assumed = linearise(load_spec(MODELS / "three_link.xml").compile(), "upright").plant
    actual = assumed.scaled(gain)
    return error_system(actual, design_lq(assumed, R_c=5e-7, R_o=2e-7))


def chain(links: int, gain: float = 1.0) -> LinearPlant:
    """A standing chain of equal links, 80 kg and 1.5 m in all, held at its upper joints; 2 × ``links`` states.

    Lagrange's equations in the segment angles to the vertical, linearised upright; inputs are the joint torques.
    """
    mass, length = 80 / links, 1.5 / links
    lever = length * (np.tri(links, k=-1) + np.eye(links) / 2)  # of each segment's angle on each centre of mass
    M = mass * lever.T @ lever + np.eye(links) * mass * length**2 / 12
    gravity = 9.81 * mass * lever.sum(axis=0)
    joints = np.eye(links) - np.eye(links, k=-1)
    topple = 9.81 * mass * np.array([lever[j:, j:].sum() for j in range(links)])
    stiffness = joints.T @ np.diag(0.8 * topple * (np.arange(links) > 0)) @ joints
    damping = joints.T @ np.diag(0.02 * topple) @ joints
    none, one = np.zeros((links, links)), np.eye(links)
    A = np.block([[-np.linalg.solve(M, damping), np.linalg.solve(M, np.diag(gravity) - stiffness)], [one, none]])
    return LinearPlant(A, gain * np.vstack([np.linalg.solve(M, joints.T), none]), np.hstack([none, one]))


def standing(links: int, gain: float = 0.9) -> ErrorSystem:
    """The error system of such a chain with every joint torque scaled by ``gain``."""
    return error_system(chain(links, gain), design_lq(chain(links), R_c=5e-7, R_o=2e-7))


def analyse(system: ErrorSystem, trigger: EventTrigger) -> None:
    """Crossings to 3 s, orbit and multipliers, from the error system on."""
    prepared = make_flow(system.A_C)
    critical, _ = find_critical_crossing(search(system, DELTA_MAX, prepared=prepared).crossings)
    assert critical is not None
    found = compute_orbit(system, trigger, critical.delta, int(critical.kind), prepared=prepared)
    compute_multipliers(compute_jacobians(system, trigger, found, prepared=prepared)[0])


def timed(run: Callable[[], object], repeats: int = REPEATS) -> tuple[float, float]:
    """Least and median time of this process for ``run`` [s], after one run that is not counted."""
    run()
    times = []
    for _ in range(repeats):
        start = time.process_time()
        run()
        times.append(time.process_time() - start)
    return min(times), statistics.median(times)


def rows() -> list[tuple[str, float, str]]:
    """(name, median seconds, note) of each part; the first row is the one with a bound, 50 ms."""
    system = three_link()
    trigger = EventTrigger(output_weight(system.design), 0.01)
    parts: list[tuple[str, Callable[[], object], str]] = [
        ("three-link analysis", lambda: analyse(system, trigger), "crossings to 3 s, orbit, multipliers; bound 50 ms"),
        ("crossings", lambda: search(system, DELTA_MAX), "to 3 s"),
        ("locus", lambda: follow_locus(system, DELTA_MAX), "256 points, branches followed"),
        ("whole prediction", lambda: predict(system, trigger), "as the study calls it"),
    ]
    table = []
    for name, run, note in parts:
        least, median = timed(run)
        table.append((name, median, f"{note}; least of {REPEATS}: {1e3 * least:.1f} ms"))
    for links in LINKS:
        large = standing(links)
        rule = EventTrigger(output_weight(large.design), 0.01)
        least, median = timed(partial(predict, large, rule), repeats=1 if links > 20 else 3)
        name = f"{2 * links} states"
        table.append((name, median, f"whole prediction of a chain of {links} links; least: {1e3 * least:.0f} ms"))
    return table


if __name__ == "__main__":
    for name, seconds, note in rows():
        print(f"{name:22s} {1e3 * seconds:7.1f} ms   {note}")
