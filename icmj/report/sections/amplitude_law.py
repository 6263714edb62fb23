"""The section of the amplitude law: how far amplitude and interval depart from linear theory as the threshold grows."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from icmj.base import numbers
from icmj.case.quantity import in_unit
from icmj.report.axes.law import draw_law, find_law
from icmj.report.case_runs import CaseRuns
from icmj.report.material import Material
from icmj.report.panel import draw_alone
from icmj.report.picture import Drawing
from icmj.report.section import Section


def compose(material: Material) -> Section | None:
    """The amplitude law, or ``None`` where no log holds one."""
    items: list[dict[str, Any]] = []
    for case in material.cases:
        if (found := find_law(case)) is not None:
            law, unit = found
            each = zip(law.q_t, law.interval_error, law.amplitude_error, strict=True)
            items.append(
                {
                    "title": case.first.run.title,
                    "threshold": in_unit("Threshold", unit),
                    "picture": material.show(*list_drawings(case)),
                    "open": bool(np.isnan(law.interval_error).any()),
                    "interval_slope": f"{law.interval_slope:.3f}",
                    "amplitude_slope": f"{law.amplitude_slope:.3f}",
                    "rows": [
                        [numbers.short(q), *(numbers.error(error, signed=False) for error in errors)]
                        for q, *errors in each
                    ],
                }
            )
    return Section("law", "The amplitude law", TEMPLATE, {"items": items}) if items else None


def list_drawings(case: CaseRuns) -> list[Drawing]:
    """The amplitude law, where it was measured."""
    if (found := find_law(case)) is None:
        return []
    draw = partial(draw_alone, lambda axes: draw_law(axes, *found))
    return [Drawing(f"{case.name}_law", f"{case.first.run.title}, amplitude law", draw)]


TEMPLATE = """\
<p>On the linear plant the amplitude is proportional to the threshold, and the interval does not depend on it. The MuJoCo plant is nonlinear with odd symmetry, so its departure from the prediction should decrease with the square of the threshold (slope 2). If the integration had a first-order error, such as an event detected late, the curves would level off.</p>
{% for item in c['items'] %}
<figure class="law">
<div class="panels">
<div class="panel">{{ item.picture|drawn }}</div>
<table>
<thead><tr><th scope="col">{{ item.threshold }}</th><th scope="col">Interval error</th><th scope="col">Amplitude error</th></tr></thead>
<tbody>
{% for row in item.rows %}
<tr>{% for value in row %}<td>{{ value }}</td>{% endfor %}</tr>
{% endfor %}
</tbody>
</table>
</div>
<figcaption><b>Figure {{ next_figure() }}.</b> {{ item.title }}: relative error of the interval and of the peak of the largest output, against the threshold. Fitted slopes: {{ item.interval_slope }} (interval), {{ item.amplitude_slope }} (amplitude).{% if item.open %} A dash: at this threshold the run in MuJoCo, which starts on the predicted orbit, does not settle on a cycle in the time that it has.{% endif %}</figcaption>
</figure>
{% endfor %}
"""  # noqa: E501
