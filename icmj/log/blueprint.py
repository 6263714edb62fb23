"""How the replay opens: figures and phase plane at the left, the run over time in the middle, summary at the right."""

from __future__ import annotations

from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from icmj.case.quantity import in_brackets, shared_unit
from icmj.case.result import Result
from icmj.log.figure import place_eye
from icmj.log.phase_plane import WIDE
from icmj.log.timeline import TIMELINE
from icmj.simulation.scene import Scene

BACKGROUND = (52, 58, 66, 255)
DARK = (24, 27, 31, 255)
HISTORY = 8.0  # intervals shown before the cursor, where a whole run would be too dense
ROOM = 0.36  # of the time shown: left free at the right of the curves, for the legend


def make_blueprint(result: Result) -> rrb.Blueprint:
    """The arrangement for ``result``, without views of data that it does not have."""
    if (prediction := result.prediction) is None:
        return _whole(result)
    control = result.simulation.control
    window = _window(result, prediction.delta_crit)
    left: list[Any] = [show_body(result.scene)] if result.scene is not None else []
    left.append(show_plane("Phase plane: outputs against their rates", "phase", -1.5))
    states = [
        plot("Hold state x_h", "states/hold", window),
        plot("Observer state x_o", "states/observer", window),
        plot("Plant state x", "states/plant", window),
    ]
    if control == "event":
        states.insert(0, plot("Hold error / threshold: an event at 1", "trigger", window))
    middle: list[Any] = [
        plot(f"Outputs y{in_brackets(shared_unit(result.actual.output_units))}", "outputs", window),
        plot(f"Inputs u{in_brackets(shared_unit(result.actual.input_units))}", "inputs", window),
        rrb.Tabs(*states, active_tab=0),
    ]
    if result.simulation.pressure is not None:
        middle.insert(2, _ground(window))
    right: list[Any] = [rrb.TextDocumentView(origin="summary", name="Summary")]
    if control != "continuous":
        right.append(plot("Open-loop interval [s], whole run", "interval", show_whole_run(result), ahead=True))
    if prediction.V_inv is not None:
        right.append(plot("Eigenvector analysis χ", "modes", window))
    return arrange(
        rrb.Vertical(*left, row_shares=[3, 2][: len(left)]),
        rrb.Vertical(*middle),
        rrb.Vertical(*right, row_shares=[4, 3, 3][: len(right)]),
    )


def _ground(axis: rrb.TimeAxis, *, ahead: bool = False) -> rrb.Tabs:
    views = (("Centre of pressure [m]", "pressure"), ("Load on the ground [N]", "load"))
    return rrb.Tabs(*(plot(name, origin, axis, ahead=ahead) for name, origin in views), active_tab=0)


def _whole(result: Result) -> rrb.Blueprint:
    """Body, outputs, inputs and mode over the whole run, and the summary: of a run beside which there is nothing."""
    axis, run = show_whole_run(result), result.simulation
    plots: list[Any] = [
        plot(f"Outputs y{in_brackets(shared_unit(result.actual.output_units))}", "outputs", axis, ahead=True),
        plot(f"Inputs u{in_brackets(shared_unit(result.actual.input_units))}", "inputs", axis, ahead=True),
        plot("Plant state x", "states/plant", axis, ahead=True),
    ]
    if run.pressure is not None:
        plots.append(_ground(axis, ahead=True))
    if run.mode.size:
        numbered = ", ".join(f"{i} {name}" for i, name in enumerate(run.modes))
        plots.append(plot(f"Mode: {numbered}", "mode", axis, ahead=True))
    left: list[Any] = [show_body(result.scene)] if result.scene is not None else []
    right = rrb.TextDocumentView(origin="summary", name="Summary")
    return arrange(*(rrb.Vertical(*part) for part in (left, plots, [right]) if part))


def arrange(*columns: rrb.Vertical) -> rrb.Blueprint:
    """These columns beside each other, the first a little wider, playing from the start."""
    return rrb.Blueprint(
        rrb.Horizontal(*columns, column_shares=[6, 5, 5][: len(columns)]),
        rrb.BlueprintPanel(state="hidden"),
        rrb.SelectionPanel(state="hidden"),
        rrb.TimePanel(state="collapsed", timeline=TIMELINE, play_state="playing", loop_mode="all"),
        auto_layout=False,
        auto_views=False,
    )


def _window(result: Result, delta_crit: float | None) -> rrb.TimeAxis:
    """A time axis that follows the cursor: some intervals before it, and room for the legend after it."""
    simulation, interval = result.simulation, result.motion.interval
    if interval is None or not np.isfinite(interval) or interval <= 0:
        interval = delta_crit or float(simulation.t[-1]) / 10
    interval = min(interval, float(simulation.t[-1]) / 10)
    return follow_cursor(HISTORY * interval, ROOM * HISTORY * interval)


def follow_cursor(before: float, after: float) -> rrb.TimeAxis:
    """A time axis that follows the cursor, from some time before it to some time after it [s]."""
    start, end = (rr.TimeRangeBoundary.cursor_relative(seconds=seconds) for seconds in (-before, after))
    return rrb.TimeAxis(view_range=rr.TimeRange(start=start, end=end))


def show_whole_run(result: Result) -> rrb.TimeAxis:
    """A time axis over the whole run, and room for the legend."""
    return rrb.TimeAxis(
        view_range=rr.TimeRange(
            start=rr.TimeRangeBoundary.absolute(seconds=0.0),
            end=rr.TimeRangeBoundary.absolute(seconds=(1.0 + ROOM) * float(result.simulation.t[-1])),
        )
    )


def plot(name: str, origin: str, axis: rrb.TimeAxis, *, ahead: bool = False) -> rrb.TimeSeriesView:
    """Series of one entity over time, up to the cursor, or also ``ahead`` of it.

    The legend lies in the room that the axis leaves to the right of the curves.
    """
    past = rrb.VisibleTimeRange(
        TIMELINE, start=rr.TimeRangeBoundary.infinite(), end=rr.TimeRangeBoundary.cursor_relative(seconds=0.0)
    )
    return rrb.TimeSeriesView(
        name=name,
        origin=origin,
        axis_x=axis,
        plot_legend=rrb.PlotLegend(corner=rrb.Corner2D.RightTop),
        time_ranges=None if ahead else past,
    )


def show_body(scene: Scene) -> rrb.Spatial3DView:
    """The body, and its sway magnified, in 3D."""
    position, target = place_eye(scene)
    return rrb.Spatial3DView(
        name="Body, and its sway magnified",
        origin="scene",
        background=BACKGROUND,
        line_grid=rrb.LineGrid3D(visible=False),
        eye_controls=rrb.EyeControls3D(
            kind=rrb.Eye3DKind.Orbital,
            position=position,
            look_target=target,
            eye_up=(0.0, 0.0, 1.0),
        ),
        spatial_information=rrb.SpatialInformation(target_frame="tf#/scene", show_axes=False, show_bounding_box=False),
    )


def show_plane(name: str, origin: str, top: float) -> rrb.Spatial2DView:
    """What is drawn in a frame of 2 WIDE by 2 about its middle; ``top``, above it, is where its titles end."""
    return rrb.Spatial2DView(
        name=name,
        origin=origin,
        background=DARK,
        visual_bounds=rrb.VisualBounds2D(x_range=[-1.3 * WIDE, 1.3 * WIDE], y_range=[top, 1.35]),
    )
