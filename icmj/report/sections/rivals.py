"""Several controllers of one body side by side: measures of sway in a table, spectra and paths superimposed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from icmj.base import numbers
from icmj.report.rivals import Rival
from icmj.report.sections.section import Picture, Section
from icmj.report.style import NAME

_CAPTION = (
    "Left: power spectra of the outputs over the second half of each run; right: rate of each output against its value "
    "over the last 20 s. The numbers are those of the table."
)


def rivals(found: Sequence[tuple[Sequence[Rival], tuple[Picture, Picture]]], first_number: int) -> Section | None:
    """A table and two pictures for each body, or ``None`` where none has several controllers.

    Args:
        found: the controllers of each body, with spectra and paths.
        first_number: number of the first figure.
    """
    items = [
        {
            "title": f"One body, {len(group)} controllers, {NAME[group[0].run.simulation.plant]} plant",
            "number": number,
            "pictures": pictures,
            "outputs": [f"{c.name} ({c.unit})".replace("deg", "°") for c in group[0].sway.coordinates],
            "rows": [_row(n, rival) for n, rival in enumerate(group, 1)],
            "caption": _CAPTION,
        }
        for number, (group, pictures) in enumerate(found, first_number)
    ]
    return Section("controllers", "Controllers side by side", "rivals.html.j2", {"items": items}) if items else None


def _row(number: int, rival: Rival) -> dict[str, Any]:
    simulation = rival.run.simulation
    late = simulation.events.t[simulation.events.t >= simulation.t[-1] / 2]
    return {
        "name": f"{number}. {rival.name}",
        "rate": numbers.number(len(late) / rival.sway.duration, 3),
        "outcome": simulation.outcome.kind,
        "measures": [
            (numbers.number(c.rms, 3), numbers.number(c.speed, 3), numbers.number(c.frequencies.median, 3))
            for c in rival.sway.coordinates
        ],
    }
