"""The summary of a result: properties of the recording, and one page of Markdown for the replay."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import repeat
from typing import Any

import numpy as np

from icmj.base.numbers import amount, collect_facts, ordinal, relative
from icmj.base.numbers import eigenvalue as eigenvalue_in_words
from icmj.case.comparison import COMPARED, RUN, Comparison
from icmj.case.quantity import in_unit
from icmj.case.result import Result
from icmj.measurement.statistics import Estimate
from icmj.theory.prediction import PREDICTION

Properties = dict[str, dict[str, float | int | bool | str]]


def summarise(result: Result, compared: Comparison | None) -> Properties:
    """Facts of the run in full precision, by topic; a number that does not exist is left out.

    Args:
        result: the run.
        compared: the run beside its prediction, if there is one.
    """
    if compared is None:
        return _join(result, result.words, {"controller": _settings(result)})
    prediction, motion, outputs = result.expect_prediction(), result.motion, result.actual.outputs
    error = compared.relative_error
    off = () if error.amplitude is None else error.amplitude
    topics: dict[str, dict[str, Any]] = {
        "outcome": {"converged": compared.measured.converged},
        "predicted": _split(collect_facts(PREDICTION, prediction, "logged", outputs)),
        "measured": collect_facts(RUN, result, "logged", outputs) | {"words": motion.words},
        "relative_error": {"interval": error.interval, "period": error.period, "gamma": error.gamma}
        | {f"amplitude_{k}": float(v) for k, v in zip(outputs, off, strict=False)},
        "statistics": _statistics(result),
    }
    return _join(result, compared.words, topics)


def _join(result: Result, verdict: str, topics: Mapping[str, Mapping[str, Any]]) -> Properties:
    """Topics that not every result has, with those that all have; without what does not exist."""
    run, simulation = result.run, result.simulation
    outcome = simulation.outcome
    of_all: dict[str, dict[str, Any]] = {
        "case": {
            "name": run.case.name,
            "title": run.title,
            "changes": run.changes_in_words or None,
            "plant": simulation.plant,
            "control": simulation.control,
            "rows": len(simulation.t),
            "events": len(simulation.events),
        },
        "outcome": {"kind": outcome.kind, "time": outcome.t, "message": outcome.message, "verdict": verdict},
        "measures": dict(result.measures),
        "precision": dict(simulation.precision),
        "pressure": {} if simulation.pressure is None else dict(simulation.pressure.facts),
        "provenance": dict(result.provenance),
        "run_file": {"path": run.path.as_posix(), "text": run.text},
    }
    told = {name: {**of_all.get(name, {}), **topics.get(name, {})} for name in (*of_all, *topics)}
    return {name: {k: v for k, v in facts.items() if v is not None} for name, facts in told.items()}


def write_markdown(result: Result, compared: Comparison | None) -> str:
    """One page: the verdict, the numbers side by side if there is a prediction, how the run ended and what made it."""
    if compared is None:
        return _plain_page(result)
    simulation = result.simulation
    predicted, measured, error = compared.predicted, compared.measured, compared.relative_error
    outputs, units = result.actual.outputs, result.actual.output_units or ("",) * result.actual.n_y
    rows: list[tuple[str, Any, Any, Any]] = []
    for fact, expected in COMPARED:
        three = (getattr(predicted, expected.name), getattr(measured, fact.name), getattr(error, fact.name))
        if fact.kind == "outputs":
            each = zip(*(repeat(None) if values is None else values for values in three), strict=False)
            rows += [
                (in_unit(fact.label_of(name), unit), *values)
                for name, unit, values in zip(outputs, units, each, strict=False)
            ]
        else:
            mean = fact.name == "interval" and measured.kind == "noisy"  # which is not a cycle's interval
            rows.append((in_unit(fact.label, fact.unit), *three[:2], None if mean else three[2]))
    cycle, orbits = "a limit cycle" if predicted.cycle else "no limit cycle", result.expect_prediction().orbits
    eigenvalue = "" if predicted.eigenvalue is None else f" λ_crit = {eigenvalue_in_words(predicted.eigenvalue)};"
    lines = [
        *_head(result),
        f"**{PLANTS[simulation.plant]}**, {CONTROLS[simulation.control]}.",
        "",
        f"{compared.words}",
        "",
        "| | predicted | measured | error |",
        "| :-- | --: | --: | --: |",
        *(f"| {name} | {amount(p)} | {amount(m)} | {relative(e)} |" for name, p, m, e in rows),
        "",
        "## Prediction",
        f"The linear theory predicts {cycle};{eigenvalue} the orbit under the event rule: {predicted.verdict}.",
        f"By the paper's condition: {'a limit cycle' if predicted.by_paper else 'no limit cycle'}.",
        *(f"- {ordinal(i)} orbit: {one.words}" for i, one in enumerate(orbits) if len(orbits) > 1),
        "",
        "## Run",
        f"- outcome: the run {simulation.outcome.message}",
        f"- motion: {result.motion.words}",
        f"- {len(simulation.events)} events, {len(simulation.t)} rows",
        *_list_facts(simulation.precision),
        *([f"- {words}" for words in simulation.pressure.words] if simulation.pressure else ()),
        *(f"- {name}: {format_fact(value)}" for name, value in result.measures.items()),
        "",
        "## Provenance",
        *_list_facts(result.provenance),
    ]
    return "\n".join(lines) + "\n"


def _head(result: Result) -> list[str]:
    """The title, and beneath it which values are not the file's."""
    changes = [result.run.changes_in_words, ""] if result.run.changes_in_words else []
    return [f"# {result.run.title}", *changes]


