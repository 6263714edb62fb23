"""The page of an experiment: what it is of, what was found, its figure, its numbers with their uncertainty, methods."""

from __future__ import annotations

import base64
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from icmj.base.numbers import MISSING, count, number, readable
from icmj.experiments.quiet_standing import YOUNG_PEOPLE
from icmj.measurement.sway import MEASURES
from icmj.report import style
from icmj.report.builder import render_page
from icmj.report.sections import Picture, Section

PLANTS = {"linear": "linear plant", "mujoco": "MuJoCo", "recording": "recorded"}
PRESSURE = "cop.x"
SIGNALS = {PRESSURE: "the centre of pressure from back to front (cop.x)"}
ROUNDING = 1e-9  # a share, or a relative scatter, below which there is nothing but rounding


@dataclass(frozen=True)
class Row:
    """The result of one case on one plant.

    Attributes:
        title, plant: of it.
        trials: how many.
        numbers: by name, with the unit in brackets.
        words: one sentence.
        deviations: standard deviations of numbers over trials.
    """

    title: str
    plant: str
    trials: int
    numbers: Mapping[str, float]
    words: str
    deviations: Mapping[str, float] = field(default_factory=dict)


def experiment_page(
    title: str,
    kind: str,
    settings: Any,
    rows: Sequence[Row],
    svg: bytes | None,
    files: Sequence[str] = (),
    notes: Sequence[str] = (),
) -> str:
    """The page's HTML.

    Args:
        title: of the experiment.
        kind: the name of its table.
        settings: this table.
        rows: the results.
        svg: the figure; ``None`` where nothing was found.
        files: names of recordings that were analysed; empty for simulated trials.
        notes: what was done to them, a line each.
    """
    uri = "" if svg is None else f"data:image/svg+xml;base64,{base64.b64encode(svg).decode()}"
    recorded = all(row.plant == "recording" for row in rows)
    results: dict[str, Any] = {
        "picture": Picture("figure", uri, f"{title}, figure") if uri else None,
        "caption": CAPTIONS[kind] if kind != "quiet_standing" else _caption_of_standing(rows),
        **_table(kind, rows),
    }
    methods = {
        "words": [*METHODS[kind](settings, recorded), *((_YOUNG,) if results["people"] else ()), *map(_end, notes)]
    }
    return render_page(
        [
            Section("results", "Results", "experiment.html.j2", results),
            Section("methods", "Methods", "methods.html.j2", methods),
        ],
        title=title,
        subtitle=_subtitle(rows, files),
        findings=_findings(rows),
        kicker="Experiment",
        source="recordings" if recorded else "the trials in the folder of this page",
        beside="The figure is also available as SVG and PNG files beside this page." if uri else "",
    )


def _end(note: str) -> str:
    return note if note.endswith(".") else f"{note}."


def plant_name(plant: str) -> str:
    """The plant's name in words."""
    return style.NAME.get(plant, plant)


def _subtitle(rows: Sequence[Row], files: Sequence[str]) -> str:
    if all(row.plant == "recording" for row in rows):
        named = ", ".join(files[:3]) + (" …" if len(files) > 3 else "")
        return f"Recorded data: {count(sum(row.trials for row in rows), 'trial')}{f', from {named}' if files else ''}"
    cases, plants = list(dict.fromkeys(row.title for row in rows)), dict.fromkeys(PLANTS[row.plant] for row in rows)
    each = sorted({row.trials for row in rows})
    trials = f"{count(each[0], 'trial')} each" if len(each) == 1 else count(sum(row.trials for row in rows), "trial")
    where = f"{'on the' if 'linear plant' in plants else 'in'} {' and in '.join(plants)}"
    return f"Simulated data: {count(len(cases), 'case')} {where}, {trials}"


def _findings(rows: Sequence[Row]) -> list[tuple[str, str]]:
    """A sentence for each case; one for both plants where they agree to the last digit shown."""
    found = []
    for title in dict.fromkeys(row.title for row in rows):
        same = [row for row in rows if row.title == title]
        if len({row.words for row in same}) == 1:
            found.append((title, same[0].words))
        else:
            where = {"linear": "On the linear plant", "mujoco": "In MuJoCo"}
            parts = (f"{where[row.plant]}, {row.words[:1].lower()}{row.words[1:]}" for row in same)
            found.append((title, " ".join(parts)))
    return found


