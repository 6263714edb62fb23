"""The section of designs: gains, eigenvalues and linearisations, as matrices."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from icmj.base import numbers
from icmj.base.array import Array, agree
from icmj.plant.linear_plant import LinearPlant
from icmj.report.material import Material
from icmj.report.section import Section


def compose(material: Material) -> Section | None:
    """Assumed plants with their designs, and the actual plants."""
    blocks: list[tuple[Any, dict[str, Any]]] = []
    if not (cases := material.cases):
        return None
    for case in cases:
        design = case.controller.design
        key = [design.plant.A, design.plant.B, design.plant.C, design.k, design.L]
        block = next((b for k, b in blocks if agree(k, key)), None)
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
    return Section("design", "Design and linearisation", TEMPLATE, {"blocks": [b for _, b in blocks], "plants": plants})


def matrix(name: str, values: Array) -> dict[str, Any]:
    """A matrix as the template draws it."""
    return {"name": name, "rows": [[numbers.short(float(v), 4) for v in row] for row in np.atleast_2d(values)]}


def _matrices(plant: LinearPlant, hat: str) -> list[dict[str, Any]]:
    return [matrix(f"{name}{hat}", values) for name, values in (("A", plant.A), ("B", plant.B), ("C", plant.C))]


def _sort_eigenvalues(A: Array) -> NDArray[np.complex128]:
    values = np.linalg.eigvals(A).astype(complex)
    return values[np.lexsort((values.imag, -values.real))]


TEMPLATE = """\
{% from "macros.html.j2" import matrix, mark %}
<p>Each design uses the assumed plant: the linearisation of an MJCF model at its operating point by centred differences, or the matrices given in the run file. A hat (Â, B̂, Ĉ) marks this assumed plant; without a hat, A, B and C belong to the actual plant. k is the gain of the state feedback and L that of the observer. Poles are in rad/s, matrices in SI units. The state consists of the deviations of positions, velocities and activations from the operating point.</p>
{% for block in c.blocks %}
<h3>Design {{ loop.index }}</h3>
<p class="note">Used for: {{ block.cases|join("; ") }}.</p>
<dl>
<dt>States</dt><dd>{{ block.states|join(", ") }}</dd>
<dt>Inputs</dt><dd>{{ block.inputs|join(", ") }}</dd>
<dt>Outputs</dt><dd>{{ block.outputs|join(", ") }}</dd>
<dt>Open-loop poles</dt><dd>{{ block.open_poles }}</dd>
<dt>Poles of the state feedback, A<sub>c</sub> = Â − B̂k̂</dt><dd>{{ block.controller_poles }}</dd>
<dt>Poles of the observer, A<sub>o</sub> = Â − LĈ</dt><dd>{{ block.observer_poles }}</dd>
</dl>
<details><summary>Matrices</summary><div class="matrices">{% for m in block.matrices %}{{ matrix(m) }}{% endfor %}</div></details>
{% endfor %}
<h3>Actual plants</h3>
<div class="wide"><table class="stack">
<caption><b>Table {{ next_table() }}.</b> Open-loop poles of each actual plant, and whether it is stable under the continuous controller: with state feedback (A − Bk), and with the observer.</caption>
<thead><tr><th scope="col">Case</th><th scope="col">Poles (rad/s)</th><th scope="col">A − Bk stable</th><th scope="col">With observer stable</th></tr></thead>
<tbody>
{% for plant in c.plants %}
<tr><th scope="row">{{ plant.title }}</th><td data-label="Poles (rad/s)">{{ plant.poles }}</td><td data-label="A − Bk stable">{{ mark("✓" if plant.state_feedback else "✗", "stable" if plant.state_feedback else "unstable") }}</td><td data-label="With observer stable">{{ mark("✓" if plant.observer_feedback else "✗", "stable" if plant.observer_feedback else "unstable") }}</td></tr>
{% endfor %}
</tbody></table></div>
{% for plant in c.plants %}
<details><summary>Matrices: {{ plant.title }}</summary><div class="matrices">{% for m in plant.matrices %}{{ matrix(m) }}{% endfor %}</div></details>
{% endfor %}
"""  # noqa: E501
