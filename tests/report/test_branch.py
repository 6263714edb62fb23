"""Pictures of branches: what is solid and what is dashed, where the marks stand, and that everything is drawn."""

from dataclasses import replace
from typing import Literal

import numpy as np
import pytest
from cycle_cases import branch

from icmj.cycle.branch import Branch
from icmj.cycle.continuation import branch_off
from icmj.errors import ReportError
from icmj.report import style
from icmj.report.branch import branch_figure, draw_amplitude, draw_intervals, draw_multipliers


@pytest.fixture(scope="module")
def losing_symmetry() -> Branch:
    return branch("simple-1.7", "b", 1.5, plant="linear", points=8)


def axes_of():
    from matplotlib.figure import Figure

    return Figure().add_axes((0.1, 0.1, 0.8, 0.8))


def test_repelling_is_dashed_up_to_the_point_where_it_becomes_attracting(losing_symmetry: Branch) -> None:
    axes, special = axes_of(), losing_symmetry.specials[0]
    draw_intervals(axes, [losing_symmetry])
    lines = {line.get_label(): line for line in axes.lines}
    dashed, solid, mark = (
        lines[name]
        for name in ("linear plant, repelling (dashed)", "linear plant, attracting (solid)", "symmetry breaking")
    )
    assert dashed.get_linestyle() == "--"
    assert solid.get_linestyle() == "-"
    assert dashed.get_xdata()[-1] == solid.get_xdata()[0] == special.value
    assert (np.asarray(dashed.get_xdata())[:-1] > special.value).all()
    assert (np.asarray(solid.get_xdata())[1:] < special.value).all()
    assert mark.get_xdata()[0] == special.value
    np.testing.assert_allclose(np.ravel(mark.get_ydata()), special.intervals)


def test_angles_are_in_degrees_and_the_linear_prediction_lies_beneath(losing_symmetry: Branch) -> None:
    axes = axes_of()
    draw_amplitude(axes, [losing_symmetry], [losing_symmetry])
    thick = style.PREDICTED["color"]
    beneath = [line for line in axes.lines if line.get_color() == thick]
    others = [line for line in axes.lines if line.get_color() != thick]
    assert beneath[0].get_label() == "linear plant"
    assert min(line.get_linewidth() for line in beneath) > max(line.get_linewidth() for line in others)
    assert all(axes.lines.index(line) < axes.lines.index(others[0]) for line in beneath)
    assert np.ravel(others[0].get_ydata())[0] == pytest.approx(np.degrees(losing_symmetry.y_peak[0, 0]))
    assert "deg" in axes.get_ylabel()


@pytest.mark.parametrize(("plant", "named"), [("mujoco", "MuJoCo"), ("linear", "linear plant")])
def test_the_legend_says_which_plant_it_is_and_that_the_style_of_a_line_is_its_stability(
    losing_symmetry: Branch, plant: Literal["mujoco", "linear"], named: str
) -> None:
    """Of a branch in MuJoCo it said "linear" and "attracting": of what is beneath, and of its own stability."""
    with style.apply():
        for branches in ([losing_symmetry], [losing_symmetry] * 3):
            figure = branch_figure([replace(one, plant=plant) for one in branches], [losing_symmetry])
            (legend,) = figure.legends
            words = [text.get_text() for text in legend.get_texts()]
            assert {"linear plant", f"{named}, attracting (solid)", f"{named}, repelling (dashed)"} <= set(words)
            box = legend.get_window_extent()
            assert 0 <= box.x0 < box.x1 <= figure.bbox.width  # its last words were cut off


def test_multipliers_beyond_the_frame_stand_at_its_edge_and_are_told(losing_symmetry: Branch) -> None:
    """Else a branch that repels strongly looks as if it attracted."""
    axes, strong = axes_of(), losing_symmetry.multipliers.copy()
    strong[2, :2] = -7.3, 0
    draw_multipliers(axes, replace(losing_symmetry, multipliers=strong))
    crosses = [line.get_xydata() for line in axes.lines if line.get_marker() == "+" and len(line.get_xdata())]
    assert len(crosses) == 1
    left = axes.get_xlim()[0]
    np.testing.assert_allclose(crosses[0], [[0.96 * left, 0]], atol=1e-12)
    assert [text.get_text() for text in axes.texts] == [r"+ beyond: $|\mu|$ to 7.3"]
    plain = axes_of()
    draw_multipliers(plain, losing_symmetry)
    assert not plain.texts


def test_the_figure_is_the_same_whenever_it_is_drawn(losing_symmetry: Branch) -> None:
    off = branch_off(losing_symmetry, losing_symmetry.specials[0], points=5)
    with style.apply():
        first, again = (style.save(branch_figure([losing_symmetry, off]), "svg") for _ in range(2))
    assert first == again


def test_what_does_not_go_into_one_picture_is_refused(losing_symmetry: Branch) -> None:
    with pytest.raises(ReportError, match="no branch"):
        branch_figure([])
    other = branch("simple-0.8", "delta_min", 2.5, plant="linear", points=8)
    with pytest.raises(ReportError, match="different parameters"):
        branch_figure([losing_symmetry, other])
    with pytest.raises(ReportError, match="no output 3"):
        draw_amplitude(axes_of(), [losing_symmetry], output=3)


def test_the_report_shows_branches_of_one_case_in_one_figure_and_tells_what_happens(losing_symmetry, tmp_path) -> None:
    from icmj.report.builder import build_report

    other = branch("simple-0.8", "delta_min", 2.5, plant="linear", points=8)
    build_report([], tmp_path / "page.html", branches=[losing_symmetry, other])
    page = (tmp_path / "page.html").read_text(encoding="utf-8")
    assert "branches off at" in page
    assert "falls to the least one" in page
    assert page.count('<figure class="law">') == 2
    figures = sorted(path.name for path in (tmp_path / "page_figures").iterdir())
    names = ("simple-0.8_along_delta_min", "simple-1.7_along_b")
    assert figures == [f"{name}.{kind}" for name in names for kind in ("pdf", "svg")]


def test_a_figure_has_a_name_of_its_own_folder_whatever_the_parameter_is_called(losing_symmetry, tmp_path) -> None:
    from icmj.report.builder import build_report

    (tmp_path / "deep").mkdir()
    elsewhere = replace(losing_symmetry, parameter="x/../../../stolen")
    build_report([], tmp_path / "deep" / "page.html", branches=[elsewhere])
    assert {path.name for path in tmp_path.iterdir()} == {"deep"}
    assert {path.name for path in (tmp_path / "deep").iterdir()} == {"page.html", "page_figures"}
