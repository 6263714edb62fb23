"""What the page's sections share: runs side by side, panels, sections, sentences, settings.

The runs of one case side by side: the linear plant's and MuJoCo's, either of which may be missing.

A panel: its letter, its drawing and its caption, kept together.

A section: a heading, a template, and the facts that the template prints.

Sentences that several sections use.

Designs and linearisations, settings, precision and provenance of the runs.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from icmj.base import numbers
from icmj.base.array import Array, between
from icmj.case.comparison import Comparison, compare, on_predicted_cycle
from icmj.case.quantity import quantities
from icmj.case.result import Result, has_prediction
from icmj.controller.design import Design, output_weight
from icmj.errors import ReportError
from icmj.measurement.measurement import Measurement
from icmj.plant.linear_plant import LinearPlant
from icmj.report import style
from icmj.report.notation import symbol
from icmj.report.style import NAME
from icmj.theory.prediction import Prediction

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from icmj.case.result import PredictedResult


@dataclass(frozen=True, eq=False)
class CaseRuns:
    """One case: its name and its runs, keyed ``linear`` and ``mujoco``, in that order."""

    name: str
    runs: dict[str, PredictedResult]

    @property
    def linear(self) -> PredictedResult | None:
        """The run of the linear plant, if there."""
        return self.runs.get("linear")

    @property
    def mujoco(self) -> PredictedResult | None:
        """The run of the MuJoCo plant, if there."""
        return self.runs.get("mujoco")

    @property
    def first(self) -> PredictedResult:
        """The result to read shared facts from: the linear plant's if there, else MuJoCo's."""
        return next(iter(self.runs.values()))

    @property
    def last(self) -> PredictedResult:
        """The result drawn on top: MuJoCo's if there, else the linear plant's."""
        return list(self.runs.values())[-1]

    @property
    def prediction(self) -> Prediction:
        """The linear theory's prediction, the same for both plants."""
        return self.first.prediction

    @cached_property
    def comparisons(self) -> dict[str, Comparison]:
        """Each run compared with the prediction."""
        return {plant: compare(result) for plant, result in self.runs.items()}


def pair(results: Sequence[Result]) -> list[CaseRuns]:
    """Results grouped by case, in the order in which the cases first appear.

    Raises:
        ReportError: if there are none, two of the same case and plant, or one without a prediction.
    """
    if not results:
        raise ReportError("no results to report; give at least one log")
    groups: dict[str, dict[str, PredictedResult]] = {}
    for result in results:
        name, plant = result.run.case.name, result.simulation.plant
        if not has_prediction(result):
            kind = result.controller.kind
            raise ReportError(f"case {name!r}: a run under {kind} control has no prediction to stand beside")
        runs = groups.setdefault(name, {})
        if plant in runs:
            raise ReportError(f"two logs hold case {name!r} on the {plant} plant; give only one of them")
        runs[plant] = result
    return [
        CaseRuns(name, {plant: runs[plant] for plant in ("linear", "mujoco") if plant in runs})
        for name, runs in groups.items()
    ]


@dataclass(frozen=True)
class Panel:
    """One of the panels of a case.

    Attributes:
        letter: (a) to (f) are the paper's.
        drawing: draws it from the runs of a case, without its letter.
        caption: describes it in words.
        there: whether a case has it; the paper's six are drawn of every case.
    """

    letter: str
    drawing: Callable[[CaseRuns], Figure]
    caption: Callable[[CaseRuns], str]
    there: Callable[[CaseRuns], bool] = lambda case: True

    def draw(self, case: CaseRuns) -> Figure:
        """The figure, with the letter on it."""
        figure = self.drawing(case)
        style.letter(figure, f"({self.letter})")
        return figure


def compares(case: CaseRuns) -> bool:
    """Whether runs are compared with the orbit and the interval of Δ_crit: not under noise where none is predicted."""
    return case.prediction.cycle or not case.first.simulation.noisy


def shown_interval(case: CaseRuns) -> float | None:
    """Δ_crit [s] where the intervals of the runs are compared with it."""
    return case.prediction.delta_crit if compares(case) else None


@dataclass(frozen=True)
class Picture:
    """A drawn figure: its file name without suffix, its SVG as a data URI, and its alternative text.

    ``linked`` says where its axes of time, or its plane, are in it, as :func:`icmj.report.style.links` writes it.
    """

    name: str
    uri: str
    alt: str
    linked: str = ""


@dataclass(frozen=True)
class DrawnPanel:
    """A panel of one case on the page: letter, picture, and caption."""

    letter: str
    picture: Picture
    caption: str


@dataclass(frozen=True)
class Section:
    """One section of the page.

    Attributes:
        anchor: its id in the page.
        title: heading.
        template: file name in ``templates``.
        context: what the template prints.
    """

    anchor: str
    title: str
    template: str
    context: Mapping[str, Any] = field(default_factory=dict)


