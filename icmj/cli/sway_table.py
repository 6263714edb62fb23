"""The table and the record that ``icmj measure`` prints."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from icmj.base.card import plain
from icmj.base.numbers import MISSING, amount
from icmj.cli.tables import Column, show_table
from icmj.measurement.sway import MEASURES, OF_PLANE

if TYPE_CHECKING:
    from icmj.cli.terminal import Terminal
    from icmj.measurement.stabilogram import Diffusion
    from icmj.measurement.sway import Coordinate, Measure, Plane, Sway

# what people read: factor on the value, and unit
SHOWN = {"rad": (180 / np.pi, "deg"), "rad/s": (180 / np.pi, "deg/s"), "m": (1e3, "mm")}


def show_sway(sway: Sway, title: str, out: Terminal) -> None:
    """Measures down, signals across, the plane of two of them last."""
    values = [_rows(MEASURES, c) for c in sway.coordinates]
    units = [_unit(c.unit)[1] for c in sway.coordinates]
    heads = [f"{c.name} ({unit})" if unit else c.name for c, unit in zip(sway.coordinates, units, strict=True)]
    if sway.plane is not None:
        values.append(_rows(OF_PLANE, sway.plane))
        heads.append(f"plane ({_unit(sway.plane.unit)[1]})".replace(" ()", ""))
    labels = dict.fromkeys(label for column in values for label in column)
    rows = [(label, *(column.get(label, MISSING) for column in values)) for label in labels]
    show_table((Column(""), *(Column(head, "right") for head in heads)), rows, out, title=title)


def record(sway: Sway) -> dict[str, Any]:
    """What ``--json`` prints: every measure, in the units of the series."""
    found: dict[str, Any] = {
        "duration": sway.duration,
        "rate": sway.rate,
        "samples": len(sway.series),
        "low_pass": sway.low_pass,
        "resampled": sway.series.facts.get("resampled"),
        "coordinates": [{**vars(c), "diffusion": _diffusion(c.diffusion)} for c in sway.coordinates],
        "plane": None,
    }
    if sway.plane is not None:
        p, e = sway.plane, sway.plane.ellipse
        found["plane"] = {
            **vars(p), "diffusion": _diffusion(p.diffusion), "ellipse": {**vars(e), "area": e.area},
        }  # fmt: skip
    found["spectrum"] = {"frequency": sway.spectrum.frequency, "power": sway.spectrum.power.T}
    return dict(plain(found))


def _rows(measures: Sequence[Measure], of: Coordinate | Plane) -> dict[str, str]:
    """Values by label, in the units that people read."""
    factor, angle = _unit(of.unit)[0], SHOWN["rad"]
    found = {}
    for measure in measures:
        mark = measure.unit.replace("U", "unit").replace("rad", angle[1])
        label = measure.words + {"": "", "unit": "", "unit/s": " (per s)"}.get(mark, f" ({mark})")
        by = factor ** (2 if "U²" in measure.unit else "U" in measure.unit) * (angle[0] if measure.unit == "rad" else 1)
        found[label] = amount(by * measure.value(of), figures=4)
    return found


def _diffusion(found: Diffusion) -> dict[str, Any]:
    return {name: getattr(found, name) for name in ("short", "long", "critical")}


def _unit(unit: str) -> tuple[float, str]:
    return SHOWN.get(unit, (1.0, unit))
