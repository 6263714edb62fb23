"""Figures of measured sway: the path with its prediction ellipse, stabilogram diffusion, spectra."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from icmj.base.array import is_between
from icmj.errors import ReportError
from icmj.measurement.sway import Sway
from icmj.report import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes


LOWEST_POWER = 1e-7  # of the largest density drawn
# Okabe-Ito, one for each signal
COLOURS = ("#0072b2", "#d55e00", "#007a55", "#cc79a7", "#56b4e9", "#e69f00")


def draw_path(axes: Axes, sway: Sway) -> None:
    """The path in the plane, the second coordinate against the first, with the 95 % prediction ellipse.

    Raises:
        ReportError: if the sway is not one in a plane.
    """
    plane = sway.plane
    if plane is None:
        raise ReportError("a path needs two signals of the same unit; measure two")
    axes.plot(*sway.series.values.T, color="#56b4e9", linewidth=0.6, label="path")
    if "ellipse" in plane.values:
        axes.plot(*plane.ellipse.outline().T, color="#222222", linewidth=1.0, label="95 % prediction ellipse")
    axes.set_aspect("equal")
    axes.set(
        **{f"{axis}label": _label(style.words(name), plane.unit) for axis, name in zip("xy", plane.names, strict=True)}
    )


def draw_diffusion(axes: Axes, sway: Sway) -> None:
    """Mean square displacement against time on logarithmic axes, with both exponents H, of each coordinate.

    Raises:
        ReportError: if it was not measured.
    """
    if any("diffusion" not in c.values for c in sway.coordinates):
        raise ReportError("stabilogram diffusion was not measured")
    named: list[tuple[str, Any]] = [(c.name, c.diffusion) for c in sway.coordinates]
    if sway.plane is not None:
        named.append(("plane", sway.plane.diffusion))
    for (name, found), colour in zip(named, _colours(len(named)), strict=True):
        moved = found.displacement > 0
        if not moved.any():
            continue
        exponents = ", ".join("–" if part is None else f"{part.H:.2f}" for part in (found.short, found.long))
        label = f"{style.words(name)}, H = {exponents}"
        axes.loglog(found.lag[moved], found.displacement[moved], color=colour, linewidth=1.4, label=label)
        for part in (found.short, found.long):
            if part is not None:
                span = np.array([part.start, part.end])
                inside = is_between(found.lag, part.start, part.end)
                # a line of slope 2H through the middle of what it was fitted to
                middle = [np.log(values[inside]).mean() for values in (found.lag, found.displacement)]
                axes.loglog(span, np.exp(middle[1] + 2 * part.H * (np.log(span) - middle[0])), **style.CRITICAL)
    units = {c.unit for c in sway.coordinates}
    unit = f" ({units.pop()}²)" if len(units) == 1 and "" not in units else ""
    axes.set(xlabel=r"$\Delta t$ (s)", ylabel=rf"$\langle\Delta x^2\rangle${unit}")


def draw_spectra(axes: Axes, sway: Sway) -> None:
    """Power spectrum of each coordinate on logarithmic axes; dotted: its median frequency."""
    found = sway.spectrum
    drawn = found.frequency > 0
    for c, power, colour in zip(sway.coordinates, found.power.T, _colours(len(sway.coordinates)), strict=True):
        axes.loglog(found.frequency[drawn], power[drawn], color=colour, linewidth=1.2, label=style.words(c.name))
        if np.isfinite(median := c.number("frequency.median")):
            axes.axvline(median, color=colour, linewidth=0.8, linestyle=(0, (1, 1.6)))
    largest = float(found.power[drawn].max(initial=0.0))
    if largest > 0:
        axes.set_ylim(bottom=LOWEST_POWER * largest)
    units = {c.unit for c in sway.coordinates}
    unit = f" ({units.pop()}²/Hz)" if len(units) == 1 and "" not in units else ""
    axes.set(xlabel="frequency (Hz)", ylabel=f"power{unit}")


def _colours(count: int) -> list[str]:
    return [COLOURS[i % len(COLOURS)] for i in range(count)]


def _label(name: str, unit: str) -> str:
    return f"{name} ({unit})" if unit else name
