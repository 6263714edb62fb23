"""A fact of a result: what it is called, its unit, what it means, and how it is read; said once for all who show it."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from icmj.base.numbers import MISSING, amount, amounts, eigenvalue

Kind = Literal["number", "whole", "count", "truth", "text", "eigenvalue", "outputs"]
Place = Literal["record", "column", "logged"]


@dataclass(frozen=True)
class Fact:
    """One fact of a prediction or of a run.

    Attributes:
        name: what it is called in files, unless one of the last three says otherwise.
        label: what it is called in tables and cards.
        unit: "" if it has none; ``outputs`` have their own.
        meaning: in a phrase.
        of: reads it from that of which it is a fact; ``None`` where it does not exist.
        kind: of its value; ``outputs`` is a number for each output.
        figures: significant figures that are shown.
        answers: what is shown instead of true and false.
        only: the runs that have it: on ``mujoco``, or under ``noise``; "" for all.
        against: the fact of a prediction with which it is compared.
        record, column, logged: its key in ``summary.json``, its column in a sweep, and its property in a log; "" where
            it is not, the name if ``None``.
    """

    name: str
    label: str
    unit: str
    meaning: str
    of: Callable[[Any], Any]
    kind: Kind = "number"
    figures: int = 6
    answers: tuple[str, str] = ("yes", "no")
    only: str = ""
    against: str = ""
    record: str | None = None
    column: str | None = None
    logged: str | None = None

    def key(self, place: Place) -> str:
        """Its name in a place, "" where it is not."""
        given: str | None = getattr(self, place)
        return self.name if given is None else given

    def label_of(self, output: str) -> str:
        """Its label for one output."""
        return self.label.replace("each output", output)

    def value(self, thing: Any) -> Any:
        """Its value; ``None`` where it does not exist, or is a single number that is not finite."""
        found = self.of(thing)
        if found is None or self.kind == "text" or self.kind == "eigenvalue":
            return found
        if self.kind == "outputs":
            return np.asarray(found, float)
        if self.kind == "truth":
            return bool(found)
        return int(found) if self.kind != "number" else float(found) if math.isfinite(found) else None

    def shown(self, value: Any, names: Sequence[str] = (), units: Sequence[str] = ()) -> str:
        """A value of it for people; ``names`` and ``units`` are those of the outputs."""
        if value is None:
            return MISSING
        if self.kind == "outputs":
            return amounts(value, names, units, self.figures)
        if self.kind == "eigenvalue":
            return eigenvalue(value)
        if self.kind == "truth":
            return self.answers[0] if value else self.answers[1]
        return amount(value, self.unit, self.figures) if self.kind == "number" else str(value)


def told(facts: Iterable[Fact], thing: Any, place: Place, names: Sequence[str] = ()) -> dict[str, Any]:
    """Facts of a thing by their keys in a place.

    With ``names``, those of the outputs, what is one for each output has a key for each.
    """
    found: dict[str, Any] = {}
    for fact in facts:
        if key := fact.key(place):
            value = fact.value(thing)
            if fact.kind == "outputs" and names:
                each = () if value is None else zip(names, value, strict=False)
                found |= {f"{key}_{of}": float(v) if math.isfinite(v) else None for of, v in each}
            else:
                found[key] = value
    return found
