"""Words that several parts of a page use: how far a body sways, which control a run is under, what notices mean."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from icmj.base import numbers
from icmj.base.array import is_between
from icmj.case.quantity import quantities

if TYPE_CHECKING:
    from icmj.case.result import Result
    from icmj.plant.linear_plant import LinearPlant

NAMED = 3  # outputs whose swing a sentence gives


def describe_sway(result: Result) -> str:
    """Between what the positions swing, from the extremes of the run's rows; empty where the motion has not settled.

    Of a cycle over its last period; under noise over the part that the statistics are of. Of more than three outputs
    with one unit, the three that swing most are named.
    """
    simulation, period = result.simulation, result.motion.period
    end, noisy = float(simulation.t[-1]), result.statistics
    if result.motion.kind == "cycle" and period is not None and np.isfinite(period):
        start, when = end - period, "Settled"
    elif result.motion.kind == "noisy" and noisy is not None:
        start, when = noisy.start, f"In the last {noisy.end - noisy.start:.3g} s, under noise"
    else:
        return ""
    y = simulation.y[is_between(simulation.t, max(start, float(simulation.t[0])))]
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


def notice_in_words(notice: str, where: str = "") -> str:
    """A notice as a sentence under its name, with the plant that it is about if it is not about all."""
    name, colon, words = notice.partition(": ")
    if not colon:
        name, words = "note", notice
    return f"{name[:1].upper()}{name[1:]}{f' ({where})' if where else ''}. {words[:1].upper()}{words[1:]}."


def kind_in_words(run: Result) -> str:
    """The kind of a controller; switched feedback that never switches is continuous."""
    facts = run.controller.facts()
    return "continuous" if facts.get("switches") is False else run.controller.kind


def label_outputs(plant: LinearPlant) -> list[str]:
    """The outputs of a plant, each with the unit in which it is shown."""
    labels = (shown.label(name) for name, shown in zip(plant.outputs, quantities(plant), strict=True))
    return [label.replace("deg", "°") for label in labels]


def list_rms(run: Result) -> list[str]:
    """RMS of every output over the second half of a run, weighted by time, in the unit that people read."""
    simulation, scale = run.simulation, np.array([shown.factor for shown in quantities(run.actual)])
    late = is_between(simulation.t, simulation.t[-1] / 2)
    t, y = simulation.t[late], simulation.y[late]
    length = float(t[-1] - t[0])
    with np.errstate(over="ignore", invalid="ignore"):
        rms = np.sqrt(np.trapezoid(y**2, t, axis=0) / length) if length > 0 else np.full(y.shape[1], np.nan)
    return [numbers.number(float(value), 3) for value in rms * scale]