# mark, word and explanation of what a run did, beside what was predicted
_AS_PREDICTED = ("✓", "agrees", "settles on the predicted cycle")
_NONE_AS_PREDICTED = ("✓", "none, agrees", "settles on no cycle, and none is predicted")
_ANOTHER = ("○", "another cycle", "settles on a cycle that is not the predicted one")
_UNPREDICTED = ("○", "another cycle", "settles on a cycle where linear theory predicts none")
_MISSED = ("✗", "not reached", "does not settle, although the predicted cycle attracts")


def judge_run(comparison: Comparison | None) -> tuple[str, str, str]:
    """How a run agrees with its prediction: a mark, a word and an explanation."""
    if comparison is None:
        return numbers.MISSING, "", "no run"
    if comparison.measured.kind == "noisy":
        return numbers.MISSING, "under noise", "a motion under noise has no cycle"
    measured, predicted = comparison.measured, comparison.predicted
    return _agreement(measured.converged, measured.kind == "cycle", predicted.cycle)


def judge_attractor(prediction: Prediction, measurement: Measurement) -> tuple[str, str]:
    """Mark and explanation of a motion that one of many starts leads to.

    They follow the rule of :func:`judge_run`, except that a start from which the predicted cycle is not reached does
    not contradict the prediction, which is local.
    """
    on = on_predicted_cycle(prediction, measurement)
    mark, _, said = _agreement(on, measurement.kind == "cycle", prediction.cycle)
    return ("○", "a motion beside the predicted cycle") if mark == "✗" else (mark, said)


def _agreement(on_predicted: bool, settled: bool, cycle: bool) -> tuple[str, str, str]:
    """The rule of all marks: what a motion did, beside whether a cycle is predicted."""
    if on_predicted:
        return _AS_PREDICTED
    if not cycle:
        return _UNPREDICTED if settled else _NONE_AS_PREDICTED
    return _ANOTHER if settled else _MISSED


def verdicts(case: CaseRuns) -> list[str]:
    """The verdict on both plants in one sentence where they agree, else one each."""
    words = {plant: comparison.words for plant, comparison in case.comparisons.items()}
    if len(words) == 2 and len(set(words.values())) == 1:
        return [f"Both plants: {_lower(next(iter(words.values())))}"]
    where = {"linear": "Linear plant", "mujoco": NAME["mujoco"]}
    return [f"{where[plant]}: {_lower(text)}" for plant, text in words.items()]


def describe_sway(result: PredictedResult) -> str:
    """Between what the positions swing, from the extremes of the run's rows; empty where the motion has not settled.

    Of a cycle over its last period; under noise over the part that the statistics are of. Of more than three outputs
    with one unit, the three that swing most are named.
    """
    simulation, period = result.simulation, result.measurement.period
    end, noisy = float(simulation.t[-1]), result.statistics
    if result.measurement.kind == "cycle" and period is not None and np.isfinite(period):
        start, when = end - period, "Settled"
    elif result.measurement.kind == "noisy" and noisy is not None:
        start, when = noisy.start, f"In the last {noisy.end - noisy.start:.3g} s, under noise"
    else:
        return ""
    y = simulation.y[between(simulation.t, max(start, float(simulation.t[0])))]
    shown, outputs = quantities(result.actual), result.actual.outputs
    with np.errstate(over="ignore", invalid="ignore"):
        low, high = (ends * [quantity.factor for quantity in shown] for ends in (y.min(axis=0), y.max(axis=0)))
        span = high - low
    moving = [k for k, of in enumerate(shown) if not of.unit.endswith("/s") and np.isfinite(span[k]) and span[k] > 0]
    if not moving:
        return ""
    if len({shown[k].unit for k in moving}) == 1:
        moving = sorted(sorted(moving, key=lambda k: -span[k])[:NAMED])
    each: list[str] = []
    for k in moving[:NAMED]:
        most = max(span[j] for j in moving if shown[j].unit == shown[k].unit)
        ends = _extremes(float(low[k]), float(high[k]), float(most), shown[k].unit)
        each.append(f"the {outputs[k]} {'' if each else 'swings '}between {ends}")
    said = each[0] if len(each) == 1 else f"{', '.join(each[:-1])}{',' * (len(each) > 2)} and {each[-1]}"
    where = "in MuJoCo" if simulation.plant == "mujoco" else "on the linear plant"
    return f"{when} {where}, {said}."


def _extremes(low: float, high: float, most: float, unit: str) -> str:
    """Two values with as many decimals as show the largest distance of two such values to two figures at least."""
    decimals = 2 - int(np.floor(np.log10(5 * most)))
    ends = [f"{value:.{min(max(decimals, 0), 6)}f}".replace("-", "−") for value in (low, high)]
    if ends[0] == ends[1] or not 0 <= decimals <= 6:
        ends = [numbers.number(value, 3) for value in (low, high)]
    mark = "°" if unit == "deg" else f" {unit}".rstrip()
    return " and ".join(f"{end}{mark}" for end in ends)


