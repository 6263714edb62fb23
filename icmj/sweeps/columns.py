"""The columns of a sweep's table, each with its meaning; missing values are empty."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import pyarrow as pa

from icmj.sweeps.plan import Plan
from icmj.sweeps.points import Value

TYPES = {"number": pa.float64(), "truth": pa.bool_(), "text": pa.string()}
PREDICTED = {
    "delta_crit": (pa.float64(), "Δ_crit [s]"),
    "eigenvalue": (pa.float64(), "eigenvalue there, +1 or −1; empty for a complex pair or none"),
    "cycle": (pa.bool_(), "whether a limit cycle is predicted"),
    "period": (pa.float64(), "of the predicted cycle [s]"),
    "verdict": (pa.string(), "on the predicted orbit: attracting, repelling, not admissible or none"),
    "multiplier": (pa.float64(), "largest multiplier of the predicted orbit under the event rule"),
    "gamma": (pa.float64(), "γ of the predicted orbit"),
    "state_feedback_stable": (pa.bool_(), "whether continuous state feedback is stable on the actual plant"),
    "observer_feedback_stable": (pa.bool_(), "whether continuous observer feedback is"),
}
MOTION = {
    "outcome": (pa.string(), "completed, fell, diverged, sliding or stalled"),
    "end": (pa.float64(), "when the run ended [s]"),
    "kind": (pa.string(), "cycle, quasi-periodic, irregular, growth, decay, homoclinic, noisy, too short, no events"),
    "on_predicted": (pa.bool_(), "whether it settled on the predicted cycle"),
    "interval": (pa.float64(), "mean open-loop interval over the last period, or of the last ones [s]"),
    "error": (pa.float64(), "relative departure of a settled interval from Δ_crit, where a cycle is predicted"),
    "p": (pa.int32(), "events in a period"),
    "mirrored": (pa.bool_(), "whether the second half of the cycle is the first with opposite sign"),
    "period": (pa.float64(), "time after which the state repeats [s]"),
    "residual": (pa.float64(), "relative closure error of the last period"),
    "events": (pa.int64(), "events in the run"),
}
STEP = {"step_error": (pa.float64(), "relative error by the engine's step, estimated on the last interval")}
PEAK = (pa.float64(), "largest magnitude of the output over a period, or of late in the run [its unit]")
RMS = (pa.float64(), "standard deviation of the output [its unit]")
NOISY = {
    "interval_error": (pa.float64(), "half width of the 95 % confidence interval of the mean interval [s]"),
    "interval_deviation": (pa.float64(), "standard deviation of the intervals [s]"),
    "binding": (pa.float64(), "share of the intervals that end at Δ_min"),
}
CYCLE = {
    "found": (pa.bool_(), "whether Newton found a cycle from the prediction or, where there is none, from the run"),
    "words": (pa.string(), "why not"),
    "interval": (pa.float64(), "mean open-loop interval of the exact cycle [s]"),
    "error": (pa.float64(), "its relative departure from Δ_crit, where a cycle is predicted"),
    "period": (pa.float64(), "of the exact cycle [s]"),
    "p": (pa.int32(), "events in it"),
    "mirrored": (pa.bool_(), "whether its second half is the first with opposite sign"),
    "attracting": (pa.bool_(), "whether every multiplier is inside the unit circle"),
    "multiplier": (pa.float64(), "magnitude of the largest multiplier"),
}
# of a controller that is not intermittent, which has no critical interval
ROOT = {
    "root_real": (
        pa.float64(),
        "real part of the rightmost characteristic root of the loop with all feedback on [1/s]",
    ),
    "root_imag": (pa.float64(), "its imaginary part, not negative [rad/s]"),
}
TRIED = {
    "outcome": (pa.string(), "completed, fell, diverged, stalled"),
    "end": (pa.float64(), "when the run ended [s]"),
    "switches": (pa.int64(), "switches in the run"),
    "growth": (
        pa.float64(),
        "rate at which the size of the motion changes, over its last rounds or its second half [1/s]",
    ),
    "factor": (pa.float64(), "size of a round over that of the one before; empty without rounds"),
    "period": (pa.float64(), "of a round [s]; empty without rounds"),
}
OWN = (pa.float64(), "a number of a measure of the user's own")
LATE_PEAK = (pa.float64(), "largest magnitude of the output in the second half of the run [its unit]")
LATE_RMS = (pa.float64(), "standard deviation of the output in the second half of the run [its unit]")
ATTRACTORS = {
    "attractors": (pa.int32(), "motions found from random starts of the linear plant"),
    "attractor_kind": (pa.list_(pa.string()), "what each is, the most frequent first"),
    "attractor_p": (pa.list_(pa.int32()), "events in its period"),
    "attractor_interval": (pa.list_(pa.float64()), "its mean open-loop interval [s]"),
    "attractor_share": (pa.list_(pa.float64()), "share of the starts that led there"),
}


def meanings(plan: Plan) -> dict[str, tuple[pa.DataType, str]]:
    """All columns of a plan by name: their type, and what they mean."""
    ask, noisy = plan.file.ask, plan.file.base.simulation.settings().noisy
    varies = zip(plan.points.names, plan.points.kinds, strict=True)
    return columns(
        varies, plan.outputs, motion=ask.motion, cycle=ask.cycle, noisy=noisy, attractors=bool(ask.attractors),
        tried=plan.file.base.tries, measures=plan.measures,
    )  # fmt: skip


def columns(
    varies: Iterable[tuple[str, str]],
    outputs: Sequence[str],
    *,
    motion: Sequence[str],
    cycle: Sequence[str],
    noisy: bool,
    attractors: bool,
    tried: bool = False,
    measures: Sequence[str] = (),
) -> dict[str, tuple[pa.DataType, str]]:
    """All columns by name: of what varies (name and kind), of outputs, of plants asked for a motion or a cycle.

    ``tried`` says whether the controller is not intermittent; ``measures`` are names of the user's own numbers.
    """
    told = own(dict.fromkeys(measures, OWN))
    found: dict[str, tuple[pa.DataType, str]] = {"point": (pa.int64(), "index of the point")}
    found |= {name: (TYPES[kind], "what varies") for name, kind in varies}
    found["status"] = (pa.string(), "ok, failed, or died with its process")
    found["words"] = (pa.string(), "why it failed; empty where it did not")
    if tried:
        found |= ROOT
        for plant in motion:
            found |= {f"{plant}_{name}": column for name, column in (TRIED | told).items()}
            found |= {f"{plant}_peak_{output}": LATE_PEAK for output in outputs}
            found |= {f"{plant}_rms_{output}": LATE_RMS for output in outputs}
        return found
    found |= {f"predicted_{name}": column for name, column in PREDICTED.items()}
    found |= {f"predicted_peak_{output}": PEAK for output in outputs}
    for plant in motion:
        named = MOTION | (STEP if plant == "mujoco" else {}) | (NOISY if noisy else {}) | told
        found |= {f"{plant}_{name}": column for name, column in named.items()}
        found |= {f"{plant}_peak_{output}": PEAK for output in outputs}
        found |= {f"{plant}_rms_{output}": RMS for output in outputs if noisy}
    for plant in cycle:
        found |= {f"{plant}_cycle_{name}": column for name, column in CYCLE.items()}
        found |= {f"{plant}_cycle_peak_{output}": PEAK for output in outputs}
    return found | (ATTRACTORS if attractors else {})


def own(told: Mapping[str, Any]) -> dict[str, Any]:
    """What is told by the user's own measures, by column."""
    return {f"measure_{name}": value for name, value in told.items()}


def schema(plan: Plan) -> pa.Schema:
    """Names and types of all columns, and the facts of the plan as metadata."""
    return pa.schema([(name, kind) for name, (kind, _) in meanings(plan).items()], metadata=dict(plan.facts))


def table(plan: Plan, rows: Sequence[Mapping[str, Any]]) -> pa.Table:
    """Rows as a table with all columns; what a row does not have is empty."""
    fields = schema(plan)
    arrays = [pa.array([row.get(field.name) for row in rows], field.type) for field in fields]
    return pa.Table.from_arrays(arrays, schema=fields)


def begun(plan: Plan, index: int, values: tuple[Value, ...]) -> dict[str, Any]:
    """The start of a row: index of the point, and its varied values."""
    row: dict[str, Any] = {"point": index, "status": "ok", "words": ""}
    for name, kind, value in zip(plan.points.names, plan.points.kinds, values, strict=True):
        if kind == "number":
            row[name] = float(value)
        else:
            row[name] = json.dumps(value) if kind == "text" and not isinstance(value, str) else value
    return row
