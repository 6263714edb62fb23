"""The columns of a sweep's table, each with its meaning; missing values are empty."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import pyarrow as pa

from icmj.base.fact import Fact, Kind, told
from icmj.comparison.facts import RUN
from icmj.sweeps.facts import CYCLE, WITHOUT_PREDICTION
from icmj.sweeps.plan import Plan
from icmj.sweeps.points import Value
from icmj.theory.facts import PREDICTION

TYPES = {"number": pa.float64(), "truth": pa.bool_(), "text": pa.string()}
KINDS: dict[Kind, pa.DataType] = {
    "number": pa.float64(), "eigenvalue": pa.float64(), "outputs": pa.float64(), "whole": pa.int32(),
    "count": pa.int64(), "truth": pa.bool_(), "text": pa.string(),
}  # fmt: skip
# of a controller without an event rule, which has no critical interval
ROOT = {
    "root_real": (
        pa.float64(),
        "real part of the rightmost characteristic root of the loop with all feedback on [1/s]",
    ),
    "root_imag": (pa.float64(), "its imaginary part, not negative [rad/s]"),
}
OWN = (pa.float64(), "a number of a measure of the user's own")
ATTRACTORS = {
    "attractors": (pa.int32(), "motions found from random starts of the linear plant"),
    "attractor_kind": (pa.list_(pa.string()), "what each is, the most frequent first"),
    "attractor_p": (pa.list_(pa.int32()), "events in its period"),
    "attractor_interval": (pa.list_(pa.float64()), "its mean open-loop interval [s]"),
    "attractor_share": (pa.list_(pa.float64()), "share of the starts that led there"),
}


def meanings(plan: Plan) -> dict[str, tuple[pa.DataType, str]]:
    """All columns of a plan by name: their type, and what they mean."""
    ask, noisy = plan.file.ask, plan.file.base.drawn().simulation.settings().noisy
    varies = zip(plan.points.names, plan.points.kinds, strict=True)
    return columns(
        varies, plan.outputs, motion=ask.motion, cycle=ask.cycle, noisy=noisy, attractors=bool(ask.attractors),
        predicted=plan.file.base.has_events, measures=plan.measures,
    )  # fmt: skip


def columns(
    varies: Iterable[tuple[str, str]],
    outputs: Sequence[str],
    *,
    motion: Sequence[str],
    cycle: Sequence[str],
    noisy: bool,
    attractors: bool,
    predicted: bool = True,
    measures: Sequence[str] = (),
) -> dict[str, tuple[pa.DataType, str]]:
    """All columns by name: of what varies (name and kind), of outputs, of plants asked for a motion or a cycle.

    ``predicted`` says whether the controller has an event rule, and with it a prediction; ``measures`` are names of the
    user's own numbers.
    """
    measured = own(dict.fromkeys(measures, OWN))
    found: dict[str, tuple[pa.DataType, str]] = {"point": (pa.int64(), "index of the point")}
    found |= {name: (TYPES[kind], "what varies") for name, kind in varies}
    found["status"] = (pa.string(), "ok, failed, or died with its process")
    found["words"] = (pa.string(), "why it failed; empty where it did not")
    found |= _described("predicted", PREDICTION, outputs) if predicted else ROOT
    for plant in motion:
        there = {"", plant, "noise" if noisy else ""}
        facts = [fact for fact in RUN if fact.only in there] if predicted else WITHOUT_PREDICTION
        found |= _described(plant, facts, outputs) | {f"{plant}_{name}": column for name, column in measured.items()}
    for plant in cycle:
        found |= _described(f"{plant}_cycle", CYCLE, outputs)
    return found | (ATTRACTORS if attractors else {})


def row_of(what: str, facts: Iterable[Fact], thing: Any, outputs: Sequence[str]) -> dict[str, Any]:
    """The values of facts by column, after what they are of; of an eigenvalue on the unit circle, its sign."""
    return {
        f"{what}_{name}": float(np.sign(value.real)) if isinstance(value, complex) else value
        for name, value in told(facts, thing, "column", outputs).items()
    }


def _described(what: str, facts: Iterable[Fact], outputs: Sequence[str]) -> dict[str, tuple[pa.DataType, str]]:
    """The columns of facts, after what they are of."""
    found: dict[str, tuple[pa.DataType, str]] = {}
    for fact in facts:
        key, unit = fact.key("column"), "its unit" if fact.kind == "outputs" else fact.unit
        named = [f"{key}_{output}" for output in outputs] if fact.kind == "outputs" else [key]
        meaning = f"{fact.meaning} [{unit}]" if unit else fact.meaning
        found |= {f"{what}_{name}": (KINDS[fact.kind], meaning) for name in named if key}
    return found


def own(numbers: Mapping[str, Any]) -> dict[str, Any]:
    """What is told by the user's own measures, by column."""
    return {f"measure_{name}": value for name, value in numbers.items()}


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
