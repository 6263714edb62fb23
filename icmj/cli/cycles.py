"""The commands for exact cycles; importing this registers them with :func:`icmj.cli.commands.execute`."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

from rich.box import SIMPLE_HEAD
from rich.markup import escape
from rich.table import Table

from icmj.base.plain import plain
from icmj.cli import arguments
from icmj.cli.commands import ERR, OUT, execute
from icmj.cli.working import Working

if TYPE_CHECKING:
    from icmj.case.case import Case
    from icmj.cycle.cycle import Cycle


@execute.register
def cycle(command: arguments.Cycle) -> None:
    """Find the cycle of one case and print it beside the prediction."""
    from icmj.case.case import prepare
    from icmj.cycle.cycle import find_cycle
    from icmj.runfile.overrides import overridden
    from icmj.runfile.reading import load_run

    run = overridden(load_run(command.run), command.set)
    with Working(f"cycle of {run.case.name}", ERR) as working:
        case = prepare(run)
        found = find_cycle(
            case, command.plant, start=command.start, progress=lambda done: working.tell("simulating", done)
        )
    if command.json:
        print(json.dumps(plain_cycle(found, case), indent=2, allow_nan=False))
        return
    _show(found, case)


def plain_cycle(found: Cycle, case: Case) -> dict[str, Any]:
    """What ``icmj cycle --json`` prints."""
    assumed, actual = case.assumed.linearisation.plant, case.actual.linearisation.plant
    return plain(
        {
            "plant": found.plant,
            "attracting": found.attracting,
            "mirrored": found.mirrored,
            "events": found.events,
            "interval": found.interval,
            "intervals": found.intervals,
            "period": found.period,
            "outputs": actual.outputs,
            "peak": found.y_peak,
            "range": found.y_range,
            "multipliers": found.multipliers,
            "multiplier_errors": found.multiplier_errors,
            "neutral": found.neutral,
            "states": {"plant": actual.states, "observer": assumed.states, "at_events": found.states},
            "closure": found.closure,
            "iterations": len(found.history) - 1,
            "interval_error": found.interval_error,
            "words": found.words,
            "prediction": {
                "delta_crit": case.prediction.delta_crit,
                "period": case.prediction.period,
                "verdict": case.prediction.verdict,
                "multipliers": case.prediction.multipliers,
            },
        }
    )


def _show(found: Cycle, case: Case) -> None:
    plant, prediction = case.actual.linearisation.plant, case.prediction
    orbit = prediction.orbit
    table = Table("", found.plant, "linear prediction", title_justify="left", box=SIMPLE_HEAD)
    table.title = escape(case.run.case.title)
    many = len(found.intervals) > 1
    for i, interval in enumerate(found.intervals):
        predicted = "–" if prediction.delta_crit is None or i else f"{prediction.delta_crit:.9f} s"
        table.add_row(f"open-loop interval {i + 1}" if many else "open-loop interval", f"{interval:.9f} s", predicted)
    table.add_row("period", f"{found.period:.9f} s", "–" if orbit is None else f"{orbit.period:.9f} s")
    units = plant.output_units or ("",) * plant.n_y
    for i, (name, unit) in enumerate(zip(plant.outputs, units, strict=True)):
        expected = "–" if orbit is None else f"{orbit.y_peak[i]:.6g} {unit}"
        table.add_row(f"peak of {escape(name)}", f"{found.y_peak[i]:.6g} {unit}", expected)
    theirs = () if prediction.multipliers is None else prediction.multipliers
    for i, value in enumerate(found.multipliers[:4]):
        error = found.multiplier_errors[i]
        expected = _complex(theirs[i]) if i < len(theirs) else "–"
        table.add_row(f"multiplier {i + 1}", f"{_complex(value)} ± {error:.0e}", expected)
    OUT.print(table)
    OUT.print(escape(found.words), highlight=False)
    error = (
        f"; relative error of the interval by the step {found.interval_error:.0e}" if found.plant != "linear" else ""
    )
    steps = len(found.history) - 1
    OUT.print(f"It closes to {found.closure:.0e} after {steps} Newton steps{error}.", highlight=False)


def _complex(value: complex) -> str:
    if abs(value.imag) < 1e-12:
        return f"{value.real:.6f}"
    return f"{value.real:.6f} {'+' if value.imag > 0 else '-'} {abs(value.imag):.6f}j ({abs(value):.6f})"
