"""The log of a controller that is not intermittent: its summary, its signals, and the initial view of the replay."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import rerun.blueprint as rrb

from icmj.log import palette
from icmj.log.blueprint import arranged, body, plot, whole_run
from icmj.log.signals import Group, acting_groups, pressure_groups, setpoint_groups
from icmj.log.summary import PLANTS, Properties, in_words, joined
from icmj.result.tried import Tried
from icmj.view.quantity import in_brackets, shared_unit


def properties(result: Tried) -> Properties:
    """Facts of the run in full precision, by topic."""
    return joined(result, result.words, {"controller": _facts(result.law.facts())})


def markdown(result: Tried) -> str:
    """One page: what the run did, the controller, how it was computed and what made it."""
    simulation = result.simulation
    parts = {
        "Controller": _facts(result.law.facts()),
        "Run": {
            "outcome": f"the run {simulation.outcome.message}",
            "switches": len(simulation.events),
            "rows": len(simulation.t),
            **result.measures,
            **simulation.precision,
        },
        "Provenance": result.provenance,
    }
    lines = [
        f"# {result.run.case.title}",
        f"**{PLANTS[simulation.plant]}**, {result.law.kind} control.",
        "",
        result.words,
    ]
    for title, facts in parts.items():
        lines += ["", f"## {title}", *(f"- {key.replace('_', ' ')}: {in_words(value)}" for key, value in facts.items())]
    return "\n".join(lines) + "\n"


def groups(result: Tried) -> Iterator[Group]:
    """Every group of series of the run."""
    run, plant = result.simulation, result.actual
    for path, values, names in (
        ("outputs/run", run.y, plant.outputs),
        ("inputs/run", run.u, plant.inputs),
        ("states/plant", run.x, plant.states),
    ):
        yield Group(path, run.t, values, names, palette.series(len(names)))
    yield from setpoint_groups(run)
    yield from acting_groups(result)
    yield from pressure_groups(result)
    if run.mode.size:
        yield Group("mode/run", run.t, run.mode[:, None].astype(float), (", ".join(run.modes),), (palette.RUNNING,))


def blueprint(result: Tried) -> rrb.Blueprint:
    """The arrangement: body, outputs, inputs and mode over time, summary."""
    axis = whole_run(result)
    plots = [
        plot(f"Outputs y{in_brackets(shared_unit(result.actual.output_units))}", "outputs", axis, ahead=True),
        plot(f"Inputs u{in_brackets(shared_unit(result.actual.input_units))}", "inputs", axis, ahead=True),
        plot("Plant state x", "states/plant", axis, ahead=True),
    ]
    if result.simulation.mode.size:
        plots.append(plot(f"Mode: {_numbered(result)}", "mode", axis, ahead=True))
    left: list[Any] = [body(result)] if result.scene is not None else []
    right = rrb.TextDocumentView(origin="summary", name="Summary")
    return arranged(*(rrb.Vertical(*part) for part in (left, plots, [right]) if part))


def _numbered(result: Tried) -> str:
    return ", ".join(f"{i} {name}" for i, name in enumerate(result.simulation.modes))


def _facts(facts: Mapping[str, Any]) -> dict[str, Any]:
    """Facts as a log's properties hold them."""
    return {
        key: value if isinstance(value, bool | int | float | str) else _written(np.asarray(value))
        for key, value in facts.items()
        if value is not None
    }


def _written(value: np.ndarray) -> float | str:
    return float(value.item()) if value.size == 1 else str(value.tolist())
