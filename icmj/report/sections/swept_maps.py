"""The section of sweeps: the points of each in words, and the figures that can be drawn over what varies."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from icmj.base import numbers
from icmj.base.text import one_line
from icmj.case.sweep_table import SweepTable
from icmj.errors import ReportError
from icmj.report import style
from icmj.report.interval_curve import draw_curve
from icmj.report.maps import draw_basins, draw_sway, draw_sway_curve, draw_validity
from icmj.report.material import Material
from icmj.report.picture import Drawing, Picture
from icmj.report.section import Section
from icmj.report.style import NAME

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def compose(material: Material) -> Section | None:
    """Every sweep with its pictures, or ``None`` where there is none."""
    items = [
        {"title": swept.title, "facts": _sweep_facts(swept), "pictures": _draw_pictures(swept, material)}
        for swept in material.sweeps
    ]
    return Section("sweeps", "Sweeps", TEMPLATE, {"items": items}) if items else None


def _draw_pictures(swept: SweepTable, material: Material) -> list[tuple[Picture, str]]:
    """Pictures of a sweep, with their captions."""
    try:
        with style.apply():
            drawn = [replace(each, name=f"{swept.name}_{each.name}") for each in pictures(swept)]
            return [(material.draw(each), each.alt) for each in drawn]
    except (ValueError, ArithmeticError) as error:  # matplotlib's, of numbers near the ends of their range
        raise ReportError(f"sweep {swept.name!r} cannot be drawn ({one_line(error, 160)})") from error


_KINDS = {
    "too short": "too short to settle",
    "no events": "without events",
    "homoclinic": "with growing intervals",
    "growth": "growing",
    "decay": "dying out",
}


def _sweep_facts(swept: SweepTable) -> list[tuple[str, str]]:
    status = Counter(swept.texts("status"))
    done = f"{len(swept.table)} of {swept.points}" if len(swept.table) < swept.points else f"{swept.points}"
    bad = ", ".join(f"{count} {name}" for name, count in sorted(status.items()) if name != "ok")
    facts = [("Points", f"{done}{f'; {bad}' if bad else ''}")]
    for name, field in swept.varies:
        facts.append((name, f"{_range(swept, name)}{f' ({field})' if field and field != name else ''}"))
    for plant in NAME:
        if f"{plant}_kind" in swept.table.column_names:
            on = sum(value is True for value in swept.texts(f"{plant}_on_predicted"))
            kinds = Counter(kind for kind in swept.texts(f"{plant}_kind") if kind)
            words = (
                f"{count} on a cycle ({on} on the predicted one)"
                if kind == "cycle"
                else f"{count} {_KINDS.get(kind, kind)}"
                for kind, count in kinds.most_common()
            )
            facts.append((_plant(plant), ", ".join(words)))
        elif f"{plant}_outcome" in swept.table.column_names:
            ends = Counter(outcome for outcome in swept.texts(f"{plant}_outcome") if outcome)
            facts.append((_plant(plant), ", ".join(f"{count} {outcome}" for outcome, count in ends.most_common())))
    return facts


def _plant(plant: str) -> str:
    return "linear plant" if plant == "linear" else NAME[plant]


def _range(swept: SweepTable, name: str) -> str:
    values = sorted(set(swept.texts(name)))
    try:
        at = np.array(values, float)
        words = f"{numbers.short(float(at[0]))} to {numbers.short(float(at[-1]))}"
        return f"{words}, {len(at)} values" if len(at) > 1 else numbers.short(float(at[0]))
    except (TypeError, ValueError):
        return ", ".join(map(str, values[:6])) + (" …" if len(values) > 6 else "")


_WIDE = 130.0  # mm


def pictures(swept: SweepTable) -> Iterator[Drawing]:
    """All that can be drawn of a sweep: a map of validity, basins, a curve of Δ_crit, or the size of the sway."""
    numeric = [(name, field) for name, field in swept.varies if _varies(swept, name)]
    plants = [plant for plant in ("linear", "mujoco") if f"{plant}_kind" in swept.table.column_names]
    starts = [name for name, field in numeric if field.startswith(("simulation.initial", "simulation.observer"))]
    if "root_real" in swept.table.column_names:  # a controller without a critical interval
        yield from _draw_sizes(swept, [name for name, _ in numeric])
        return
    if len(numeric) == 1:
        (name, _), *_ = numeric
        figure, (axes,) = style.new_figure(70.0, width=_WIDE)
        draw_curve(axes, swept, name)
        style.legend(figure, axes, columns=5)
        caption = (
            f"Critical interval against {name}: solid where a cycle is predicted, dashed where none is. Marks: "
            f"intervals of the cycles on which the runs settled.{_rings(swept)}"
        )
        yield _show("delta_crit", figure, caption)
    if len(numeric) != 2:
        return
    (x, _), (y, _) = numeric
    for plant in plants:
        try:
            if len(starts) == 2:
                figure, axes = _new_map(95.0)
                draw_basins(axes, swept, x, y, plant)
                caption = f"The motion to which each initial state leads, {_plant(plant)}."
                yield _show(f"basins_{plant}", figure, caption)
            else:
                yield _show(f"validity_{plant}", _validity(swept, x, y, plant), _caption(plant))
        except ReportError:  # not on a grid, so there is no map of it
            return


def _draw_sizes(swept: SweepTable, names: list[str]) -> Iterator[Drawing]:
    """The size of the sway over one or two things that vary."""
    plants = [plant for plant in ("linear", "mujoco") if f"{plant}_outcome" in swept.table.column_names]
    if len(names) == 1 and plants:
        figure, (axes,) = style.new_figure(70.0, width=_WIDE)
        draw_sway_curve(axes, swept, names[0])
        style.legend(figure, axes, columns=2)
        yield _show("sway", figure, "Standard deviation of the first output, in the second half of each run.")
    for plant in plants if len(names) == 2 else ():
        figure, axes = _new_map(80.0)
        try:
            bar = figure.colorbar(draw_sway(axes, swept, names[0], names[1], plant), ax=axes, pad=0.02)
        except ReportError:  # not on a grid, so there is no map of it
            return
        bar.set_label(r"$\log_{10}$ of the first output’s standard deviation")
        caption = f"Size of the sway in the second half of each run, {_plant(plant)}. Hatched: it falls."
        yield _show(f"sway_{plant}", figure, caption)


def _validity(swept: SweepTable, x: str, y: str, plant: str) -> Figure:
    figure, axes = _new_map(80.0)
    mesh = draw_validity(axes, swept, x, y, plant)
    bar = figure.colorbar(mesh, ax=axes, ticks=range(-8, 0), pad=0.02)
    bar.ax.set_yticklabels([rf"$10^{{{tick}}}$" for tick in range(-8, 0)])
    bar.set_label("relative error of the interval")
    return figure


def _new_map(height: float) -> tuple[Figure, Axes]:
    """A figure [mm] with room for a legend above its axes."""
    figure, (axes,) = style.new_figure(height, width=_WIDE)
    box = axes.get_position()
    axes.set_position((box.x0, box.y0, box.width, box.height * 0.97))
    return figure, axes


def _show(name: str, figure: Figure, caption: str) -> Drawing:
    """A figure that is drawn already: the end of its file name, and what is said beneath it."""
    return Drawing(name, caption, lambda: figure)


def _rings(swept: SweepTable) -> str:
    """What rings are, where there are some."""
    names = [
        name for name in ("linear_cycle_attracting", "mujoco_cycle_attracting") if name in swept.table.column_names
    ]
    repelling = any((swept.numbers(name) == 0).any() for name in names)
    return " Rings: cycles that repel, on which no run settles." if repelling else ""


def _caption(plant: str) -> str:
    return (
        f"Relative error of the linear theory’s interval, {_plant(plant)}, with contours at 0.1, 1 and 10 %. "
        "Where there is no colour, the run fell (crossed), settled on another motion (hatched), or had not settled "
        "when it ended (dotted)."
    )


def _varies(swept: SweepTable, name: str) -> bool:
    """Whether a column has numbers of which at least two differ."""
    try:
        return len(np.unique(swept.numbers(name))) > 1
    except (TypeError, ValueError):
        return False


TEMPLATE = '{% include "items.html.j2" %}\n'
