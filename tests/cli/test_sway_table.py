"""A measure that the table, the JSON or the documentation forgets is no measure that anyone finds."""

import json
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from icmj.cli.commands.measure import _list_rows, plain_sway
from icmj.experiments.quiet_standing import quiet_standing
from icmj.experiments.recording import Recording
from icmj.fits.summaries import MEASURE_UNITS, measures, summarise
from icmj.measurement.measures import numbers_of, tabulate_definitions
from icmj.measurement.sway import Sway, measure_sway, sway_numbers
from icmj.series.series import Series

SETTINGS = {"start", "end", "level", "offset"}  # of a fit, or of a confidence, and no measures


@pytest.fixture(scope="module")
def sway() -> Sway:
    random = np.random.default_rng(2)
    walk = np.cumsum(random.standard_normal((6000, 2)), axis=0)
    t = np.arange(6000) / 100
    return measure_sway(Series(t, walk - 0.01 * np.cumsum(walk, axis=0), ("ap", "ml"), ("m", "m"), {}))


def leaves(value: Any) -> list[tuple[tuple[str, ...], float]]:
    """Every single number in measured values, or in one of them, by the way to it."""
    found = []
    parts = {f.name: getattr(value, f.name) for f in fields(value)} if is_dataclass(value) else value
    for name, inner in parts.items():
        if is_dataclass(inner):
            found += [((name, *way), number) for way, number in leaves(inner)]
        elif isinstance(inner, float):
            found.append(((name,), inner))
    return found


def changed(value: Any, way: tuple[str, ...]) -> Any:
    inner = value[way[0]] if isinstance(value, dict) else getattr(value, way[0])
    return put(value, **{way[0]: changed(inner, way[1:]) if len(way) > 1 else 1.5 * inner + 1})


def put(value: Any, **changes: Any) -> Any:
    return {**value, **changes} if isinstance(value, dict) else replace(value, **changes)


@pytest.mark.parametrize("part", ["coordinate", "plane"])
def test_every_measure_is_in_the_one_list_in_the_table_and_in_the_json(sway: Sway, part: str) -> None:
    measures = sway.coordinates[0] if part == "coordinate" else sway.plane
    assert measures is not None
    ways = [way for way, _ in leaves(measures.values) if way[-1] not in SETTINGS]
    assert len(ways) >= 10

    for way in ways:
        other = replace(measures, values=changed(measures.values, way))
        assert other.numbers != measures.numbers, f"{'.'.join(way)} is no number of a measure"
        assert _list_rows(other) != _list_rows(measures)
        swapped = {"coordinates": (other,)} if part == "coordinate" else {"plane": other}
        other_record = json.dumps(plain_sway(replace(sway, **swapped)))
        assert other_record != json.dumps(plain_sway(sway)), f"{'.'.join(way)} is in no JSON"


def test_batches_experiments_and_fits_take_their_measures_from_the_list(sway: Sway) -> None:
    """Numbers, names and units are those of the list wherever they stand, and so is what is missing."""
    first, second = sway.coordinates
    found = sway_numbers(sway.series)
    assert list(found) == [f"{c.name}.{measure.key}" for c in (first, second) for measure in numbers_of()]
    assert found["ml.short.D"] == second.diffusion.short.D
    assert all(np.isnan(value) for value in sway_numbers(sway.series.since(59.9)).values())
    told = quiet_standing([Recording(sway.series)], resamples=9).numbers
    assert [told[f"ap, {words}"] for words in ("RMS (m)", "mean speed (m/s)", "D, long times (m²/s)")] == [
        first.rms, first.speed, first.diffusion.long.D,
    ]  # fmt: skip
    assert MEASURE_UNITS == ("m", "m/s", "", "", "", "Hz")
    six = [first.rms, first.speed, first.frequencies.slope, first.diffusion.short.H, first.diffusion.long.H]
    seen = measures(summarise(sway.series["ap"]))
    np.testing.assert_allclose(seen, [*six, first.frequencies.mean], rtol=1e-12)


def test_every_label_is_in_the_documentation(sway: Sway, root: Path) -> None:
    page = (root / "docs" / "measures.md").read_text(encoding="utf-8")
    assert "```{measures}" in page
    page = "\n".join([page, *tabulate_definitions()]).lower().replace("$", "")
    for measure in (*numbers_of(), *numbers_of("plane")):
        assert measure.words.split(",")[0].lower() in page, f"{measure.words!r} is not in docs/measures.md"
