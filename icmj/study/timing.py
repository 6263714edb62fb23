"""How long a trial is, and its samples: what all kinds of experiment do to a run file and to a run."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from icmj.runfile.schema import RunFile
from icmj.series.pieces import piecewise
from icmj.series.series import Series
from icmj.simulation.simulation import Simulation


def timed(run: RunFile, duration: float, rate: float) -> RunFile:
    """The run file with another duration [s], recorded at a rate [Hz]."""
    return run.with_(**{"simulation.duration": duration, "simulation.record_interval": 1 / rate})


def sampled(signals: Series, simulation: Simulation, rate: float, since: float = 0.0) -> Series:
    """Signals at the rows of a run, evenly sampled from ``since`` [s] on, which becomes 0.

    Nothing is interpolated across an event, an action or a step of the set-point. A run that ended before ``since``
    has one row.
    """
    step = 1 / rate
    first, last = round(since * rate), int(simulation.t[-1] / step * (1 + 1e-12))
    if last <= first:
        return replace(signals, t=signals.t[:1], values=signals.values[:1])
    t = step * np.arange(first, last + 1, dtype=float)
    edges = simulation.setpoint.edges if simulation.setpoint else np.zeros(0)
    breaks = np.concatenate([simulation.events.t, simulation.events.t + simulation.delay, edges])
    return replace(signals, t=t - t[0], values=piecewise(simulation.t, signals.values, t, breaks=breaks))
