"""Everything one log of a controller that is not intermittent holds: the case, the controller, the run."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from icmj.base.card import Card, Shown, plain
from icmj.controller.law import Law
from icmj.plant.linear_plant import LinearPlant
from icmj.runfile.schema import RunFile
from icmj.series.series import Series
from icmj.simulation.disturbance import acting_on
from icmj.simulation.scene import Scene
from icmj.simulation.simulation import Simulation

if TYPE_CHECKING:
    from xarray import Dataset


@dataclass(frozen=True, eq=False, repr=False)
class Tried(Shown):
    """One simulated run under a controller that is not intermittent.

    Attributes:
        run: the run file, with its text.
        assumed, actual: linearised plants.
        law: the controller.
        simulation: the run; its events are the switches.
        scene: 3D poses at ``simulation.t``; ``None`` for plants without a body and when read back from a log.
        provenance: versions, git state, platform, date.
        notices: notices about plants and run, each once.
        measures: results of the user's own measures, by name.
    """

    run: RunFile
    assumed: LinearPlant
    actual: LinearPlant
    law: Law
    simulation: Simulation
    scene: Scene | None = None
    provenance: Mapping[str, str] = field(default_factory=dict)
    notices: tuple[str, ...] = ()
    measures: Mapping[str, float] = field(default_factory=dict)

    @property
    def words(self) -> str:
        """The motion of the run in one sentence."""
        count = len(self.simulation.events)
        switched = f"; it switched {count} times" if count else ""
        return f"Under {self.law.kind} control the run {self.simulation.outcome.message}{switched}."

    def card(self) -> Card:
        """Its representation at a prompt or in a notebook."""
        case, run = self.run.case, self.simulation.card()
        return Card(f"{case.name}, {run.line}", (("case", f"{case.name}: {case.title}"), *run.rows), self.words)

    def events_to_series(self) -> Series:
        """One row for each switch; see :meth:`icmj.Simulation.events_to_series`."""
        return self.simulation.events_to_series()

    def to_series(self, rate: float | None = None) -> Series:
        """Every signal of the run, as :meth:`icmj.Simulation.to_series` with its pushes and taps gives them."""
        edges = acting_on(self.actual, self.run.simulation.settings()).edges
        if self.law.setpoint:
            edges = np.concatenate([edges, self.law.setpoint.edges])
        # what jumps is read again, and answered with a kink, as long after as a tap says
        breaks = np.unique(np.concatenate([edges, *(edges + tap for tap in self.law.realisation.taps)]))
        return self.simulation.to_series(rate, breaks=breaks)

    def to_xarray(self, rate: float | None = None) -> Dataset:
        """:meth:`to_series` as an ``xarray.Dataset``; see :meth:`icmj.Series.to_xarray`.

        Raises:
            DataError: if xarray is not installed, or the rate is not usable.
        """
        return self.to_series(rate).to_xarray()


def to_record(tried: Tried) -> dict[str, Any]:
    """A record of ``summary.json``: plain numbers, lists and text."""
    return {
        "case": tried.run.case.name,
        "plant": tried.simulation.plant,
        "control": tried.law.kind,
        "controller": plain(dict(tried.law.facts())),
        "outcome": tried.simulation.outcome.kind,
        "switches": len(tried.simulation.events),
        "words": tried.words,
        "notices": list(tried.notices),
        "measures": plain(dict(tried.measures)),
    }
