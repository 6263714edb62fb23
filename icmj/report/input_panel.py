"""Panel (g): inputs that differ from the command."""

from __future__ import annotations

from typing import TYPE_CHECKING

from icmj.case.motion import acting, latter_part, with_resets
from icmj.report import style
from icmj.report.case_runs import CaseRuns
from icmj.report.panel import SHOWN, Panel

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def acting_inputs(case: CaseRuns) -> list[int]:
    """Inputs whose action differs from the command."""
    return sorted({i for result in case.runs.values() for i in acting(result)})


def _draw_acting(case: CaseRuns) -> Figure:
    """(g) Command and what acts, of every input where they differ; under noise the latter part."""
    inputs = acting_inputs(case)
    figure, stack = style.new_figure(style.TALL if len(inputs) > 1 else style.HEIGHT, len(inputs))
    for axes, i in zip(stack, inputs, strict=True):
        draw_acting(axes, case, i)
        axes.set_xlabel("$t$ (s)" if axes is stack[-1] else "")
        if len(inputs) > 1:  # names of inputs are longer than axes are high
            name, _, unit = axes.get_ylabel().partition(" (")
            axes.set_ylabel(f"({unit}" if unit else "")
            axes.text(0.01, 0.98, name, transform=axes.transAxes, va="top", style="italic")
    figure.align_ylabels(stack)
    style.link("time", *stack)
    style.legend(figure, stack[0])
    return figure


def draw_acting(axes: Axes, case: CaseRuns, i: int) -> None:
    """Command and what acts on one input; under noise the latter part."""
    plant = case.last.actual
    result = next(r for r in reversed(case.runs.values()) if i in acting(r))
    simulation, after = result.simulation, result.simulation.u_after(result.controller)
    t, command = with_resets(simulation, simulation.u[:, i : i + 1], after[:, i : i + 1])
    axes.plot(t, command, label="command $u$", **style.CONTINUOUS)
    axes.plot(simulation.t, simulation.applied[:, i], label="what acts", **style.RUN[simulation.plant])
    axes.margins(x=0)
    if simulation.noisy:
        axes.set_xlim(*latter_part(simulation, SHOWN))
    unit = plant.input_units[i] if plant.input_units else ""
    name = style.words(plant.inputs[i]) if len(acting_inputs(case)) > 1 else "$u$"
    axes.set(xlabel="$t$ (s)", ylabel=f"{name} ({unit})" if unit else name)


def _acting_caption(case: CaseRuns) -> str:
    limits = any(float(r.simulation.precision.get("saturated_share", 0.0)) > 0 for r in case.runs.values())
    reason = "is limited by the actuators" if limits else "includes the disturbance"
    return f"Command of the controller, and the input that acts on the plant, which {reason}."


ACTING = Panel("g", _draw_acting, _acting_caption, lambda case: bool(acting_inputs(case)))
