"""How the replay opens: the figures and the phase plane at the left, what happens over time beside them, the summary."""

from __future__ import annotations

from typing import Any

import rerun as rr
import rerun.blueprint as rrb

from icmj.result import Result

TIMELINE = "time"
BACKGROUND = (24, 27, 31, 255)


def blueprint(result: Result) -> rrb.Blueprint:
    """The arrangement for ``result``; views of what it does not have are left out."""
    left: list[Any] = []
    if result.scene is not None:
        left.append(_figures(result))
    left.append(_phase_plane())
    middle: list[Any] = [
        _plot("Outputs y [rad]", "outputs"),
        _plot("Inputs u [N m]", "inputs"),
        rrb.Tabs(
            _plot("Hold state x_h", "states/hold"),
            _plot("Observer state x_o", "states/observer"),
            _plot("Plant state x", "states/plant"),
            active_tab=0,
        ),
    ]
    right: list[Any] = [rrb.TextDocumentView(origin="summary", name="Summary")]
    over_time: list[Any] = []
    if result.simulation.control != "continuous":
        over_time.append(_plot("Open-loop interval [s]", "interval"))
    if result.simulation.control == "event":
        over_time.append(_plot("Event function E / q_t²", "trigger"))
    if result.prediction.V_inv is not None:
        over_time.append(_plot("Eigenvector analysis χ", "modes"))
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Vertical(*left, row_shares=[3, 2][: len(left)]),
            rrb.Vertical(*middle),
            rrb.Vertical(*over_time) if over_time else rrb.Vertical(*right),
            *(right if over_time else ()),
            column_shares=[5, 5, 5, 3] if over_time else [5, 5, 3],
        ),
        rrb.BlueprintPanel(state="hidden"),
        rrb.SelectionPanel(state="hidden"),
        rrb.TimePanel(state="collapsed", timeline=TIMELINE, play_state="paused", loop_mode="all"),
        auto_layout=False,
        auto_views=False,
    )


def _plot(name: str, origin: str) -> rrb.TimeSeriesView:
    return rrb.TimeSeriesView(
        name=name,
        origin=origin,
        axis_x=rrb.TimeAxis(link=rrb.components.LinkAxis.LinkToGlobal),
        plot_legend=rrb.PlotLegend(corner=rrb.Corner2D.RightTop),
    )


def _figures(result: Result) -> rrb.Spatial3DView:
    assert result.scene is not None
    com = result.scene.com[0]
    height = max(float(com[2]), 0.3)
    return rrb.Spatial3DView(
        name="Body, and its sway magnified",
        origin="scene",
        background=BACKGROUND,
        line_grid=rrb.LineGrid3D(visible=False),
        eye_controls=rrb.EyeControls3D(
            kind=rrb.Eye3DKind.Orbital,
            position=(0.9 * height, -3.6 * height, 1.25 * height),
            look_target=(0.0, 0.0, 0.88 * height),
            eye_up=(0.0, 0.0, 1.0),
        ),
        spatial_information=rrb.SpatialInformation(target_frame="tf#/scene", show_axes=False, show_bounding_box=False),
    )


def _phase_plane() -> rrb.Spatial2DView:
    return rrb.Spatial2DView(
        name="Phase plane: outputs against their rates",
        origin="phase",
        background=BACKGROUND,
        visual_bounds=rrb.VisualBounds2D(x_range=[-1.5, 1.5], y_range=[-1.5, 1.5]),
    )