def _table(kind: str, rows: Sequence[Row]) -> dict[str, Any]:
    """Numbers down, cases and plants across; of quiet standing beside those of young people."""
    names = list(dict.fromkeys(name for row in rows for name in row.numbers))
    names = [name for name in names if not re.search(r", (from|to)( \(|$)", name)]
    signals = [name.partition(", RMS")[0] for name in names if kind == "quiet_standing" and ", RMS" in name]
    people = PRESSURE in signals
    lines = []
    for name in names:
        factor, label = _shown(kind, name)
        if len(signals) == 1:
            label = label.removeprefix(f"{signals[0]}, ")
        cells = [_cell(row, name, factor) for row in rows]
        lines.append((label, [*cells, _of_people(name, factor)] if people else cells))
    cases = list(dict.fromkeys(row.title for row in rows))
    several = len({row.plant for row in rows}) > 1
    heads = [(title, sum(row.title == title for row in rows)) for title in cases]
    labels = [f"{row.title}, {plant_name(row.plant)}" if several else row.title for row in rows]
    what = f"Measures are of {SIGNALS.get(signals[0], signals[0])}." if len(signals) == 1 else ""
    spread = any(row.deviations for row in rows)
    return {
        "heads": [*heads, *((("young people", 1),) if people else ())],
        "plants": [*(plant_name(row.plant) for row in rows), *(("recorded",) if people else ())] if several else None,
        "labels": [*labels, *(("young people",) if people else ())],
        "trials": [*(str(row.trials) for row in rows), *(("24",) if people else ())],
        "lines": lines,
        "note": f"{what} {_SPREAD if spread else ''}".strip(),
        "people": people,
    }


_SPREAD = "± is the standard deviation over trials."
_YOUNG = (
    "The values of young people are mean and standard deviation over 24 trials of 60 s of eight people on firm ground "
    "with open eyes, front to back, without a filter (recordings of Santos and Duarte 2016, doi 10.7717/peerj.2648)."
)


def _shown(kind: str, name: str) -> tuple[float, str]:
    """The factor on a number, and its name with the unit in which people read it."""
    words, bracket, unit = name.rstrip(")").partition(" (")
    if not bracket:
        share = name.startswith("explained") or "share" in name
        return (100.0, f"{name} (%)") if share else (1.0, name)
    factor, unit = readable(unit) if kind != "intersection_point" else (1.0, unit)
    return factor, f"{words} ({unit})"


def _cell(row: Row, name: str, factor: float) -> str:
    """A number with its standard deviation or its confidence interval."""
    value = row.numbers.get(name, np.nan)
    if not np.isfinite(value):
        return MISSING
    words, bracket, unit = name.partition(" (")
    low, high = (row.numbers.get(f"{words}, {end}{bracket}{unit}", np.nan) for end in ("from", "to"))
    shown = _number(factor * value)
    ends = [_number(factor * end) for end in (low, high)]
    if np.isfinite(low) and np.isfinite(high) and ends != [shown, shown]:
        return f"{shown} ({ends[0]} to {ends[1]})"
    spread = row.deviations.get(name, np.nan)
    if np.isfinite(spread) and spread > max(ROUNDING * abs(value), ROUNDING):
        return f"{shown} ± {number(factor * spread, 2)}"
    return shown


def _number(value: float) -> str:
    return "0" if abs(value) < ROUNDING else number(value, 3)


def _of_people(name: str, factor: float) -> str:
    signal, _, words = name.partition(", ")
    key = next((each.key for each in MEASURES if words.partition(" (")[0] == each.words), "")
    if signal != PRESSURE or key not in YOUNG_PEOPLE:
        return MISSING
    mean, spread = YOUNG_PEOPLE[key]
    return f"{number(factor * mean, 3)} ± {number(factor * spread, 2)}"


CAPTIONS = {
    "double_step": (
        "Left: mean reaction times against the interval between the steps, to the first step (open circles) and to "
        "the second (filled circles); bars are twice the standard error. Where directions differ, squares are pairs "
        "of steps in the same direction, and circles reversals. Right: one pair of steps, with the control "
        "signal, the fitted linear model, and the steps at their true times and moved by the reaction times; the "
        "steps are drawn below the control, and not to scale."
    ),
    "multisine": (
        "Gain (response divided by stimulus) and phase at the lines of the stimulus, with 95 % confidence intervals of "
        "the gain, and power of the response. Thin lines: linear theory, for continuous control of the same design. "
        "Small points: power between the lines of the stimulus (the remnant)."
    ),
    "perturbed_stance": (
        "Gain (body in space divided by surface) and phase at the lines of the stimulus, with 95 % confidence "
        "intervals of the gain, and power of the angle of the body. Thin lines: the fitted channels. Small points: "
        "power between the lines of the stimulus (the remnant)."
    ),
    "intersection_point": (
        "Height of the intersection point, divided by that of the centre of mass where this is known. Faint bands: one "
        "standard deviation over trials on either side of the mean. Thin line: linear theory of continuous control. "
        "Dotted: height of the centre of mass."
    ),
}
"""What the lines and markers of each kind's figure are; cases and plants are in its legend."""


