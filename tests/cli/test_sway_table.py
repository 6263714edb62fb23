"""A measure that the table, the JSON or the documentation forgets is no measure that anyone finds."""

from __future__ import annotations

import json
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from icmj.cli.sway_table import _of_coordinate, _of_plane, record
from icmj.measurement.sway import Sway, measure_sway
from icmj.series.series import Series

SETTINGS = {"start", "end", "level", "offset"}  # of a fit, or of a confidence, and no measures


@pytest.fixture(scope="module")
def sway() -> Sway:
    random = np.random.default_rng(2)
    walk = np.cumsum(random.standard_normal((6000, 2)), axis=0)
    t = np.arange(6000) / 100
    return measure_sway(Series(t, walk - 0.01 * np.cumsum(walk, axis=0), ("ap", "ml"), ("m", "m"), {}))


def leaves(value: Any) -> list[tuple[tuple[str, ...], float]]:
    """Every single number in a dataclass of measures, by the way to it."""
    found = []
    for field in fields(value):
        inner = getattr(value, field.name)
        if is_dataclass(inner):
            found += [((field.name, *way), number) for way, number in leaves(inner)]
        elif isinstance(inner, float):
            found.append(((field.name,), inner))
    return found


def changed(value: Any, way: tuple[str, ...]) -> Any:
    inner = getattr(value, way[0])
    return replace(value, **{way[0]: changed(inner, way[1:]) if len(way) > 1 else 1.5 * inner + 1})


@pytest.mark.parametrize("part", ["coordinate", "plane"])
def test_every_measure_is_in_the_table_and_in_the_json(sway: Sway, part: str) -> None:
    measures = sway.coordinates[0] if part == "coordinate" else sway.plane
    shown = _of_coordinate if part == "coordinate" else _of_plane
    ways = [way for way, _ in leaves(measures) if way[-1] not in SETTINGS]
    assert len(ways) >= 10
    for way in ways:
        other = changed(measures, way)
        assert shown(other) != shown(measures), f"{'.'.join(way)} has no label in icmj/cli/sway_table.py"
        swapped = {"coordinates": (other,)} if part == "coordinate" else {"plane": other}
        assert json.dumps(record(replace(sway, **swapped))) != json.dumps(record(sway)), (
            f"{'.'.join(way)} is in no JSON"
        )


def test_every_label_is_in_the_documentation(sway: Sway, root: Path) -> None:
    page = (root / "docs" / "measures.md").read_text(encoding="utf-8").lower().replace("$", "")
    assert sway.plane is not None
    for label in {**_of_coordinate(sway.coordinates[0]), **_of_plane(sway.plane)}:
        words = label.split("(")[0].split(":")[0].split(",")[0].strip().lower()
        words = words.removesuffix(" about the mean")
        assert words in page, f"{label!r} is not in docs/measures.md"
