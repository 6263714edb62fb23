"""One input in axes: its command, and what acts."""

from __future__ import annotations

from typing import TYPE_CHECKING

from icmj.case.motion import acting, latter_part, with_resets
from icmj.controller.controller import expect_intermittent
from icmj.report import style
from icmj.report.axes import LAST_INTERVALS
from icmj.report.case_runs import CaseRuns

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def acting_inputs(case: CaseRuns) -> list[int]:
    """Inputs whose action differs from the command."""
    return sorted({i for result in case.runs.values() for i in acting(result)})


def draw_acting(axes: Axes, case: CaseRuns, i: int) -> None:
    """Command and what acts on one input; under noise the latter part."""
    plant = case.last.actual
    result = next(r for r in reversed(case.runs.values()) if i in acting(r))
    simulation, after = result.simulation, result.simulation.u_after(expect_intermittent(result.controller))
    t, command = with_resets(simulation, simulation.u[:, i : i + 1], after[:, i : i + 1])
    axes.plot(t, command, label="command $u$", **style.CONTINUOUS)
    axes.plot(simulation.t, simulation.applied[:, i], label="what acts", **style.RUN[simulation.plant])
    axes.margins(x=0)
    if simulation.noisy:
        axes.set_xlim(*latter_part(simulation, LAST_INTERVALS))
    unit = plant.input_units[i] if plant.input_units else ""
    name = style.words(plant.inputs[i]) if len(acting_inputs(case)) > 1 else "$u$"
    axes.set(xlabel="$t$ (s)", ylabel=f"{name} ({unit})" if unit else name)
