"""Rounds of a switched controller: the factor by which the motion grows or shrinks in a round, and its cycle.

A feedback of delayed outputs that is switched on and off in their plane (:mod:`icmj.controller.switching`) and has no
dead zone is homogeneous: a motion scaled at the start is scaled throughout. So it settles on rounds, each of which is
the one before times a factor, and that factor is the verdict: below 1 the body stands, above 1 it falls. With a dead
zone rounds of factor 1 are a cycle, whose size is in proportion to the zone.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import singledispatch

import numpy as np
from numpy.typing import ArrayLike

from icmj.base.array import Array, is_between
from icmj.controller.law import Law
from icmj.controller.switching import SwitchingPD
from icmj.errors import AnalysisError, expect
from icmj.linear.run import simulate as simulate_exactly
from icmj.plant.linear_plant import LinearPlant, expect_linear
from icmj.simulation.settings import Settings
from icmj.simulation.simulation import Simulation

MOST = 12  # switches of a round that are looked for
CLOSED = 1e-6  # relative: rounds that differ by less are the same but for their size
EDGE = 1e-6  # of a factor: nearer to 1 it is on the edge
_TOLD, _FEWEST = (1e-9, 1e-2), 4  # departures that are small, and no rounding; how many of them tell how fast they go
_START, _LIMIT = 1e-6, 1e8  # sizes of a motion that is followed, in units of its plant


@dataclass(frozen=True)
class Rounds:
    """The rounds of a motion under a switched controller; see the glossary for this term.

    Attributes:
        factor: size of a round divided by that of the previous round; NaN if no rounds are found.
        period: duration of a round [s]; NaN if no rounds are found.
        switches: number of switches in a round; 0 if no rounds are found.
        mirrored: whether each round is the mirror image of the previous one.
        growth: growth rate of the size [1/s]: log factor / period or, without rounds, that of the whole motion.
        closure: relative difference of the last two rounds, apart from their size.
        multiplier: factor by which a deviation from the settled rounds changes in one round: the largest |multiplier|,
            estimated from the approach of the run to them; NaN if the approach was too fast for an estimate.
    """

    factor: float
    period: float
    switches: int
    mirrored: bool
    growth: float
    closure: float
    multiplier: float = float("nan")

    @property
    def verdict(self) -> str:
        """``stands``, ``falls``, ``on the edge``, or ``not settled`` if the motion switches without rounds so far."""
        if np.isfinite(self.closure) and self.switches == 0:
            return "not settled"
        size = self.growth if np.isnan(self.period) else self.factor - 1
        return "on the edge" if abs(size) <= EDGE else "stands" if size < 0 else "falls"

    @property
    def words(self) -> str:
        """The result in one sentence."""
        if self.switches == 0:
            return f"No rounds were found; the size changes by {self.growth:+.3g} 1/s: {self.verdict}."
        mirrored = ", mirrored" if self.mirrored else ""
        if self.verdict == "on the edge":
            return f"It settles on a cycle of {self.period:.6g} s ({self.switches} switches{mirrored})."
        return (
            f"Each round of {self.period:.6g} s ({self.switches} switches{mirrored}) is the one before times "
            f"{self.factor:.8g}: {self.verdict}."
        )


def rounds_of(run: Simulation) -> Rounds:
    """The rounds on which a run under a switched controller has settled, from its last switches.

    Args:
        run: a run on either plant; its events are the switches.
    """
    x, interval = run.events.x, run.events.interval
    size = np.linalg.norm(x, axis=1)
    if len(x) < 3 or size[-1] == 0:
        rows = np.linalg.norm(run.x, axis=1)
        half = len(rows) // 2
        there = rows[half] > 0 and rows[-1] > 0 and run.t[-1] > run.t[half]
        growth = np.log(rows[-1] / rows[half]) / (run.t[-1] - run.t[half]) if there else np.nan
        return Rounds(np.nan, np.nan, 0, False, float(growth), np.nan)
    closure = np.inf
    for q in range(1, min(MOST, (len(x) - 1) // 2) + 1):
        now, before = x[-q:], x[-2 * q : -q]
        factor = float(np.sum(now * before) / np.sum(before * before))
        apart = np.abs(now - factor * before).max() / np.abs(now).max()
        late = np.abs(interval[-q:] - interval[-2 * q : -q]).max() / interval[-q:].max()
        closure = min(closure, float(max(apart, late)))
        if max(apart, late) < CLOSED:
            period = float(interval[-q:].sum())
            growth = float(np.log(abs(factor)) / period)
            left = _deviation_factor(x[(len(x) - 1) % q :: q], factor)
            return Rounds(abs(factor), period, q, factor < 0, growth, float(max(apart, late)), left)
    later = is_between(run.events.t, run.events.t[-1] / 2) & (size > 0)
    growth = np.polyfit(run.events.t[later], np.log(size[later]), 1)[0] if later.sum() > 1 else np.nan
    return Rounds(np.nan, np.nan, 0, False, float(growth), closure)


def _deviation_factor(x: Array, factor: float) -> float:
    """The factor per round of a deviation from x ↦ factor · x, estimated from the ends of rounds."""
    departure = np.linalg.norm(x[1:] - factor * x[:-1], axis=1) / np.linalg.norm(x[1:], axis=1)
    told = np.flatnonzero((departure > _TOLD[0]) & (departure < _TOLD[1]))
    return float(np.exp(np.polyfit(told, np.log(departure[told]), 1)[0])) if len(told) >= _FEWEST else float("nan")


@singledispatch
def rounds_without_dead_zone(law: Law, plant: LinearPlant) -> Rounds | None:
    """The rounds of a controller whose dead zone is taken away; ``None`` of one that has none to be taken, or does not
    switch.
    """
    return None


@rounds_without_dead_zone.register
def _(law: SwitchingPD, plant: LinearPlant) -> Rounds | None:
    return rounds(plant, replace(law, dead_zone=0.0)) if law.switches else None


def rounds(
    plant: LinearPlant, law: SwitchingPD, *, duration: float = 40.0, direction: ArrayLike | None = None
) -> Rounds:
    """The rounds of a switched loop without a dead zone on the linear plant, simulated exactly.

    Args:
        plant: a plant with the inputs and outputs of the law's plant.
        law: a controller without a dead zone.
        duration: duration of the simulated motion [s].
        direction: direction of the initial state, shape (n,); by default that of the first state.

    Raises:
        AnalysisError: if the law has a dead zone.
    """
    expect_linear(plant, "the plant")
    expect(law, SwitchingPD, "the analysis of rounds")
    if law.dead_zone:
        raise AnalysisError(
            f"the dead zone is {law.dead_zone:g}; only without one are rounds in proportion: give dead_zone=0, or "
            "simulate the run and take rounds_of(run)"
        )
    start = np.eye(plant.n)[0] if direction is None else np.asarray(direction, float)
    settings = Settings(duration=duration, limit=_LIMIT, record_interval=duration / 50)
    return rounds_of(simulate_exactly(plant, law, settings, x0=_START * start / np.linalg.norm(start)))


@dataclass(frozen=True, eq=False)
class Attraction:
    """The map of the gains with which a switched controller keeps a body upright.

    Attributes:
        P, D: gains, shapes (p,) and (d,).
        factor: factor per round, NaN if no rounds are found, shape (d, p).
        growth: growth rate of the size [1/s], shape (d, p).
    """

    P: Array
    D: Array
    factor: Array
    growth: Array

    @property
    def stands(self) -> Array:
        """Whether the size decreases, shape (d, p)."""
        return np.asarray(self.growth < 0)


def attraction(
    plant: LinearPlant,
    law: SwitchingPD,
    P: ArrayLike,
    D: ArrayLike,
    *,
    duration: float = 40.0,
    progress: Callable[[float], None] | None = None,
) -> Attraction:
    """The map of attraction over gains: the factor per round for every pair of gains (:func:`icmj.experiments.rounds`).

    Args:
        plant, law, duration: as for :func:`icmj.experiments.rounds`; the gains of the law are replaced.
        P, D: gains, shapes (p,) and (d,).
        progress: called repeatedly with the completed fraction, 0–1.
    """
    P, D = np.asarray(P, float), np.asarray(D, float)
    factor, growth = np.empty((len(D), len(P))), np.empty((len(D), len(P)))
    for j, d in enumerate(D):
        for i, p in enumerate(P):
            found = rounds(plant, replace(law, P=p, D=d), duration=duration)
            factor[j, i], growth[j, i] = found.factor, found.growth
        if progress is not None:
            progress((j + 1) / len(D))
    return Attraction(P, D, factor, growth)
