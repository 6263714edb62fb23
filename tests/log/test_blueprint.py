"""The arrangement as it stands in the file: every view has something to show."""

import functools
from dataclasses import replace
from pathlib import Path

import pytest
from log_cases import made_up, standing, with_scene
from rerun.chunk import RrdReader

from icmj import Continuous, Result, write_log


def arranged(path: Path) -> dict[str, tuple[str, str]]:
    """Name, class and origin of every view in a log's blueprint, by name."""
    reader = RrdReader(path)
    (store,) = reader.blueprints()
    found: dict[str, dict[str, str]] = {}
    for chunk in reader.stream(store=store):
        parts = chunk.entity_path.strip("/").split("/")
        if parts[0] != "view" or len(parts) != 2:
            continue
        batch = chunk.to_record_batch()
        for name in ("class_identifier", "display_name", "space_origin"):
            column = f"ViewBlueprint:{name}"
            if column in batch.schema.names:
                found.setdefault(parts[1], {})[name] = batch.column(column).to_pylist()[-1][0]
    return {v["display_name"]: (v["class_identifier"], v["space_origin"]) for v in found.values()}


def entities(path: Path) -> set[str]:
    return {chunk.entity_path for chunk in RrdReader(path).store().stream()}


VARIANTS = ("with figures", "without figures", "alone", "no prediction", "standing", "continuous")


@functools.cache
def variants() -> dict[str, Result]:
    usual, plant = made_up(duration=6.0)
    nothing = dict.fromkeys(("delta_crit", "eigenvalue", "period", "gamma", "amplitude", "orbit", "V_inv"))
    never = replace(usual.simulation, control="continuous", E=usual.simulation.E * float("nan"))
    return {
        "with figures": with_scene(usual, plant),
        "without figures": usual,
        "alone": with_scene(replace(usual, continuous=None, growth=None, law=None), plant),
        "no prediction": replace(usual, prediction=replace(usual.prediction, cycle=False, **nothing)),
        "standing": standing(),
        "continuous": replace(usual, simulation=never, controller=usual.controller.triggered_by(Continuous())),
    }


@pytest.mark.parametrize("name", VARIANTS)
def test_every_view_has_something_to_show(name: str, tmp_path: Path) -> None:
    write_log(variants()[name], tmp_path / "x.rrd")
    views, logged = arranged(tmp_path / "x.rrd"), entities(tmp_path / "x.rrd")
    for title, (_, origin) in views.items():
        root = "/" + origin.strip("/")
        assert any(entity == root or entity.startswith(root + "/") for entity in logged), title
    drawn = {entity for entity in logged if not entity.startswith(("/__properties", "/archive"))}
    roots = {"/" + origin.strip("/") for _, origin in views.values()}
    assert {e for e in drawn if not any(e == r or e.startswith(r + "/") for r in roots)} == set()


def test_the_usual_arrangement_has_all_that_was_asked_for(tmp_path: Path) -> None:
    write_log(variants()["with figures"], tmp_path / "x.rrd")
    views = arranged(tmp_path / "x.rrd")
    kinds = [kind for kind, _ in views.values()]
    assert kinds.count("3D") == kinds.count("TextDocument") == 1
    origins = {origin.strip("/") for kind, origin in views.values() if kind == "TimeSeries"}
    signals = ("outputs", "inputs", "states/hold", "states/observer", "states/plant")
    assert origins == {"trigger", "interval", "modes", *signals}


def test_a_run_alone_has_body_signals_phase_plane_and_intervals(tmp_path: Path) -> None:
    """What the study adds is in the archive: the viewer shows of it the signals under continuous control only."""
    for name in ("with figures", "alone"):
        write_log(variants()[name], tmp_path / f"{name}.rrd")
    views = [arranged(tmp_path / f"{name}.rrd") for name in ("with figures", "alone")]
    assert views[0] == views[1]
    assert {origin.strip("/") for kind, origin in views[0].values() if kind == "2D"} == {"phase"}
    more = entities(tmp_path / "with figures.rrd") - entities(tmp_path / "alone.rrd")
    assert more == {"/outputs/continuous", "/inputs/continuous"}


def test_views_name_the_unit_of_what_they_show_and_there_is_none_of_a_body_that_is_not_there(tmp_path: Path) -> None:
    usual = variants()["without figures"]
    write_log(usual, tmp_path / "x.rrd")
    assert "3D" not in {kind for kind, _ in arranged(tmp_path / "x.rrd").values()}
    for units, words in ((("m",), "Outputs y [m]"), ((), "Outputs y")):
        shown = replace(usual, actual=replace(usual.actual, output_units=units))
        write_log(shown, tmp_path / "x.rrd")
        assert words in arranged(tmp_path / "x.rrd")
