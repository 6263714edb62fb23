"""The phase plane of a run: every output against its rate, over the predicted orbit, with the present point moving.

It is drawn in a 2D view, which has equal axes and y downwards: values are scaled to a frame of fixed shape, whose ticks
name them by round numbers.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
import rerun as rr

from icmj.base.array import Array, is_between
from icmj.case.laid_orbit import lay_orbit
from icmj.case.motion import event_rows, output_rate
from icmj.case.quantity import in_brackets, shared_unit
from icmj.log import palette
from icmj.log.timeline import time_column
from icmj.simulation.scene import select_frames

if TYPE_CHECKING:
    from icmj.case.result import Result


WIDE = 1.6  # width of the frame over its height
ROOT = "phase"
LATE = 0.5  # the part of a run at its end that is drawn bright; before it is the approach, drawn dim


def write_phase_plane(recording: rr.RecordingStream, result: Result) -> None:
    """Write the phase plane of ``result``: approach dim, second half bright, events, orbit, and the present point."""
    simulation = result.simulation
    y, rate = simulation.y, output_rate(result, simulation.x, simulation.u)
    laid = lay_orbit(result) if result.expect_prediction().cycle else None
    orbit = None if laid is None else (laid.whole(laid.orbit.y), laid.whole(laid.rate))
    late = is_between(simulation.t, simulation.t[-1] * (1 - LATE))
    seen = [(y[late], rate[late])] + ([orbit] if orbit is not None else [])
    scale_y, scale_rate = (round_up(max(float(np.abs(pair[i]).max(initial=0.0)) for pair in seen)) for i in (0, 1))

    def place_points(y: Array, rate: Array) -> Array:
        return np.column_stack([WIDE * y / scale_y, -rate / scale_rate])

    show = partial(recording.log, static=True)
    _write_frame(show, scale_y, scale_rate, shared_unit(result.actual.output_units))
    colours = palette.choose_colours(result.actual.n_y)
    approach = ~late
    events = event_rows(simulation)
    events = events[late[events]]
    for i, (name, colour) in enumerate(zip(result.actual.outputs, colours, strict=True)):
        root = f"{ROOT}/{name}"
        strips = _inside(place_points(y[approach, i], rate[approach, i]))
        if strips:
            faint = palette.darken(palette.darken(colour))
            show(f"{root}/approach", rr.LineStrips2D(strips, colors=[faint], radii=[-0.5], draw_order=1.0))
        if orbit is not None:
            line = place_points(orbit[0][:, i], orbit[1][:, i])
            dim = palette.darken(palette.WHITE)
            show(f"{root}/orbit", rr.LineStrips2D([line], colors=[dim], radii=[-3.0], draw_order=10.0 + i))
        line = place_points(y[late, i], rate[late, i])
        show(f"{root}/run", rr.LineStrips2D([line], colors=[colour], radii=[-1.25], draw_order=20.0 + i))
        if len(events):
            at = place_points(y[events, i], rate[events, i])
            show(f"{root}/events", rr.Points2D(at, colors=[palette.EVENT], radii=[-3.5], draw_order=30.0 + i))
    shown = select_frames(simulation.t)
    now = np.stack([place_points(y[shown, i], rate[shown, i]) for i in range(result.actual.n_y)], axis=1)
    style = rr.Points2D.from_fields(
        colors=colours, radii=[-6.0], labels=list(result.actual.outputs), show_labels=True, draw_order=40.0
    )
    show(f"{ROOT}/now", style)
    positions = rr.Points2D.columns(positions=now.reshape(-1, 2)).partition(np.full(len(shown), result.actual.n_y))
    recording.send_columns(f"{ROOT}/now", [time_column(simulation.t[shown])], positions)


def round_up(value: float) -> float:
    """The next of 1, 2, 5 times a power of ten; 1 for zero."""
    if not np.isfinite(value) or value <= 0:
        return 1.0
    power = 10.0 ** np.floor(np.log10(value))
    return float(next(step * power for step in (1, 2, 5, 10) if step * power >= value * (1 - 1e-9)))


def _inside(line: Array, reach: float = 1.2) -> list[Array]:
    """The parts of a line that stay within the frame."""
    inside = np.abs(line / [WIDE, 1.0]).max(axis=1) <= reach
    cuts = np.flatnonzero(np.diff(inside.astype(int))) + 1
    return [
        part
        for part, kept in zip(np.split(line, cuts), np.split(inside, cuts), strict=True)
        if len(part) > 1 and kept[0]
    ]


def _write_frame(show: Callable[..., None], scale_y: float, scale_rate: float, unit: str) -> None:
    axes = [[[-1.2 * WIDE, 0], [1.2 * WIDE, 0]], [[0, -1.2], [0, 1.2]]]
    show(f"{ROOT}/axes", rr.LineStrips2D(axes, colors=[palette.GREY], radii=[-0.6], draw_order=0.0))
    ticks = [[-WIDE, 0.0], [WIDE, 0.0], [0.0, -1.0], [0.0, 1.0]]
    labels = [f"{-scale_y:g}", f"{scale_y:g}", f"{scale_rate:g}", f"{-scale_rate:g}"]
    written: dict[str, Any] = {"colors": [palette.WHITE], "show_labels": True}
    show(f"{ROOT}/ticks", rr.Points2D(ticks, labels=labels, radii=[-2.0], draw_order=0.5, **written))
    places, labels = [[1.15 * WIDE, -0.16], [0.0, -1.3]], [f"y{in_brackets(unit)}", f"dy/dt{in_brackets(unit, '/s')}"]
    show(f"{ROOT}/names", rr.Points2D(places, labels=labels, radii=[0.0], **written))
