"""The centre of pressure of a standing body against time in axes."""

from __future__ import annotations

from typing import TYPE_CHECKING

from icmj.case.motion import with_resets
from icmj.report import style
from icmj.report.case_runs import CaseRuns
from icmj.simulation.pressure import Pressure
from icmj.simulation.simulation import Simulation

if TYPE_CHECKING:
    from matplotlib.axes import Axes


MM = 1e3


def find_pressures(case: CaseRuns) -> dict[str, tuple[Simulation, Pressure]]:
    """The runs that have a centre of pressure, with it, by plant."""
    runs = {plant: result.simulation for plant, result in case.runs.items()}
    return {plant: (run, run.pressure) for plant, run in runs.items() if run.pressure is not None}


def pressed_axes(case: CaseRuns) -> list[str]:
    """The axes, of x and y, along which the centre of pressure moves; none without a floor."""
    return sorted({axis for _, pressure in find_pressures(case).values() for axis in pressure.axes})


def draw_pressure(axes: Axes, case: CaseRuns, axis: str) -> None:
    """Centre of pressure along one axis, x or y, against time, its place at rest dotted."""
    i = "xy".index(axis)
    for plant, (run, pressure) in find_pressures(case).items():
        t, centre = run.t, pressure.centre
        if len(pressure.t_after):
            t, centre = with_resets(run, centre, pressure.centre_after)
        axes.plot(t, MM * centre[:, i], label=style.NAME[plant], **style.RUN[plant])
    axes.axhline(MM * pressure.at_rest[i], label="at rest", **style.CRITICAL)
    axes.margins(x=0)
    axes.set(xlabel="$t$ (s)", ylabel=f"centre of pressure, ${axis}$ (mm)")
