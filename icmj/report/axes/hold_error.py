"""The hold error from event to event in axes, beside the predicted orbit and its spread."""

from __future__ import annotations

from contextlib import suppress
from typing import TYPE_CHECKING

import numpy as np

from icmj.base.array import Array
from icmj.case.laid_orbit import beside
from icmj.case.noise import spread_about
from icmj.errors import IcmjError, ReportError
from icmj.report import style
from icmj.report.axes import LAST_INTERVALS
from icmj.report.case_runs import CaseRuns, compares
from icmj.theory.orbit import Orbit
from icmj.theory.spread import Spread

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from icmj.case.result import Result


WITHIN = 2  # SD that the band around the predicted hold error has on either side


def draw_hold_error(axes: Axes, case: CaseRuns) -> None:
    """(i) Size of the hold error in thresholds over the time since the event, in each of the last intervals.

    With the predicted orbit, which under noise has its spread where that is predicted.

    Raises:
        ReportError: if no run has a complete interval.
    """
    drawn = {plant: list_hold_errors(result) for plant, result in case.runs.items()}
    if not any(drawn.values()):
        raise ReportError(f"case {case.name!r}: no complete interval, over which the hold error could be drawn")
    orbit = beside(case.prediction, case.last.motion).orbit if compares(case) else None
    if orbit is not None and np.isfinite(orbit.gamma):
        size = _size_of(case.last, orbit.e_hp)
        if (spread := predict_spread(case, orbit)) is not None:
            # with a delay the orbit jumps at the action, where the band begins
            middle, off = np.interp(spread.t, orbit.t, size), WITHIN * spread.hold_error
            axes.fill_between(spread.t, np.maximum(middle - off, 0), middle + off, label=f"± {WITHIN} SD", **style.BAND)
        axes.plot(orbit.t, size, label="predicted", color="#222222", linewidth=1.1, zorder=3)
    for plant, lines in drawn.items():
        look = {**style.RUN[plant], "linewidth": 0.6}
        for n, (tau, size) in enumerate(lines):
            axes.plot(tau, size, label=None if n else style.NAME[plant], **look)
    axes.axhline(1, label="threshold", **style.CRITICAL)
    axes.set(xlabel="time since the event (s)", ylabel="hold error (thresholds)")
    axes.set_xlim(left=0)
    axes.set_ylim(bottom=0)


def list_hold_errors(result: Result) -> list[tuple[Array, Array]]:
    """Times since the event and sizes of the hold error, over each of the last intervals."""
    run, found = result.simulation, []
    events, before = run.events, _size_of(result, run.x_h - run.x_o)
    late = bool(run.delay)  # then the event itself resets nothing
    for k in range(max(len(events) - 1 - LAST_INTERVALS, 0), len(events) - 1):
        rows = (run.t > events.t[k]) & (run.t < events.t[k + 1])
        first, last = (_size_of(result, events.x_h[i : i + 1] - events.x_o[i : i + 1]) for i in (k, k + 1))
        size = np.concatenate([first if late else 0 * first, before[rows], last])
        found.append((np.concatenate([[events.t[k]], run.t[rows], [events.t[k + 1]]]) - events.t[k], size))
    return found


def _size_of(result: Result, e: Array) -> Array:
    """The size of hold errors (M, n̂) on the face on which it is largest, in thresholds, shape (M,)."""
    faces = result.controller.faces
    return np.sqrt(faces.squares(e @ faces.R.T).max(axis=1))


def predict_spread(case: CaseRuns, orbit: Orbit) -> Spread | None:
    """The spread about an orbit under the noise of the runs; ``None`` without noise or where none is predicted."""
    if not case.last.simulation.noisy:
        return None
    with suppress(IcmjError):
        return spread_about(case.last, orbit)
    return None