def _plain_page(result: Result) -> str:
    """One page without a prediction: what the run did, the controller, how it was computed and what made it."""
    run = result.simulation
    parts = {
        "Controller": _settings(result),
        "Run": {
            "outcome": f"the run {run.outcome.message}",
            "switches": len(run.events),
            "rows": len(run.t),
            **result.measures,
            **run.precision,
        },
        "Provenance": result.provenance,
    }
    lines = [*_head(result), f"**{PLANTS[run.plant]}**, {result.controller.kind} control.", ""]
    lines.append(result.words)
    for title, facts in parts.items():
        lines += ["", f"## {title}", *_list_facts(facts)]
    if run.pressure is not None:
        lines += ["", "## Ground", *(f"- {words}" for words in run.pressure.words)]
    return "\n".join(lines) + "\n"


def _list_facts(facts: Mapping[str, Any]) -> list[str]:
    return [f"- {key.replace('_', ' ')}: {format_fact(value)}" for key, value in facts.items()]


def _settings(result: Result) -> dict[str, Any]:
    """The facts of the controller as a log's properties hold them."""
    found: dict[str, Any] = {}
    for key, value in result.controller.facts().items():
        if value is None:
            continue
        if not isinstance(value, bool | int | float | str):
            array = np.asarray(value)
            value = float(array.item()) if array.size == 1 else str(array.tolist())
        found[key] = value
    return found


def _statistics(result: Result) -> dict[str, float | None]:
    """Distributions under noise; nothing without."""
    found = result.statistics
    if found is None:
        return {}
    facts: dict[str, Estimate | None] = {
        "interval": found.interval,
        "interval_deviation": found.interval_deviation,
        "binding": found.binding,
    }
    for name, mean, rms in zip(result.actual.outputs, found.mean, found.rms, strict=True):
        facts |= {f"mean_{name}": mean, f"rms_{name}": rms}
    known = {name: fact for name, fact in facts.items() if fact is not None}
    values: dict[str, float | None] = {"events": found.events, "least": found.least}
    return values | {
        key: value for name, fact in known.items() for key, value in ((name, fact.value), (f"{name}_error", fact.error))
    }


PLANTS = {"linear": "Linear plant", "mujoco": "MuJoCo plant"}
CONTROLS = {"event": "event-driven", "clock": "clock-driven", "continuous": "continuous control"}


def format_fact(value: float | int | str) -> str:
    """A fact as readable text."""
    return amount(value) if isinstance(value, float) else str(value)


def _split(facts: dict[str, Any]) -> dict[str, Any]:
    """Facts with a complex number as two."""
    λ = facts.pop("eigenvalue")
    return facts | {"eigenvalue_re": None if λ is None else λ.real, "eigenvalue_im": None if λ is None else λ.imag}
