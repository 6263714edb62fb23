"""The page of an experiment: its figure, its numbers, and one sentence for each case."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from icmj.base.numbers import amount, count
from icmj.report import style
from icmj.report.builder import filled
from icmj.report.sections import Picture, Section

METHODS = {
    "double_step": (
        "Each reaction time is the delay by which a fitted linear model of the control signal must have its step "
        "moved. Bars are twice the standard error of the mean; intervals in brackets are 95 % confidence "
        "intervals from resampled pairs. Set-points are drawn below the control, not to scale."
    ),
    "multisine": (
        "Response and power are estimated at the lines of the stimulus. Bars are 95 % confidence intervals, black "
        "lines are linear theory, and small points are power between the lines (the remnant). Gain is response "
        "divided by stimulus, and power is that of the response, both in the units of these signals."
    ),
    "intersection_point": (
        "Lines of action of the ground reaction force meet at the height z, here divided by the height of the "
        "centre of mass. Faint bands are standard deviations over trials, and thin black lines are linear theory."
    ),
    "quiet_standing": (
        "Positions are divided by their standard deviation, and the dotted line is the normal distribution. "
        "Intervals are those between events."
    ),
}
METHODS["perturbed_stance"] = METHODS["multisine"]


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
    recorded = all(row.plant == "recording" for row in rows)
    trials = count(sum(row.trials for row in rows), "trial")
    data = "recorded" if recorded else f"simulated, of {count(len({row.title for row in rows}), 'case')}"
    subtitle = f"{kind.replace('_', ' ').capitalize()}: {trials}, {data}"
    return filled(
        [section],
        title=title,
        subtitle=subtitle,
        abstract=f"Methods. {METHODS[kind]} Simulated trials are analysed in the same way as recordings of people.",
        kicker="Experiment",
        source="recordings" if recorded else "the trials in the folder of this page",
        beside="The figure is also available as SVG and PNG files beside this page." if uri else "",
    )


def plant_name(plant: str) -> str:
    """The plant's name in words."""
    return style.NAME.get(plant, plant)
