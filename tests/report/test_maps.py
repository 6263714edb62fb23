"""Pictures of sweeps show what the rows say: contours where the error is that, hatching where there is no cycle."""

from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from matplotlib.figure import Figure

from icmj import build_report, plots
from icmj.case.sweep_table import SweepTable
from icmj.errors import ReportError
from icmj.report.map_grid import edges, grid
from icmj.report.maps import motions, regions
from icmj.report.sections.swept_maps import pictures

B, Q = np.linspace(0.8, 1.2, 9), np.geomspace(1e-3, 1e-1, 21)


def swept(**columns: object) -> SweepTable:
    """A map over b and q_t whose error is 100 q_t², without a cycle at b = 1 and falling beyond q_t = 0.05."""
    b, q = (each.ravel() for each in np.meshgrid(B, Q, indexing="ij"))
    falls, none = q > 0.05, np.isclose(b, 1.0)
    rows = {
        "b": b,
        "q_t": q,
        "status": ["ok"] * len(b),
        "mujoco_outcome": np.where(falls, "fell", "completed"),
        "mujoco_kind": np.where(falls, "growth", np.where(none, "too short", "cycle")),
        "mujoco_on_predicted": ~falls & ~none,
        "mujoco_error": [None if f or n else float(100 * at**2) for at, f, n in zip(q, falls, none, strict=True)],
    }
    table = pa.table(rows | columns)
    return SweepTable("map", "A map", (("b", "actual.gain"), ("q_t", "controller.q_t")), len(b), table)


def axes():
    return Figure().subplots()


def test_contours_lie_where_the_error_is_what_they_say() -> None:
    drawn = axes()
    plots.validity(drawn, swept(), "b", "q_t")
    (lines,) = [each for each in drawn.collections if type(each).__name__ == "QuadContourSet"]
    for level, path in zip(lines.levels, lines.get_paths(), strict=True):
        if len(path.vertices):
            assert path.vertices[:, 1] == pytest.approx(np.sqrt(10**level / 100), rel=0.02)
    assert [len(path.vertices) > 0 for path in lines.get_paths()] == [True, True, True]
    assert drawn.get_yscale() == "log"


def test_regions_are_told_apart_and_what_is_not_finished_is_nothing() -> None:
    whole = swept()
    laid = grid(whole, "b", "q_t")
    told = regions(whole, laid, "mujoco")
    assert (told[-1] == "fell").all()
    assert told[0, 4] == "open"
    assert set(told[0]) == {"cycle", "open"}
    part = SweepTable(whole.name, whole.title, whole.varies, whole.points, whole.table.slice(0, 100))
    laid = grid(part, "b", "q_t")
    assert (laid.row < 0).sum() == laid.row.size - 100


def test_what_is_on_no_grid_is_refused() -> None:
    random = np.random.default_rng(0)
    with pytest.raises(ReportError, match="not on a grid"):
        plots.validity(axes(), swept(b=random.random(len(B) * len(Q))), "b", "q_t")
    with pytest.raises(ReportError, match="no column 'c'"):
        plots.validity(axes(), swept(), "b", "c")
    with pytest.raises(ReportError, match="not both numbers"):
        plots.validity(axes(), swept(), "b", "mujoco_kind")
    assert list(pictures(swept(b=random.random(len(B) * len(Q))))) == []


def test_edges_are_half_way() -> None:
    assert edges(np.array([1.0, 2.0, 4.0])) == pytest.approx([0.5, 1.5, 3.0, 5.0])
    assert edges(np.array([1.0, 10.0]), logarithmic=True) == pytest.approx([10**-0.5, 10**0.5, 10**1.5])


def test_cycles_that_agree_are_one_motion_the_others_are_named() -> None:
    table = pa.table(
        {
            "linear_kind": ["cycle", "cycle", "cycle", "growth", "homoclinic", None],
            "linear_p": [2, 2, 1, None, None, None],
            "linear_mirrored": [True, True, False, False, False, None],
            "linear_interval": [1.0, 1.0 + 1e-7, 1.0, None, 3.0, None],
            "linear_outcome": ["completed", "completed", "completed", "fell", "completed", None],
        }
    )
    found = motions(SweepTable("s", "s", (), 6, table), "linear")
    mirrored = "mirrored cycle of 2 events, 1 s"
    assert found == [mirrored, mirrored, "cycle of 1 event, 1 s", "falls", "homoclinic", ""]


def test_the_curve_is_the_prediction_where_a_cycle_is_and_marks_what_was_measured() -> None:
    b = np.array([0.8, 0.9, 1.1, 1.2])
    table = pa.table({
        "b": b, "status": ["ok"] * 4, "predicted_delta_crit": [1.8, 2.4, 2.1, 1.5],
        "predicted_eigenvalue": [1.0, 1.0, -1.0, -1.0], "predicted_cycle": [True] * 4,
        "linear_kind": ["cycle", "cycle", "too short", "cycle"],
        "linear_on_predicted": [True, True, False, True], "linear_interval": [1.8, 2.4, 2.2, 1.5],
    })  # fmt: skip
    curve = SweepTable("curve", "A curve", (("b", "actual.gain"),), 4, table)
    drawn = axes()
    plots.critical_interval(drawn, curve, "b")
    plus, minus, marks = (line.get_ydata() for line in drawn.lines)
    assert plus == pytest.approx([1.8, 2.4, np.nan, np.nan], nan_ok=True)
    assert minus == pytest.approx([np.nan, np.nan, 2.1, 1.5], nan_ok=True)
    assert marks == pytest.approx([1.8, 2.4, np.nan, 1.5], nan_ok=True)
    assert [each.name for each in pictures(curve)] == ["delta_crit"]


def test_a_report_of_sweeps_alone_has_their_pictures_and_says_how_they_went(tmp_path: Path) -> None:
    build_report([], tmp_path / "report.html", sweeps=[swept()])
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "A map" in page
    assert "136 on a cycle (136 on the predicted one), 36 growing, 17 too short to settle" in page
    assert {path.name for path in (tmp_path / "report_figures").iterdir()} == {
        "map_validity_mujoco.svg",
        "map_validity_mujoco.pdf",
    }
    with pytest.raises(ReportError):
        build_report([], tmp_path / "report.html")


@pytest.mark.parametrize("plant", ["linear", "mujoco"])
def test_maps_are_of_the_plant_that_was_simulated(plant: str) -> None:
    """A sweep of the linear plant alone was a KeyError."""
    table = swept(mujoco_p=[1] * 189, mujoco_mirrored=[False] * 189, mujoco_interval=[1.0] * 189).table
    names = [name.replace("mujoco", plant) for name in table.column_names]
    alone = SweepTable("map", "A map", (("b", ""), ("q_t", "")), 189, table.rename_columns(names))
    other = {"linear": "mujoco", "mujoco": "linear"}[plant]
    for draw in (plots.validity, plots.basins):
        drawn = axes()
        draw(drawn, alone, "b", "q_t")
        assert drawn.collections
        draw(axes(), alone, "b", "q_t", plant=plant)
        with pytest.raises(ReportError, match=f"no motion on the {other} plant; there is motion on the {plant} plant"):
            draw(axes(), alone, "b", "q_t", plant=other)


def test_a_column_that_is_not_there_is_named() -> None:
    with pytest.raises(ReportError, match="'map' has no column 'delta'; there are b, q_t, status"):
        swept().numbers("delta")