def _lower(text: str) -> str:
    return text[:1].lower() + text[1:]


def notice_in_words(notice: str, where: str = "") -> str:
    """A notice as a sentence under its name, with the plant that it is about if it is not about all."""
    name, colon, words = notice.partition(": ")
    if not colon:
        name, words = "note", notice
    return f"{name[:1].upper()}{name[1:]}{f' ({where})' if where else ''}. {words[:1].upper()}{words[1:]}."


NAMED = 3  # outputs whose swing a sentence gives
WIDE = 9  # facts of the integration that have a column each
MANY = 3  # number of runs from which shared facts are listed once


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


def settings(cases: Sequence[CaseRuns]) -> Section:
    """What the paper does not print and was chosen here, how the runs were integrated, and where they come from."""
    rules = [case.first.controller.trigger.facts() for case in cases]
    keys = list(dict.fromkeys(key for rule in rules for key in rule))
    rows = []
    for case, rule in zip(cases, rules, strict=True):
        run, controller = case.first.run, case.first.controller
        rows.append(
            {
                "title": run.title,
                "changes": run.changes_in_words,
                "rule": [rule_fact(rule.get(key), controller.design) for key in keys],
                "hold": controller.hold.name,
                "duration": numbers.short(run.simulation.duration),
                "initial": numbers.setting(run.simulation.settings().initial),
                "weights": ", ".join(
                    f"{weight} = {numbers.setting(getattr(run.design, weight))}"
                    if getattr(run.design, gain) is None
                    else f"{gain} given"
                    for weight, gain in (("R_c", "k"), ("R_o", "L"))
                ),
            }
        )
    return Section(
        "settings",
        "Settings and provenance",
        "settings.html.j2",
        {
            "rule": [symbol(key) for key in keys],
            "rows": rows,
            "precision": _precision(cases),
            "provenance": _provenance(cases),
        },
    )


def rule_fact(value: object, design: Design) -> str:
    """One setting of the event rule as text; a weight on the states in its shortest form."""
    if value is None:
        return numbers.MISSING
    if not isinstance(value, np.ndarray):
        return numbers.setting(value)
    if value.shape == (design.plant.n, design.plant.n):
        if np.array_equal(value, np.eye(len(value))):
            return "I"
        if np.allclose(value, output_weight(design), rtol=1e-12, atol=0):
            return "ĈᵀĈ"
        if np.array_equal(value, np.diag(np.diag(value))):
            return f"diag({', '.join(numbers.short(float(v)) for v in np.diag(value))})"
    return numbers.setting(value.tolist())


def _precision(cases: Sequence[CaseRuns]) -> list[dict[str, Any]]:
    """A table for each plant: a row for each run, a column for each fact; facts shared by many runs are above it."""
    tables = []
    for plant, name in NAME.items():
        runs = [(case, case.runs[plant].simulation) for case in cases if plant in case.runs]
        keys = list(dict.fromkeys(key for _, simulation in runs for key in simulation.precision))
        said = {key: {_fact(simulation.precision.get(key)) for _, simulation in runs} for key in keys}
        shared = {key: facts.pop() for key, facts in said.items() if len(runs) >= MANY and len(facts) == 1}
        keys = [key for key in keys if key not in shared]
        rows: list[dict[str, Any]] = [
            {
                "title": case.first.run.title,
                "outcome": simulation.outcome.kind,
                "facts": [_fact(simulation.precision.get(key)) for key in keys],
            }
            for case, simulation in runs
        ]
        if rows:
            words = ", ".join(f"{key.replace('_', ' ')} {fact}" for key, fact in shared.items())
            plain = [key.replace("_", " ") for key in keys]
            if len(plain) > WIDE:  # what a page is not wide enough for, in words
                for row in rows:
                    pairs = zip(plain, row["facts"], strict=True)
                    row["facts"] = ["; ".join(f"{key} {fact}" for key, fact in pairs if fact != numbers.MISSING)]
                plain = ["integration"]
            tables.append({"plant": name, "keys": plain, "rows": rows, "shared": words})
    return tables


def _fact(value: object) -> str:
    if isinstance(value, float):
        return numbers.short(value, 3)
    return numbers.MISSING if value is None else str(value)


def _provenance(cases: Sequence[CaseRuns]) -> list[tuple[str, str]]:
    """Facts that all logs share once; others as the distinct values."""
    keys: list[str] = []
    results = [result for case in cases for result in case.runs.values()]
    for result in results:
        keys.extend(key for key in result.provenance if key not in keys)
    return [(key.replace("_", " "), _values(key, results)) for key in keys]


def _values(key: str, results: Sequence[Result]) -> str:
    values = list(dict.fromkeys(str(r.provenance[key]) for r in results if key in r.provenance))
    if key == "date" and len(values) > 1:
        return f"{min(values)} to {max(values)}"
    return ", ".join(values)
