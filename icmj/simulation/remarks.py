"""Notices about a run: limits that were reached, and a step that is too large."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from icmj.plant.notice import Notice
from icmj.simulation.simulation import Simulation

LARGE = 1e-3
"""Largest relative error of an interval, or of the outputs, that goes without a word."""


def remarks(simulation: Simulation) -> tuple[Notice, ...]:
    """Notices on a run, from its facts."""
    return tuple(_remarks(simulation))


def relative_error(simulation: Simulation) -> float:
    """Estimated error of the last interval relative to it, or of the outputs where there is none; NaN if not known."""
    facts = simulation.precision
    error, stretch = (float(facts.get(name, np.nan)) for name in ("interval_error", "error_stretch"))
    if np.isfinite(error) and stretch > 0:
        return error / stretch
    return float(facts.get("output_error", np.nan))


def _remarks(simulation: Simulation) -> Iterator[Notice]:
    facts = simulation.precision
    if float(facts.get("saturated_share", 0.0)) > 0:
        words = (
            f"the actuators reach their limits ({facts.get('saturated', '')} of the time), where the plant is not "
            "linear: u is the command, applied what acts; widen their ranges, or lower the threshold"
        )
        yield Notice("saturation", "warning", words)
    if facts.get("clipped"):
        words = (
            f"sensors reach their cutoff ({facts['clipped']} of the time), where the controller sees less than there "
            "is; widen cutoff, or lower the threshold"
        )
        yield Notice("saturation", "warning", words)
    if facts.get("not_adaptive"):
        words = (
            f"the motion is not smooth ({facts['not_adaptive']}), so no tolerance can be kept to: "
            f"{facts['integrator']} steps by {float(facts['timestep']):g} s; give [simulation] a timestep instead of it"
        )
        yield Notice("not smooth", "warning", words)
    error = relative_error(simulation)
    if error > LARGE and facts.get("tolerance"):
        words = f"the tolerance of {float(facts['tolerance']):g} let an interval err by {error:.1g} of itself"
        yield Notice("large step", "warning", words)
    elif error > LARGE:
        words = (
            f"the step of {float(facts['timestep']):g} s with {facts['integrator']} errs by {error:.1g} of an interval;"
            ' shorten [simulation] timestep, or take integrator = "RK4"'
        )
        yield Notice("large step", "warning", words)