def _caption_of_standing(rows: Sequence[Row]) -> str:
    """As above, without a panel of intervals where there are none."""
    names = [name for row in rows for name in row.numbers]
    signal = next((name.partition(", RMS")[0] for name in names if ", RMS" in name), "the first signal")
    place = (
        f"distribution of {SIGNALS.get(signal, signal)}, divided by its standard deviation; dotted: normal distribution"
    )
    if not any(name.startswith("interval, ") for name in names):
        return f"{place[0].upper()}{place[1:]}."
    return (
        f"Left: {place}. Right: distribution of the intervals between events; intervals that do not vary, as those of "
        "a clock, are not drawn."
    )


_SAME = "Recordings of people are analysed in the same way."


def _of_double_steps(s: Any, recorded: bool) -> list[str]:
    isi = ", ".join(f"{each:g}" for each in s.isi)
    size = f"{s.size:g} {s.unit}" if s.unit else f"{s.size:g} in the unit of {s.output}"
    made = f"A target makes pairs of steps of {size}, {isi} s apart, {s.repetitions} times in each direction. "
    return [
        ("" if recorded else made)
        + "A linear model of the response of the control signal to the target is fitted; each reaction time is the "
        "delay by which the model must move its step. Refractory periods are estimated by four methods: the "
        "intercept of a line that the second reaction time follows (free regression), the same with slope −1, the "
        "largest interval at which it is longer than the first, and its range. Intervals in brackets are 95 % "
        "confidence intervals from resampled pairs. BIC is the Bayesian information criterion of each kind of "
        "controller, minus that of the best. Pairs in the same direction and reversals are analysed by themselves; "
        "results of all pairs are given only if both are of one kind and their intervals of slope −1 overlap, or one "
        "direction has too few pairs.",
        _SAME,
    ]


def _of_multisine(s: Any, recorded: bool) -> list[str]:
    where = f"added to the command of {s.input}" if s.input else f"that moves the set-point of {s.setpoint}"
    made = (
        f"The stimulus is a sum of {len(s.lines)} sinusoids of amplitude {s.amplitude:g} and a period of {s.period:g} "
        f"s, {where}; {count(s.settle, 'period')} at the start {'is' if s.settle == 1 else 'are'} left out, and "
        f"{count(s.periods, 'period')} of each trial are analysed. "
    )
    return [
        ("" if recorded else made)
        + "The response at each line is the mean over periods, and its confidence follows from their scatter, with "
        "periods assumed to be independent. The remnant is the power at all other frequencies.",
        _SAME,
    ]


def _of_perturbed_stance(s: Any, recorded: bool) -> list[str]:
    made = (
        f"The surface tilts by {np.degrees(s.size):.3g}° from peak to peak in a pseudo-random ternary sequence of "
        f"velocities of {s.interval:g} s; its lines up to {s.highest:g} Hz are the stimulus. "
        f"{count(s.settle, 'period')} at the start {'is' if s.settle == 1 else 'are'} left out, and "
        f"{count(s.periods, 'period')} of each trial are analysed. "
    )
    return [
        ("" if recorded else made)
        + "The response of the angle of the body in space at each line is the mean over periods, and its confidence "
        "follows from their scatter. The remnant is the power at all other frequencies. Where inertia and toppling "
        "stiffness are given, delayed feedback of the angles to the surface and to the vertical is fitted to the "
        "response; intervals in brackets are 95 % confidence intervals from the scatter of the residuals.",
        _SAME,
    ]


def _of_intersection_point(s: Any, recorded: bool) -> list[str]:
    made = f"{s.settle:g} s at the start of each trial are left out, and {s.duration:g} s are analysed. "
    return [
        ("" if recorded else made)
        + "The lines of action of the ground reaction force meet at the height z. It follows from the cross-spectrum "
        f"of the angle of the force and the centre of pressure, in windows of {s.window:g} s that overlap by half, "
        f"from {s.low:g} to {s.high:g} Hz; the share of variance is what this line explains.",
        _SAME,
    ]


def _of_quiet_standing(s: Any, recorded: bool) -> list[str]:
    made = f"{s.settle:g} s at the start of each trial are left out, and {s.duration:g} s are analysed. "
    filtered = f"Signals pass a low-pass filter of {s.low_pass:g} Hz before they are measured. " if s.low_pass else ""
    return [
        ("" if recorded else made)
        + filtered
        + "RMS is the root mean square about the mean; speed is the length of the path divided by the duration; H and "
        "D are exponent and coefficient of stabilogram diffusion at short (0.05 to 0.5 s) and long times (2.5 to 10 "
        "s). A distribution has several modes if the test for one mode gives p ≤ 0.01.",
        _SAME,
    ]


METHODS: Mapping[str, Callable[[Any, bool], list[str]]] = {
    "double_step": _of_double_steps,
    "multisine": _of_multisine,
    "perturbed_stance": _of_perturbed_stance,
    "intersection_point": _of_intersection_point,
    "quiet_standing": _of_quiet_standing,
}
