"""``icmj continue`` from the command line: what it writes, and what it draws beneath."""

from typing import Any

import icmj.report.branch as drawing
from icmj.cli.main import main


def test_a_branch_without_a_plant_named_is_drawn_over_the_linear_prediction(tmp_path, monkeypatch):
    drawn: list[tuple[Any, Any]] = []
    original = drawing.branch_figure

    def noted(branches: Any, beneath: Any = ()) -> Any:
        drawn.append((branches, beneath))
        return original(branches, beneath)

    monkeypatch.setattr(drawing, "branch_figure", noted)
    command = ["continue", "simple-0.8", "--parameter", "b", "--to", "0.75", "--points", "4", "--out", str(tmp_path)]
    assert not main(command)
    (branches, beneath), name = drawn[0], "simple-0.8.b.mujoco"
    assert [branch.plant for branch in branches] == ["mujoco"]
    assert [branch.plant for branch in beneath] == ["linear"]
    assert {path.name for path in tmp_path.iterdir()} == {f"{name}.{kind}" for kind in ("parquet", "rrd", "pdf", "svg")}
