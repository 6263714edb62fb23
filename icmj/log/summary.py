"""The summary of a result: properties of the recording, and one page of Markdown for the replay."""

from __future__ import annotations

from typing import Any

import numpy as np

from icmj.result import Result

Properties = dict[str, dict[str, float | int | bool | str]]


def properties(result: Result) -> Properties:
    """Facts of the run in full precision, by section; a number that does not exist is left out."""
    run, simulation, prediction, measured = result.run, result.simulation, result.prediction, result.measurement
    sections: dict[str, dict[str, Any]] = {
        "case": {
            "name": run.case.name,
            "title": run.case.title,
            "plant": simulation.plant,
            "control": simulation.control,
            "samples": len(simulation.t),
            "events": len(simulation.events),
        },
        "outcome": {
            "kind": simulation.outcome.kind,
            "time": simulation.outcome.t,
            "message": simulation.outcome.message,
        },
        "predicted": {
            "cycle": prediction.cycle,
            "delta_crit": prediction.delta_crit,
            "eigenvalue_re": None if prediction.eigenvalue is None else prediction.eigenvalue.real,
            "eigenvalue_im": None if prediction.eigenvalue is None else prediction.eigenvalue.imag,
            "period": prediction.period,
            "gamma": prediction.gamma,
            "verdict": prediction.verdict,
        }
        | _each("amplitude", result.actual.outputs, prediction.amplitude),
        "measured": {
            "kind": measured.kind,
            "events_per_period": measured.p,
            "mirrored": measured.mirrored,
            "interval": measured.interval,
            "period": measured.period,
            "residual": measured.residual,
            "words": measured.words,
        }
        | _each("amplitude", result.actual.outputs, measured.amplitude),
        "precision": dict(simulation.precision),
        "provenance": dict(result.provenance),
        "run_file": {"path": run.path.as_posix(), "text": run.text},
    }
    return {name: {k: v for k, v in section.items() if v is not None} for name, section in sections.items()}


def markdown(result: Result) -> str:
    """One page: what was asked, what was predicted, what happened."""
    run, simulation, prediction, measured = result.run, result.simulation, result.prediction, result.measurement
    compared = prediction.cycle
    rows = [("open-loop interval Δ", "s", prediction.delta_crit, measured.interval, compared)]
    rows += [("period", "s", prediction.period, measured.period, compared)]
    peaks = prediction.amplitude if prediction.amplitude is not None else [None] * len(result.actual.outputs)
    rows += [
        (f"peak of {name}", "", predicted, seen, compared)
        for name, predicted, seen in zip(result.actual.outputs, peaks, measured.amplitude, strict=True)
    ]
    lines = [
        f"# {run.case.title}",
        "",
        f"**{PLANTS[simulation.plant]}**, {CONTROLS[simulation.control]}.",
        "",
        f"{measured.words}",
        "",
        "| | predicted | measured | error |",
        "| :-- | --: | --: | --: |",
    ]
    lines += [
        f"| {name}{f' [{unit}]' if unit else ''} | {_n(p)} | {_n(m)} | {_error(p, m, c)} |"
        for name, unit, p, m, c in rows
    ]
    eigenvalue = prediction.eigenvalue
    lines += [
        "",
        "## Prediction",
        f"- limit cycle: **{'yes' if prediction.cycle else 'no'}**"
        + ("" if eigenvalue is None else f", λ_crit = {_c(eigenvalue)}"),
        f"- orbit under the event rule: {prediction.verdict}",
        f"- γ = {_n(prediction.gamma)}",
        "",
        "## Run",
        f"- {simulation.outcome.kind} at {simulation.outcome.t:.6g} s. {simulation.outcome.message}",
        f"- {len(simulation.events)} events, {len(simulation.t)} samples",
    ]
    lines += [f"- {key}: {value}" for key, value in simulation.precision.items()]
    lines += ["", "## Provenance", *(f"- {key}: {value}" for key, value in result.provenance.items())]
    return "\n".join(lines) + "\n"


PLANTS = {"linear": "Linear plant", "mujoco": "MuJoCo plant"}
CONTROLS = {"event": "event-driven", "clock": "clock-driven", "continuous": "continuous control"}


def _each(name: str, of: tuple[str, ...], values: Any) -> dict[str, float]:
    return {} if values is None else {f"{name}_{k}": float(v) for k, v in zip(of, values, strict=True)}


def _n(value: float | None) -> str:
    return "–" if value is None or not np.isfinite(value) else f"{value:.6g}"


def _c(value: complex) -> str:
    return f"{value.real:+.4g}" if abs(value.imag) < 1e-9 else f"{value.real:+.4g} {value.imag:+.4g}j"


def _error(predicted: float | None, measured: float | None, compared: bool) -> str:
    if not compared or predicted is None or measured is None or predicted == 0:
        return "–"
    return f"{measured / predicted - 1:+.1e}"
