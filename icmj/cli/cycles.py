"""The commands for exact cycles; importing this registers them with :func:`icmj.cli.commands.execute`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from icmj.base.array import between
from icmj.base.numbers import amount, plain, root
from icmj.cli import arguments
from icmj.cli.commands import execute
from icmj.cli.printing import say_changes
from icmj.cli.progress import Working
from icmj.cli.table import Column, show_table
from icmj.cli.terminal import ERR, OUT

if TYPE_CHECKING:
    from icmj.base.array import Array
    from icmj.case.case import Case
    from icmj.cycle.cycle import Cycle
    from icmj.cycle.return_map import PlantKind
    from icmj.simulation.simulation import Simulation
    from icmj.theory.prediction import Prediction


@execute.register
def cycle(command: arguments.CycleCommand) -> None:
    """Find the cycle of one case and print it beside the prediction."""
    from icmj.case.case import prepare
    from icmj.cli.printing import show_cycle
    from icmj.cycle.cycle import find_cycle
    from icmj.cycle.switched import has_exact_cycle
    from icmj.runfile.reading import load_run
    from icmj.runfile.schema import overridden
    from icmj.study.study import plants_of

    run = overridden(load_run(command.run, allow_code=command.allow_code), command.set)
    plant = command.plant or plants_of(run)[-1]
    with Working(f"cycle of {run.case.name}", ERR):
        case = prepare(run)
    if (theory := case.theory) is None:
        if plant == "linear" and has_exact_cycle(case.controller):
            show_cycle(case, command.json)
        else:
            _rounds(case, plant, command.json)
        return
    with Working(f"cycle of {run.case.name}", ERR) as working:
        found = find_cycle(
            case, plant, start=command.start, progress=lambda done: working.tell(f"cycle of {run.case.name}", done)
        )
    if command.json:
        OUT.show(plain_cycle(found, case, theory.prediction))
        return
    _show(found, case, theory.prediction)
    for notice in case.notices:
        if not (command.set and notice.kind == "paper"):
            OUT.note(notice)


def _rounds(case: Case, plant: PlantKind, json: bool) -> None:
    """What a run without a prediction settles on: a cycle of events, or rounds of switches that shrink or grow."""
    from dataclasses import asdict

    from icmj.errors import CycleError
    from icmj.experiments.switching_rounds import Rounds, rounds_of
    from icmj.measurement.measurement import Measurement, measure
    from icmj.study.study import admit, run_case

    run, real = case.run, case.controller.realisation
    with Working(f"cycle of {run.case.name}", ERR) as working:
        if not (real.guards or real.eventful):
            raise CycleError(
                f"{run.path}: a controller that never switches has no cycle of its own, and its motion dies out or "
                "grows; icmj run shows it"
            )
        admit(case, plant, None)
        done = run_case(case, plant, lambda part: working.tell(f"cycle of {run.case.name}", part))
        found = measure(done.simulation) if real.eventful else rounds_of(done.simulation)
    simulation = done.simulation
    period = float("nan") if found.period is None else found.period
    reach = {
        name: (float(high), float(low))
        for name, high, low in zip(simulation.labels.outputs, *_reach(simulation, period), strict=True)
    }
    verdict = found.kind if isinstance(found, Measurement) else found.verdict
    if json:
        OUT.show(plain(asdict(found) | {"verdict": verdict, "words": found.words, "reach": reach}))
        return
    OUT.say(f"{run.title} ({plant}): {found.words}")
    say_changes(run, OUT)
    if verdict == "cycle" or (isinstance(found, Rounds) and found.switches and verdict == "on the edge"):
        OUT.say("Only the cycle that this run settles on is found; repelling ones are not looked for.")
    elif verdict == "noisy":
        OUT.say("Under noise there is no cycle; --set 'simulation.disturbance=[]' leaves the noise out.")
    if isinstance(found, Rounds) and not np.isnan(found.multiplier):
        OUT.say(f"A departure from the settled motion is multiplied by {found.multiplier:.4g} in a round.")
    last = "in the whole run" if np.isnan(period) else "in the last round"
    for name, (high, low) in reach.items():
        OUT.say(f"{name}: {low:.6g} to {high:.6g} {last}")


def _reach(simulation: Simulation, period: float) -> tuple[Array, Array]:
    """Largest and smallest of the outputs in the last period, or in all where there is none."""
    since = 0.0 if np.isnan(period) else max(simulation.t[-1] - period, 0.0)
    y = simulation.y[between(simulation.t, since)]
    return y.max(axis=0), y.min(axis=0)


def plain_cycle(found: Cycle, case: Case, prediction: Prediction) -> dict[str, Any]:
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
            "alternating": found.alternating,
            "states": {"plant": actual.states, "observer": assumed.states, "at_events": found.states},
            "closure": found.closure,
            "iterations": len(found.history) - 1,
            "interval_error": found.interval_error,
            "words": found.words,
            "prediction": {
                "delta_crit": prediction.delta_crit,
                "period": prediction.period,
                "verdict": prediction.verdict,
                "multipliers": prediction.multipliers,
            },
        }
    )


def _show(found: Cycle, case: Case, prediction: Prediction) -> None:
    plant = case.actual.linearisation.plant
    orbit = prediction.orbit
    rows: list[tuple[str, str, str]] = []
    many = len(found.intervals) > 1
    for i, interval in enumerate(found.intervals):
        predicted = "–" if prediction.delta_crit is None or i else f"{prediction.delta_crit:.9f} s"
        rows.append((f"open-loop interval {i + 1}" if many else "open-loop interval", f"{interval:.9f} s", predicted))
    rows.append(("period", f"{found.period:.9f} s", "–" if orbit is None else f"{orbit.period:.9f} s"))
    units = plant.output_units or ("",) * plant.n_y
    for i, (name, unit) in enumerate(zip(plant.outputs, units, strict=True)):
        expected = amount(None if orbit is None else orbit.y_peak[i], unit)
        rows.append((f"peak of {name}", amount(found.y_peak[i], unit), expected))
    theirs = () if prediction.multipliers is None else tuple(prediction.multipliers)
    if found.alternating:  # the one that the theory leaves out
        theirs = tuple(sorted((*theirs, 1.0 + 0j), key=abs, reverse=True))
    for i, value in enumerate(found.multipliers[:4]):
        error = found.multiplier_errors[i]
        expected = _multiplier(theirs[i]) if i < len(theirs) else "–"
        rows.append((f"multiplier {i + 1}", f"{_multiplier(value)} ± {error:.0e}", expected))
    columns = Column(""), Column(found.plant), Column("linear prediction")
    show_table(columns, rows, OUT, title=case.run.title)
    say_changes(case.run, OUT)
    OUT.say(found.words)
    error = (
        f"; relative error of the interval by the step {found.interval_error:.0e}" if found.plant != "linear" else ""
    )
    steps = len(found.history) - 1
    OUT.say(f"It closes to {found.closure:.0e} after {steps} Newton steps{error}.")


def _multiplier(value: complex) -> str:
    return root(value, 6) + (f" ({amount(abs(value))})" if abs(value.imag) > 1e-12 else "")
