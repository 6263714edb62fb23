"""Measures of the centre of pressure of a simulated person, beside what else is told of a run."""

from __future__ import annotations

import numpy as np

from icmj.case.case import Case
from icmj.engine.plant import MujocoPlant
from icmj.engine.reaction import ground_force, reaction
from icmj.errors import IcmjError
from icmj.measurement.sway import sway_numbers
from icmj.simulation.simulation import Simulation
from icmj.study.kind import sample_rows

PERSON = {"mass": (30.0, 200.0), "height": (0.5, 1.5)}  # kg, and m of the centre of mass: a body of a person's size


def measure_pressure(case: Case, simulation: Simulation, since: float, rate: float = 100.0) -> dict[str, float]:
    """Measures of the centre of pressure, back to front, of a body of a person's size.

    Args:
        case: the case.
        simulation: its run, on either plant.
        since: what is left out at the start [s].
        rate: sampling rate [Hz].

    Returns:
        numbers such as ``cop.x.rms`` [m, s]; none for a body of another size, for one on which other forces than the
        ground's act, or for a run that is too short.
    """
    if not isinstance(case.actual, MujocoPlant):
        return {}
    try:
        body = reaction(case.actual)
        if any(not low <= getattr(body, name) <= high for name, (low, high) in PERSON.items()):
            return {}
        pressure = sample_rows(ground_force(case.actual, simulation).chosen(["cop.x"]), simulation, rate, since)
        found = {name: float(value) for name, value in sway_numbers(pressure).items()}
    except IcmjError:
        return {}
    return {name: value for name, value in found.items() if np.isfinite(value)}
