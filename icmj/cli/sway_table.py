"""The table and the record that ``icmj measure`` prints."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from icmj.base.card import plain
from icmj.base.numbers import amount
from icmj.cli.tables import Column, show_table

if TYPE_CHECKING:
    from icmj.cli.terminal import Terminal
    from icmj.measurement.stabilogram import Diffusion
    from icmj.measurement.sway import Coordinate, Frequencies, Plane, Sway

# what people read: factor on the value, and unit
SHOWN = {"rad": (180 / np.pi, "deg"), "rad/s": (180 / np.pi, "deg/s"), "m": (1e3, "mm")}


def show_sway(sway: Sway, title: str, out: Terminal) -> None:
    """Measures down, signals across, the plane of two of them last."""
    values = [_of_coordinate(c) for c in sway.coordinates]
    units = [_unit(c.unit)[1] for c in sway.coordinates]
    heads = [f"{c.name} ({unit})" if unit else c.name for c, unit in zip(sway.coordinates, units, strict=True)]
    if sway.plane is not None:
        values.append(_of_plane(sway.plane))
        heads.append(f"plane ({_unit(sway.plane.unit)[1]})".replace(" ()", ""))
    labels = dict.fromkeys(label for column in values for label in column)
    rows = [(label, *(amount(column.get(label), figures=4) for column in values)) for label in labels]
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


def _of_coordinate(c: Coordinate) -> dict[str, float | None]:
    factor = _unit(c.unit)[0]
    return {
        "mean": factor * c.mean,
        "RMS about the mean": factor * c.rms,
        "mean distance": factor * c.mean_distance,
        "range": factor * c.range,
        "95 % prediction range": factor * c.prediction_range,
        "mean speed (per s)": factor * c.speed,
        **_frequencies(c.frequencies, c.rotation_frequency),
        **_stretches(c.diffusion, factor),
    }


def _of_plane(p: Plane) -> dict[str, float | None]:
    factor = _unit(p.unit)[0]
    return {
        "RMS about the mean": factor * p.rms,
        "mean distance": factor * p.mean_distance,
        "mean speed (per s)": factor * p.speed,
        "95 % prediction ellipse: area (unit²)": factor**2 * p.ellipse.area,
        "                         half axes": factor * float(p.ellipse.axes[0]),
        "                         and": factor * float(p.ellipse.axes[1]),
        "                         angle (deg)": float(np.degrees(p.ellipse.angle)),
        **_frequencies(p.frequencies, p.rotation_frequency),
        **_stretches(p.diffusion, factor),
    }


def _frequencies(found: Frequencies, rotation: float) -> dict[str, float | None]:
    return {
        "mean frequency (Hz)": found.mean,
        "median frequency (Hz)": found.median,
        "95 % frequency (Hz)": found.edge,
        "rotation frequency (Hz)": rotation,
        "slope of the spectrum, 0.1–0.7 Hz": found.slope,
    }


def _stretches(found: Diffusion, factor: float) -> dict[str, float | None]:
    short, long, critical = found.short, found.long, found.critical
    return {
        "diffusion: H, short times": None if short is None else short.H,
        "           H, long times": None if long is None else long.H,
        "           D, short (unit²/s)": None if short is None else factor**2 * short.D,
        "           D, long (unit²/s)": None if long is None else factor**2 * long.D,
        "           critical lag (s)": None if critical is None else critical[0],
        "           displacement (unit²)": None if critical is None else factor**2 * critical[1],
    }


def _diffusion(found: Diffusion) -> dict[str, Any]:
    return {name: getattr(found, name) for name in ("short", "long", "critical")}


def _unit(unit: str) -> tuple[float, str]:
    return SHOWN.get(unit, (1.0, unit))
