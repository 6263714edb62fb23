"""Panel (h): the centre of pressure of a standing body."""

from __future__ import annotations

from typing import TYPE_CHECKING

from icmj.case.motion import with_resets
from icmj.report import style
from icmj.report.case_runs import CaseRuns
from icmj.report.panel import Panel
from icmj.simulation.pressure import Pressure
from icmj.simulation.simulation import Simulation

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


MM = 1e3


def _standing(case: CaseRuns) -> dict[str, tuple[Simulation, Pressure]]:
    runs = {plant: result.simulation for plant, result in case.runs.items()}
    return {plant: (run, run.pressure) for plant, run in runs.items() if run.pressure is not None}


def _draw_pressure(case: CaseRuns) -> Figure:
    """(h) Centre of pressure against time, its place at rest dotted."""
    names = pressed_axes(case) or ["x"]
    figure, stack = style.new_figure(style.TALL if len(names) > 1 else style.HEIGHT, len(names))
    for axes, name in zip(stack, names, strict=True):
        draw_pressure(axes, case, name)
        axes.set_xlabel("$t$ (s)" if axes is stack[-1] else "")
    style.link("time", *stack)
    style.legend(figure, stack[0])
    return figure


def pressed_axes(case: CaseRuns) -> list[str]:
    """The axes, of x and y, along which the centre of pressure moves; none without a floor."""
    return sorted({axis for _, pressure in _standing(case).values() for axis in pressure.axes})


def draw_pressure(axes: Axes, case: CaseRuns, axis: str) -> None:
    """Centre of pressure along one axis, x or y, against time, its place at rest dotted."""
    i = "xy".index(axis)
    for plant, (run, pressure) in _standing(case).items():
        t, centre = run.t, pressure.centre
        if len(pressure.t_after):
            t, centre = with_resets(run, centre, pressure.centre_after)
        axes.plot(t, MM * centre[:, i], label=style.NAME[plant], **style.RUN[plant])
    axes.axhline(MM * pressure.at_rest[i], label="at rest", **style.CRITICAL)
    axes.margins(x=0)
    axes.set(xlabel="$t$ (s)", ylabel=f"centre of pressure, ${axis}$ (mm)")


def _pressure_caption(case: CaseRuns) -> str:
    *_, (_, pressure) = _standing(case).values()
    return f"Centre of pressure; {pressure.words[-1]}."


PRESSURE = Panel("h", _draw_pressure, _pressure_caption, lambda case: bool(_standing(case)))
