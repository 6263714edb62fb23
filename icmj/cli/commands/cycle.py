"""``icmj cycle``: the periodic orbit of a case, beside the predicted one."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from icmj.cli.arguments import POSITIONAL
from icmj.cli.overrides import Overrides, say_changes
from icmj.cli.progress import Working
from icmj.cli.table import Column, show_table
from icmj.errors import prefix_errors

if TYPE_CHECKING:
    from icmj.base.array import Array
    from icmj.case.case import Case
    from icmj.cli.terminal import Terminal
    from icmj.cycle.cycle import Cycle
    from icmj.cycle.return_map import PlantKind
    from icmj.cycle.switched import SwitchedCycle
    from icmj.simulation.simulation import Simulation
    from icmj.theory.prediction import Prediction


@dataclass(frozen=True)
class CycleCommand(Overrides):
    """Find the periodic orbit, attracting or repelling, and its multipliers by Newton's method.

    Example: icmj cycle runs/simple-1.7.toml --plant mujoco
    """

    group = "Predict"

    run: Annotated[Path, POSITIONAL]
    """Run file, or name of a shipped case."""
    plant: Literal["linear", "mujoco"] | None = None
    """Plant on which the orbit is found (default: mujoco; linear if the run file gives matrices)."""
    start: Literal["auto", "prediction", "simulation"] = "auto"
    """Initial guess: the predicted orbit, or the end of a simulation; auto uses the prediction if there is one."""
    json: bool = False
    """Print JSON instead of a table."""

    def carry_out(self, out: Terminal, err: Terminal) -> None:
        """Find the cycle of one case and print it beside the prediction."""
        from icmj.case.case import prepare
        from icmj.cycle.cycle import find_cycle
        from icmj.cycle.switched import has_exact_cycle
        from icmj.study.study import plants_of

        run = self.load(self.run)
        plant = self.plant or plants_of(run)[-1]
        with Working(f"cycle of {run.case.name}", err):
            case = prepare(run)
        if (theory := case.theory) is None:
            if plant == "linear" and has_exact_cycle(case.controller):
                _show_switched_cycle(case, self.json, out, err)
            else:
                _show_rounds(case, plant, self.json, out, err)
            return
        with Working(f"cycle of {run.case.name}", err) as working:
            found = find_cycle(
                case, plant, start=self.start, progress=lambda done: working.tell(f"cycle of {run.case.name}", done)
            )
        if self.json:
            out.show(_plain_cycle(found, case, theory.prediction))
            return
        _show_cycle(found, case, theory.prediction, out)
        for notice in case.notices:
            if not (self.set and notice.kind == "paper"):
                out.note(notice)


def _plain_cycle(found: Cycle, case: Case, prediction: Prediction) -> dict[str, Any]:
    """What ``icmj cycle --json`` prints."""
    from icmj.base.numbers import pick, plain

    assumed, actual = case.assumed.linearisation.plant, case.actual.linearisation.plant
    return plain(
        {
            "plant": found.plant,
            "attracting": found.verdict == "attracting",
            **pick(found, "verdict", "mirrored", "events", "interval", "intervals", "period"),
            "outputs": actual.outputs,
            "peak": found.y_peak,
            "range": found.y_range,
            **pick(found, "multipliers", "multiplier_errors", "neutral", "alternating"),
            "states": {"plant": actual.states, "observer": assumed.states, "at_events": found.states},
            "closure": found.closure,
            "iterations": len(found.history) - 1,
            **pick(found, "interval_error", "words"),
            "prediction": pick(prediction, "delta_crit", "period", "verdict", "multipliers"),
        }
    )


def _show_cycle(found: Cycle, case: Case, prediction: Prediction, out: Terminal) -> None:
    from icmj.base.numbers import amount

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
    if theirs:  # with those that the theory leaves out
        left_out = (1.0 + 0j,) * found.alternating + (found.sign + 0j,) * found.neutral
        theirs = tuple(sorted((*theirs, *left_out), key=abs, reverse=True))
    for i, value in enumerate(found.multipliers[:4]):
        error = found.multiplier_errors[i]
        expected = _write_multiplier(theirs[i]) if i < len(theirs) else "–"
        rows.append((f"multiplier {i + 1}", f"{_write_multiplier(value)} ± {error:.0e}", expected))
    columns = Column(""), Column(found.plant), Column("linear prediction")
    show_table(columns, rows, out, title=case.run.title)
    say_changes(case.run, out)
    out.say(found.words)
    error = (
        f"; relative error of the interval by the step {found.interval_error:.0e}" if found.plant != "linear" else ""
    )
    steps = len(found.history) - 1
    out.say(f"It closes to {found.closure:.0e} after {steps} Newton steps{error}.")


def _write_multiplier(value: complex) -> str:
    from icmj.base.numbers import amount, root

    return root(value, 6) + (f" ({amount(abs(value))})" if abs(value.imag) > 1e-12 else "")


def _show_switched_cycle(case: Case, json: bool, out: Terminal, err: Terminal) -> None:
    """Find the cycle that the run settles on, and print it.

    Raises:
        CycleError: if there is none.
    """
    from icmj.cycle.switched import find_switched_cycle, make_loop

    run = case.run
    with Working(f"cycle of {run.case.name}", err):
        plant, law, x0 = make_loop(case)
        with prefix_errors(run.path):
            found = find_switched_cycle(plant, law, x0)
    if json:
        out.show(_plain_switched_cycle(found))
        return
    out.say(f"{run.title} (linear): {found.words}")
    say_changes(run, out)
    for name, high, spread in zip(law.plant.outputs, found.y_peak, found.y_range, strict=True):
        out.say(f"{name}: peak {high:.6g}, peak to peak {spread:.6g}")
    shown = ", ".join(f"{mu.real:.6f}" if abs(mu.imag) < 1e-9 else f"{mu:.6f}" for mu in found.multipliers)
    out.say(f"multipliers {shown}; it closes to {found.closure:.0e}.")


def _plain_switched_cycle(found: SwitchedCycle) -> dict[str, Any]:
    from icmj.base.numbers import pick, plain

    return plain(
        {
            "plant": "linear",
            **pick(found, "period", "mirrored", "attracting"),
            "switches": len(found.switches) * (2 if found.mirrored else 1),
            "times": found.switches,
            "outputs": found.law.plant.outputs,
            "peak": found.y_peak,
            "range": found.y_range,
            **pick(found, "multipliers", "multiplier_errors", "states", "closure", "words"),
        }
    )


def _show_rounds(case: Case, plant: PlantKind, json: bool, out: Terminal, err: Terminal) -> None:
    """What a run without a prediction settles on: a cycle of events, or rounds of switches that shrink or grow."""
    from dataclasses import asdict

    import numpy as np

    from icmj.base.numbers import plain
    from icmj.errors import CycleError
    from icmj.experiments.switching_rounds import Rounds, rounds_of
    from icmj.measurement.measurement import Measurement, measure
    from icmj.study.study import admit, run_case

    run, real = case.run, case.controller.realisation
    with Working(f"cycle of {run.case.name}", err) as working:
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
        for name, high, low in zip(simulation.labels.outputs, *_find_reach(simulation, period), strict=True)
    }
    verdict = found.kind if isinstance(found, Measurement) else found.verdict
    if json:
        out.show(plain(asdict(found) | {"verdict": verdict, "words": found.words, "reach": reach}))
        return
    out.say(f"{run.title} ({plant}): {found.words}")
    say_changes(run, out)
    if verdict == "cycle" or (isinstance(found, Rounds) and found.switches and verdict == "on the edge"):
        out.say("Only the cycle that this run settles on is found; repelling ones are not looked for.")
    elif verdict == "noisy":
        out.say("Under noise there is no cycle; --set 'simulation.disturbance=[]' leaves the noise out.")
    if isinstance(found, Rounds) and not np.isnan(found.multiplier):
        out.say(f"A departure from the settled motion is multiplied by {found.multiplier:.4g} in a round.")
    last = "in the whole run" if np.isnan(period) else "in the last round"
    for name, (high, low) in reach.items():
        out.say(f"{name}: {low:.6g} to {high:.6g} {last}")


def _find_reach(simulation: Simulation, period: float) -> tuple[Array, Array]:
    """Largest and smallest of the outputs in the last period, or in all where there is none."""
    import numpy as np

    from icmj.base.array import is_between

    since = 0.0 if np.isnan(period) else max(simulation.t[-1] - period, 0.0)
    y = simulation.y[is_between(simulation.t, since)]
    return y.max(axis=0), y.min(axis=0)


COMMAND = CycleCommand
