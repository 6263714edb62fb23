"""The section of designs: gains, eigenvalues and linearisations, as matrices."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from icmj.base import numbers
from icmj.base.array import Array
from icmj.plant.linear_plant import LinearPlant
from icmj.report.case_runs import CaseRuns
from icmj.report.section import Section


def designs(cases: Sequence[CaseRuns]) -> Section:
    """Assumed plants with their designs, and the actual plants."""
    blocks: list[tuple[Any, dict[str, Any]]] = []
    for case in cases:
        design = case.first.controller.design
        key = [design.plant.A, design.plant.B, design.plant.C, design.k, design.L]
        block = next((b for k, b in blocks if _same(k, key)), None)
        if block is None:
            block = {
                "states": design.plant.states,
                "inputs": design.plant.inputs,
                "outputs": design.plant.outputs,
                "matrices": [*_matrices(design.plant, "̂"), matrix("k̂", design.k), matrix("L", design.L)],
                "open_poles": numbers.poles(design.plant.poles),
                "controller_poles": numbers.poles(_sort_eigenvalues(design.A_c)),
                "observer_poles": numbers.poles(_sort_eigenvalues(design.A_o)),
                "cases": [],
            }
            blocks.append((key, block))
        block["cases"].append(case.first.run.title)
    plants = [
        {
            "title": case.first.run.title,
            "poles": numbers.poles(case.first.actual.poles),
            "state_feedback": case.prediction.state_feedback_stable,
            "observer_feedback": case.prediction.observer_feedback_stable,
            "matrices": _matrices(case.first.actual, ""),
        }
        for case in cases
    ]
    return Section(
        "design", "Design and linearisation", "design.html.j2", {"blocks": [b for _, b in blocks], "plants": plants}
    )


def matrix(name: str, values: Array) -> dict[str, Any]:
    """A matrix as the template draws it."""
    return {"name": name, "rows": [[numbers.short(float(v), 4) for v in row] for row in np.atleast_2d(values)]}


def _matrices(plant: LinearPlant, hat: str) -> list[dict[str, Any]]:
    return [matrix(f"{name}{hat}", values) for name, values in (("A", plant.A), ("B", plant.B), ("C", plant.C))]


def _sort_eigenvalues(A: Array) -> NDArray[np.complex128]:
    values = np.linalg.eigvals(A).astype(complex)
    return values[np.lexsort((values.imag, -values.real))]


def _same(a: Sequence[Array], b: Sequence[Array]) -> bool:
    return all(x.shape == y.shape and np.allclose(x, y, rtol=1e-9, atol=1e-12) for x, y in zip(a, b, strict=True))
