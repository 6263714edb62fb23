"""The page of an experiment: its figure, its numbers, and one sentence for each case."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from icmj.base.numbers import amount
from icmj.report import style
from icmj.report.builder import filled
from icmj.report.sections import Picture, Section

LEAD = "Trials of each case under the same stimulus, analysed in the same way as recordings of people."


@dataclass(frozen=True)
class Row:
    """The result of one case on one plant.

    Attributes:
        title, plant: of it.
        trials: how many.
        numbers: by name.
        words: one sentence.
    """

    title: str
    plant: str
    trials: int
    numbers: Mapping[str, float]
    words: str


def experiment_page(title: str, kind: str, rows: Sequence[Row], svg: bytes | None) -> str:
    """The page's HTML; ``svg`` is the figure, ``None`` where nothing was found."""
    names = list(dict.fromkeys(name for row in rows for name in row.numbers))
    cells = [
        (row.title, plant_name(row.plant), row.trials, [amount(row.numbers.get(name), figures=4) for name in names])
        for row in rows
    ]
    uri = "" if svg is None else f"data:image/svg+xml;base64,{base64.b64encode(svg).decode()}"
    section = Section(
        "experiment",
        title,
        "experiment.html.j2",
        {
            "names": names,
            "rows": cells,
            "words": [(f"{row.title}, {plant_name(row.plant)}", row.words) for row in rows],
            "picture": Picture("figure", uri, f"{title}, figure") if uri else None,
        },
    )
    subtitle = kind.replace("_", " ").capitalize()
    recorded = all(row.plant == "recording" for row in rows)
    return filled(
        [section],
        title=title,
        subtitle=subtitle,
        abstract=LEAD,
        kicker="Experiment",
        source="recordings" if recorded else "the trials in the folder of this page",
        beside="The figure is also available as SVG and PNG files beside this page." if uri else "",
    )


def plant_name(plant: str) -> str:
    """The plant's name in words."""
    return style.NAME.get(plant, plant)
