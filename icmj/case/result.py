"""The contents of one log: the case, its prediction if there is one, the simulated run, and the results."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

from icmj.base import VERSION
from icmj.base.array import Array
from icmj.base.card import Card, WithCard
from icmj.controller.law import Law
from icmj.errors import AnalysisError
from icmj.measurement.measurement import Measurement, measure
from icmj.measurement.statistics import Statistics
from icmj.plant.linear_plant import LinearPlant
from icmj.runfile.schema import RunFile
from icmj.series.series import Series
from icmj.simulation.scene import Scene
from icmj.simulation.simulation import Simulation
from icmj.theory.prediction import Prediction

if TYPE_CHECKING:
    from xarray import Dataset


@dataclass(frozen=True, eq=False)
class Attractor:
    """One motion that starts lead to.

    Attributes:
        measurement: what it is, from the first start that led there.
        states: x̄ at the events of its last period, shape (p, n + n̂); (0, n + n̂) without a cycle.
        count: starts that led there.
        share: part of all starts.
        x0, x_o0: the first such start, plant (n,) and observer state (n̂,).
    """

    measurement: Measurement
    states: Array
    count: int
    share: float
    x0: Array
    x_o0: Array


@dataclass(frozen=True, eq=False)
class Growth:
    """Growth per interval under a clock: the points in panel (a).

    Attributes:
        delta: clock intervals [s], shape (M,).
        measured: growth factor per interval, measured in simulations, shape (M,).
        predicted: largest |λ(φ(Δ))| at these intervals, shape (M,).
    """

    delta: Array
    measured: Array
    predicted: Array


@dataclass(frozen=True, eq=False)
class AmplitudeLaw:
    """Errors relative to the linear prediction at decreasing thresholds (docs/simulation.md).

    Attributes:
        q_t: thresholds, shape (M,).
        interval_error: relative error of the open-loop interval, shape (M,).
        amplitude_error: largest relative error of an output's peak, shape (M,).
        interval_slope, amplitude_slope: fitted slopes d log error / d log q_t.
    """

    q_t: Array
    interval_error: Array
    amplitude_error: Array
    interval_slope: float
    amplitude_slope: float


@dataclass(frozen=True, eq=False, repr=False)
class Result(WithCard):
    """One simulated case with all its results; a log stores it completely.

    Attributes:
        run: the run file, with its text.
        assumed, actual: linearised plants [Â, B̂, Ĉ] and [A, B, C].
        controller: the controller.
        prediction: the results of the linear theory for an event rule; ``None`` for a controller that has none, and
            then there are neither ``measurement``, ``statistics`` nor what the study adds.
        simulation: the run; its events are those of the event rule, or the switches of a controller without one.
        measurement: the measured motion of the run.
        statistics: distributions of the run under noise; ``None`` without noise, or if they cannot be computed.
        continuous: the run under continuous control, on the same plant from the same initial state. The study adds it,
            and the next three; ``None``, or empty, where they were not computed.
        growth: growth under a clock.
        law: amplitude law, of a run in MuJoCo.
        attractors: motions found from random initial states of the linear plant.
        scene: 3D poses at ``simulation.t``; ``None`` for plants without a body and when read back from a log.
        provenance: versions, commit of the checkout around the run file (``git``), platform, date.
        notices: notices about plants and run, each once.
        measures: results of the user's own measures, by name.
        sway: measures of the centre of pressure, back to front [m, s], of a body of a person's size that noise moves,
            such as ``cop.x.rms``, named as in :func:`icmj.simulate_many`; over the same part of the run as
            ``statistics``, and empty for other runs.
    """

    run: RunFile
    assumed: LinearPlant
    actual: LinearPlant
    controller: Law
    prediction: Prediction | None
    simulation: Simulation
    measurement: Measurement | None = None
    statistics: Statistics | None = None
    continuous: Simulation | None = None
    growth: Growth | None = None
    law: AmplitudeLaw | None = None
    attractors: tuple[Attractor, ...] = ()
    scene: Scene | None = None
    provenance: Mapping[str, str] = field(default_factory=dict)
    notices: tuple[str, ...] = ()
    measures: Mapping[str, float] = field(default_factory=dict)
    sway: Mapping[str, float] = field(default_factory=dict)

    def expect_prediction(self) -> Prediction:
        """Its prediction, where there has to be one.

        Raises:
            AnalysisError: if its controller has no event rule, and hence no prediction.
        """
        if self.prediction is None:
            kind = self.controller.kind
            raise AnalysisError(
                f"{self.run.case.name}: a run under {kind} control has no prediction to be compared with"
            )
        return self.prediction

    @cached_property
    def motion(self) -> Measurement:
        """Its measured motion, measured now where it is not kept."""
        return self.measurement or measure(self.simulation)

    def card(self) -> Card:
        """Its representation at a prompt or in a notebook."""
        case, run = self.run.case, self.simulation.card()
        rows = (("case", f"{case.name}: {self.run.title}"),)
        if self.prediction is None:
            return Card(f"{case.name}, {run.line}", (*rows, *run.rows), self.words)
        prediction, motion = self.prediction.card(), self.motion.card()
        line = f"{case.name}, {run.line}; {prediction.line}; {motion.line}"
        return Card(line, (*rows, *prediction.rows[:5], *run.rows, *motion.rows[:2]), self.words)

    @cached_property  # of a run under noise, statistics take as long as the run
    def words(self) -> str:
        """The motion of the run in one sentence."""
        if self.measurement is not None:
            return self.measurement.words
        count, said = len(self.simulation.events), f"Under {self.controller.kind} control the run"
        said = f"{said} {self.simulation.outcome.message}"
        if not count:
            return f"{said}."
        if self.controller.realisation.eventful:
            return f"{said}; it had {count} events. {self.motion.words}"
        return f"{said}; it {f'switched {count} times' if self.simulation.mode.size else f'had {count} events'}."

    def to_series(self, rate: float | None = None) -> Series:
        """Every signal of the run, as :meth:`icmj.Simulation.to_series` with its controller and pushes gives them.

        Args:
            rate: rows per second [Hz]; the recorded rows as they are if ``None``.

        Raises:
            DataError: if the rate is not usable.
        """
        series = self.simulation.to_series(rate, self.controller)
        return replace(series, facts=self._facts | series.facts)

    def to_xarray(self, rate: float | None = None) -> Dataset:
        """:meth:`to_series` as an ``xarray.Dataset``; see :meth:`icmj.Series.to_xarray`.

        Raises:
            DataError: if xarray is not installed, or the rate is not usable.
        """
        return self.to_series(rate).to_xarray()

    def events_to_series(self) -> Series:
        """One row for each event; see :meth:`icmj.Simulation.events_to_series`."""
        series = self.simulation.events_to_series()
        return replace(series, facts=self._facts | series.facts)

    @property
    def _facts(self) -> dict[str, str]:
        changes = {"changes": self.run.changes_in_words} if self.run.changes_in_words else {}
        return {"case": self.run.case.name, "title": self.run.title, **changes, "version": VERSION}
