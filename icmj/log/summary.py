"""The summary of a result: properties of the recording, and one page of Markdown for the replay."""

from __future__ import annotations

from typing import Any

import numpy as np

from icmj.comparison.comparison import Comparison
from icmj.measurement.blocks import Estimate
from icmj.result.result import Result

Properties = dict[str, dict[str, float | int | bool | str]]


def properties(result: Result, compared: Comparison) -> Properties:
    """Facts of the run in full precision, by topic; a number that does not exist is left out.

    Args:
        result: the run.
        compared: the run beside its prediction.
    """
    run, simulation, prediction, motion = result.run, result.simulation, result.prediction, result.measurement
    outputs = result.actual.outputs
    predicted, measured, error = compared.predicted, compared.measured, compared.relative_error
    eigenvalue = predicted.eigenvalue
    topics: dict[str, dict[str, Any]] = {
        "case": {
            "name": run.case.name,
            "title": run.case.title,
            "plant": simulation.plant,
            "control": simulation.control,
            "rows": len(simulation.t),
            "events": len(simulation.events),
        },
        "outcome": {
            "kind": simulation.outcome.kind,
            "time": simulation.outcome.t,
            "message": simulation.outcome.message,
            "verdict": compared.words,
            "converged": measured.converged,
        },
        "predicted": {
            "cycle": predicted.cycle,
            "delta_crit": predicted.delta_crit,
            "eigenvalue_re": None if eigenvalue is None else eigenvalue.real,
            "eigenvalue_im": None if eigenvalue is None else eigenvalue.imag,
            "period": predicted.period,
            "gamma": predicted.gamma,
            "verdict": predicted.verdict,
            "state_feedback_stable": prediction.state_feedback_stable,
            "observer_feedback_stable": prediction.observer_feedback_stable,
        }
        | _each("amplitude", outputs, predicted.amplitude),
        "measured": {
            "kind": measured.kind,
            "events_per_period": motion.p,
            "mirrored": motion.mirrored,
            "interval": measured.interval,
            "period": measured.period,
            "gamma": measured.gamma,
            "residual": motion.residual,
            "words": motion.words,
        }
        | _each("amplitude", outputs, measured.amplitude),
        "relative_error": {"interval": error.interval, "period": error.period, "gamma": error.gamma}
        | _each("amplitude", outputs, error.amplitude),
        "statistics": _statistics(result),
        "measures": dict(result.measures),
        "precision": dict(simulation.precision),
        "pressure": {} if simulation.pressure is None else dict(simulation.pressure.facts),
        "provenance": dict(result.provenance),
        "run_file": {"path": run.path.as_posix(), "text": run.text},
    }
    return {name: {k: v for k, v in facts.items() if v is not None} for name, facts in topics.items()}


def markdown(result: Result, compared: Comparison) -> str:
    """One page: the verdict, the numbers side by side, how the run ended and what made it."""
    run, simulation = result.run, result.simulation
    predicted, measured, error = compared.predicted, compared.measured, compared.relative_error
    outputs, nothing = result.actual.outputs, [None] * result.actual.n_y
    apart = None if measured.kind == "noisy" else error.interval  # a mean under noise is not a cycle's interval
    rows = [
        ("interval Δ [s]", predicted.delta_crit, measured.interval, apart),
        ("period [s]", predicted.period, measured.period, error.period),
        ("γ", predicted.gamma, measured.gamma, error.gamma),
        *(
            (f"peak {name} [{unit}]" if unit else f"peak {name}", *numbers)
            for name, unit, *numbers in zip(
                outputs,
                result.actual.output_units,
                nothing if predicted.amplitude is None else predicted.amplitude,
                measured.amplitude,
                nothing if error.amplitude is None else error.amplitude,
                strict=True,
            )
        ),
    ]
    cycle = "a limit cycle" if predicted.cycle else "no limit cycle"
    eigenvalue = "" if predicted.eigenvalue is None else f" λ_crit = {_complex(predicted.eigenvalue)};"
    lines = [
        f"# {run.case.title}",
        f"**{PLANTS[simulation.plant]}**, {CONTROLS[simulation.control]}.",
        "",
        f"{compared.words}",
        "",
        "| | predicted | measured | error |",
        "| :-- | --: | --: | --: |",
        *(f"| {name} | {_number(p)} | {_number(m)} | {_error(e)} |" for name, p, m, e in rows),
        "",
        "## Prediction",
        f"The linear theory predicts {cycle};{eigenvalue} the orbit under the event rule: {predicted.verdict}.",
        "",
        "## Run",
        f"- outcome: the run {simulation.outcome.message}",
        f"- motion: {result.measurement.words}",
        f"- {len(simulation.events)} events, {len(simulation.t)} rows",
        *(f"- {key.replace('_', ' ')}: {in_words(value)}" for key, value in simulation.precision.items()),
        *([f"- {words}" for words in simulation.pressure.words] if simulation.pressure else ()),
        *(f"- {name}: {in_words(value)}" for name, value in result.measures.items()),
        "",
        "## Provenance",
        *(f"- {key.replace('_', ' ')}: {value}" for key, value in result.provenance.items()),
    ]
    return "\n".join(lines) + "\n"


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


def _each(name: str, of: tuple[str, ...], values: Any) -> dict[str, float]:
    return {} if values is None else {f"{name}_{k}": float(v) for k, v in zip(of, values, strict=True)}


def in_words(value: float | int | str) -> str:
    """A fact as readable text."""
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def _number(value: float | None) -> str:
    return "–" if value is None or not np.isfinite(value) else f"{value:.6g}"


def _complex(value: complex) -> str:
    return f"{value.real:+.4g}" if abs(value.imag) < 1e-9 else f"{value.real:+.4g} {value.imag:+.4g}j"


def _error(value: float | None) -> str:
    return "–" if value is None or not np.isfinite(value) else f"{value:+.1e}"
