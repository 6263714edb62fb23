"""The result of a case: what one log holds, the table of a sweep, and the quantities of a run that are shown.

Everything one log holds, as data. Runs nothing.

The table of a sweep and its varied fields, from which its pictures are drawn.

The contents of one log: the case, its prediction if there is one, the simulated run, and the results.

Outputs as people read them: angles in degrees, everything else in the unit that it has.

A motion in the quantities that pictures show: outputs against their rates, the state x̄ and its modes χ, upright
jumps at the resets, and the inputs on which something else acts than the command.

The predicted orbit laid on a run, so that the two can be seen on each other.

The theory does not say when a cycle starts, nor which of the two mirror images ±X̄(t) it is. Both are taken from the
last event of the run, and nothing else is: the orbit is in step with that event, and of the two images it is the one
whose x̄ there is nearer to the run's. As t = 0 is an event, there always is a last one.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, TypeGuard

import numpy as np
from numpy.typing import NDArray

from icmj.base import VERSION
from icmj.base.array import Array, between
from icmj.base.card import Card, WithCard
from icmj.controller.controller import Controller, Law, has_trigger
from icmj.errors import ReportError
from icmj.measurement.measurement import Measurement, measure, reduced_states
from icmj.measurement.statistics import Statistics
from icmj.plant.linear_plant import LinearPlant, transformation
from icmj.runfile.schema import RunFile
from icmj.series.interpolation import NEAR, piecewise
from icmj.series.series import Series
from icmj.simulation.simulation import Scene, Simulation
from icmj.theory.orbit import Orbit
from icmj.theory.prediction import PredictedOrbit, Prediction

if TYPE_CHECKING:
    import pyarrow as pa
    from xarray import Dataset


@dataclass(frozen=True, eq=False)
class SweepTable:
    """One sweep as read back.

    Attributes:
        name, title: of the sweep file.
        varies: what varies: the name of its column, and the field of the run file, "" for a change of the model.
        points: how many there are to be.
        table: the rows that are finished (docs/sweeps.md describes the columns).
        units: units of what varies and of the outputs, by name, where they are known.
    """

    name: str
    title: str
    varies: tuple[tuple[str, str], ...]
    points: int
    table: pa.Table
    units: Mapping[str, str] = field(default_factory=dict)

    def numbers(self, column: str) -> Array:
        """A numeric or Boolean column, NaN where a value is missing; shape (rows,); raises as :meth:`texts`."""
        return np.array([np.nan if value is None else float(value) for value in self.texts(column)])

    def texts(self, column: str) -> list[Any]:
        """A column without conversion.

        Raises:
            ReportError: if there is no such column.
        """
        names = self.table.column_names
        if column not in names:
            raise ReportError(f"sweep {self.name!r} has no column {column!r}; there are {', '.join(names[:8])} …")
        return list(self.table[column].to_pylist())


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

    def card(self) -> Card:
        """Its representation at a prompt or in a notebook."""
        case, run = self.run.case, self.simulation.card()
        rows = (("case", f"{case.name}: {self.run.title}"),)
        if not has_prediction(self):
            return Card(f"{case.name}, {run.line}", (*rows, *run.rows), self.words)
        prediction, motion = self.prediction.card(), self.measurement.card()
        line = f"{case.name}, {run.line}; {prediction.line}; {motion.line}"
        return Card(line, (*rows, *prediction.rows[:5], *run.rows, *motion.rows[:2]), self.words)

    @cached_property  # of a run under noise, statistics take as long as the run
    def words(self) -> str:
        """The motion of the run in one sentence."""
        if self.measurement is not None:
            return self.measurement.words
        count, eventful = len(self.simulation.events), self.controller.realisation.eventful
        what = f"it had {count} events" if eventful or not self.simulation.mode.size else f"it switched {count} times"
        more = f"; {what}" if count else ""
        said = f"Under {self.controller.kind} control the run {self.simulation.outcome.message}{more}."
        return f"{said} {measure(self.simulation).words}" if count and eventful else said

    def to_series(self, rate: float | None = None) -> Series:
        """Every signal of the run, as :meth:`icmj.Simulation.to_series` with its controller and pushes gives them.

        Args:
            rate: rows per second [Hz]; the recorded rows as they are if ``None``.

        Raises:
            DataError: if the rate is not usable.
        """
        law = self.controller
        series = self.simulation.to_series(rate, law if has_trigger(law) else None)
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


if TYPE_CHECKING:

    @dataclass(frozen=True, eq=False, repr=False)
    class PredictedResult(Result):
        """A result as type checkers see it once :func:`has_prediction` has said that it has a prediction."""

        controller: Controller
        prediction: Prediction
        simulation: Simulation
        measurement: Measurement


def has_prediction(result: Result) -> TypeGuard[PredictedResult]:
    """Whether a result has a prediction, and the measurement that is compared with it."""
    return result.prediction is not None


@dataclass(frozen=True)
class Quantity:
    """The way in which an output is shown.

    Attributes:
        factor: on its value in SI units.
        unit: such as deg or m; "" where the plant does not know it.
    """

    factor: float
    unit: str

    def label(self, words: str, per: str = "") -> str:
        """``words`` with the unit in brackets, as ``angle (deg/s)`` for ``per`` "/s"; alone where there is none."""
        return in_unit(words, self.unit and self.unit + per)


def in_unit(words: str, unit: str) -> str:
    """``words`` with the unit in brackets; alone where there is none."""
    return f"{words} ({unit})" if unit else words


def in_brackets(unit: str, per: str = "") -> str:
    """`` [rad/s]`` for rad and "/s", to be put behind a name; nothing where there is no unit."""
    return f" [{unit}{'' if unit == EACH else per}]" if unit else ""


EACH = "each in its own unit"


def shared_unit(units: Sequence[str]) -> str:
    """The unit of all where they have the same one, the words :data:`EACH` where not; "" where none is known."""
    return units[0] if len(set(units)) == 1 else EACH if units else ""


def quantities(plant: LinearPlant) -> tuple[Quantity, ...]:
    """One for each output of ``plant``."""
    return tuple(_quantity(unit) for unit in plant.output_units or ("",) * plant.n_y)


def threshold_unit(result: Result) -> str:
    """Unit of the threshold of a run; see :func:`rule_unit`."""
    return rule_unit(result.assumed, result.controller)


def rule_unit(plant: LinearPlant, controller: Law) -> str:
    """Unit of the threshold: that of the assumed outputs where the rule weighs these alone; "" where it has none."""
    facts = controller.facts()
    weight = facts.get("Q_t")
    of_outputs = facts.get("on") == "output"
    if isinstance(weight, np.ndarray):
        of_outputs = weight.shape == (plant.n, plant.n) and np.allclose(weight, plant.C.T @ plant.C, atol=1e-12)
    return shared_unit(plant.output_units) if of_outputs else ""


def _quantity(unit: str) -> Quantity:
    if unit == "rad" or unit.startswith("rad/"):
        return Quantity(180 / np.pi, unit.replace("rad", "deg"))
    return Quantity(1.0, unit)


SMOOTH = 1 / 4000  # of the range: so far a line between points may be off the curve, a tenth of a pixel in 400
MOST = 32  # points between two rows


def output_rate(result: Result, x: Array, u: Array) -> Array:
    """ẏ = C(Ax + Bu) of the linearised actual plant; shapes (..., n), (..., n_u) → (..., n_y)."""
    plant = result.actual
    return x @ (plant.C @ plant.A).T + u @ (plant.C @ plant.B).T


def curve(result: Result, start: float, end: float) -> tuple[Array, Array]:
    """Outputs and their rates from ``start`` to ``end`` [s], so dense that a line through the points is a smooth curve.

    Between rows they are interpolated by splines of the pieces between events, actions and pushes, of fourth order in
    the distance of the rows. Two rows have as many points between them as the bend there needs.

    Returns:
        y and ẏ, shapes (M, n_y); those of the rows alone where a value is not finite.
    """
    run, n_y = result.simulation, result.actual.n_y
    began = run.events.t[run.events.t < start - NEAR]
    rows = between(run.t, began[-1] if len(began) else run.t[0], end)
    t, values = run.t[rows], np.hstack([run.y, output_rate(result, run.x, run.u)])[rows]
    if len(t) > 1 and np.isfinite(values).all():
        t, values = _refine(result, t, values)
    late = between(t, start, end)
    t, values = t[late], values[late]
    # where an input acts on an output's rate at once, that jumps with it, and the curve has a gap
    jumping = np.flatnonzero(np.abs(result.actual.C @ result.actual.B).max(axis=1) > 0)
    if len(jumping):
        bends = np.unique(np.concatenate(run.breaks))
        gaps = np.unique(np.searchsorted(t, bends[between(bends, start, end)] + NEAR))
        gaps = gaps[(gaps > 0) & (gaps < len(t))]
        gap = values[gaps - 1]
        gap[:, n_y + jumping] = np.nan
        values = np.insert(values, gaps, gap, axis=0)
    return values[:, :n_y], values[:, n_y:]


def _refine(result: Result, t: Array, values: Array) -> tuple[Array, Array]:
    """Rows of outputs and rates with what is between them, in as many points as a smooth curve needs."""
    plant, n_y = result.actual, result.actual.n_y
    resets, others = result.simulation.breaks
    # where an input acts on an output's rate at once, that jumps with it
    steady = np.arange(2 * n_y) < (n_y if (plant.C @ plant.B).any() else 2 * n_y)

    def at(times: Array) -> Array:
        return piecewise(t, values, times, jumps=resets[between(resets, t[0], t[-1])], breaks=others, steady=steady)

    middle, extent = at((t[1:] + t[:-1]) / 2), np.ptp(values, axis=0)
    off = np.abs(middle - (values[1:] + values[:-1]) / 2) / np.where(extent > 0, extent, 1)
    # the distance from a chord falls with the square of its length
    count = np.clip(np.ceil(np.sqrt(off.max(axis=1) / SMOOTH)), 1, MOST).astype(int)
    part = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
    times = np.append(np.repeat(t[:-1], count) + np.repeat(np.diff(t) / count, count) * part, t[-1])
    return times, at(times)


def reduce_state(result: Result, x: Array, x_o: Array, x_h: Array) -> Array:
    """x̄ = (x, x_o − T̂x), from event to event the whole state; shapes (..., n), (..., n̂), (..., n̂) → (..., n + n̂).

    With a delay x_h − T̂x belongs to it: (..., n + 2n̂).
    """
    delayed = x_h if result.simulation.delay else None
    return reduced_states(x, x_o, transformation(result.assumed, result.actual), delayed)


def modes(result: Result, x_bar: Array) -> NDArray[np.complex128]:
    """χ = V⁻¹x̄ (eq. chi), the critical mode first; shape (..., n + n̂). Only where the prediction has V⁻¹.

    A mode is real if its eigenvalue is, as the critical one is; of a complex pair the real part is one phase.
    """
    assert result.prediction is not None
    V_inv = result.prediction.V_inv
    assert V_inv is not None
    return x_bar @ V_inv.T


def event_rows(simulation: Simulation) -> NDArray[np.intp]:
    """Indices of the rows at the events, which hold the values before the reset; shape (K,)."""
    return np.searchsorted(simulation.t, simulation.events.t)


def latter_part(simulation: Simulation, intervals: int) -> tuple[float, float]:
    """Start and end [s] of the last ``intervals`` open-loop intervals; the last third where there are too few."""
    end = float(simulation.t[-1])
    events = simulation.events.t
    if len(events) > intervals:
        return float(events[-1 - intervals]), end
    return end - (end - float(simulation.t[0])) / 3, end


def with_resets(simulation: Simulation, values: Array, after: Array) -> tuple[Array, Array]:
    """Times and values of the rows (N, w) with the values (K, w) right after every event put in.

    A row at an event holds the value before the reset x_h := x_o; with the one after it, a jump is drawn upright.
    """
    at = simulation.events.t
    if not len(at) or simulation.delay:  # nothing is reset at an event whose action comes later
        return simulation.t, values
    place = np.searchsorted(simulation.t, at, side="right")
    return np.insert(simulation.t, place, at), np.insert(values, place, after, axis=0)


def running_interval(simulation: Simulation) -> tuple[Array, Array]:
    """Time since the last event, at every event before and after the reset: a sawtooth with vertical falls.

    Times and values [s], shape (2K + 2,).
    """
    events, end = simulation.events, float(simulation.t[-1])
    t = np.concatenate([[0.0], np.repeat(events.t, 2), [end]])
    since = np.concatenate([[0.0], np.column_stack([events.interval, 0 * events.t]).ravel(), [0.0]])
    since[-1] = end - (events.t[-1] if len(events) else 0.0)
    return t, since


def acting(result: Result) -> list[int]:
    """Indices of the inputs where ``applied`` is not ``u``; a difference by rounding is none."""
    simulation = result.simulation
    if not simulation.applied.size:
        return []
    with np.errstate(invalid="ignore", over="ignore"):
        apart = np.abs(simulation.applied - simulation.u)
        differs = (apart > 1e-9 * np.abs(simulation.u)) & (apart > 1e-9 * np.nanmax(apart, initial=0.0))
    return [int(i) for i in np.flatnonzero(differs.any(axis=0))]


INTERVAL_TOLERANCE = 0.05
"""Largest relative departure of an open-loop interval from Δ_crit at which a cycle still counts as the predicted
one. The nonlinear plant's own departure grows as the square of the threshold and stays far below; coexisting cycles
are further away."""
MIRROR_TOLERANCE = 2 * INTERVAL_TOLERANCE
"""Largest asymmetry of a cycle that counts as a predicted mirrored one: an interval and the next, or a state and the
mirror image of the next, may each depart by :data:`INTERVAL_TOLERANCE`, hence from one another by twice as much.

A mirrored cycle is exactly mirrored only where plant and controller are odd. An attracting cycle persists if they are
slightly not: one cycle of two events remains near it, whose intervals and states depart in proportion to the threshold,
the first by as much as the second but in opposite directions, so that their mean still departs with its square."""


def settled_on(prediction: Prediction, measurement: Measurement) -> PredictedOrbit | None:
    """The orbit of the catalogue that a run ended on, of those that attract or are a family; ``None`` if on none.

    The run has that number of events in a period and every interval within :data:`INTERVAL_TOLERANCE` of the orbit's.
    With λ = −1 its halves are mirror images, exactly or within :data:`MIRROR_TOLERANCE`. An orbit that repels may have
    lost its symmetry to two other cycles, which lie close to it, and is not looked for.
    """
    if measurement.kind != "cycle" or measurement.interval is None:
        return None
    intervals, found = np.append(measurement.intervals, measurement.interval), {}
    for one in prediction.orbits:
        mirrored = one.crossing.eigenvalue.real < 0
        alike = measurement.mirrored or (mirrored and measurement.asymmetry <= MIRROR_TOLERANCE)
        off = float(np.abs(intervals / one.crossing.delta - 1).max())
        if one.settles and measurement.p == (2 if mirrored else 1) and alike == mirrored and off <= INTERVAL_TOLERANCE:
            found[off] = one
    return found[min(found)] if found else None


def beside(prediction: Prediction, measurement: Measurement | None) -> Prediction:
    """The prediction that a run is compared with: about the orbit that it settled on, or else as it is."""
    found = None if measurement is None else settled_on(prediction, measurement)
    return prediction if found is None or found.orbit is prediction.orbit else prediction.about(found)


@dataclass(frozen=True, eq=False)
class LaidOrbit:
    """The predicted orbit with the phase and the sign of a run.

    A *signal* is what is linear in the state of the orbit, over one interval at ``orbit.t``, shape (M, w): its outputs
    ``orbit.y``, its inputs ``orbit.u``, ``rate`` or ``reduced``.

    Attributes:
        orbit: over one interval, from an event on.
        start: time of the event that it is laid on [s].
        side: +1 or −1, the sign of the orbit in the interval that begins there.
        rate: ẏ over one interval, shape (M, n_y).
        reduced: x̄ over one interval, shape (M, n + n̂).
    """

    orbit: Orbit
    start: float
    side: int
    rate: Array
    reduced: Array

    def at(self, t: Array, signal: Array) -> Array:
        """A signal at times t [s], the orbit repeated before and after ``start``; shapes (N,), (M, w) → (N, w).

        Where it jumps, which inputs do at an event, rounding decides on which side of the reset the value is.
        """
        intervals, tau = np.divmod(t - self.start, self.orbit.delta)
        side = self.side * np.where(intervals % 2 == 0, 1, self.orbit.sign)
        return side[:, None] * np.column_stack([np.interp(tau, self.orbit.t, column) for column in signal.T])

    def whole(self, signal: Array) -> Array:
        """A signal over one period from ``start`` on, shape (M, w), or (2M, w) where its halves are mirrored."""
        halves = [signal] if self.orbit.sign > 0 else [signal, -signal]
        return self.side * np.concatenate(halves)

    def times(self, begin: float, end: float) -> Array:
        """The times from ``begin`` to ``end`` [s] at which the repeated orbit is known without interpolation."""
        first, after = ((bound - self.start) / self.orbit.delta for bound in (begin, end))
        interval = np.arange(np.floor(first), np.ceil(after))[:, None]
        t = (self.start + self.orbit.delta * interval + self.orbit.t[:-1]).ravel()
        return t[(t >= begin) & (t <= end)]


def lay_orbit(result: PredictedResult) -> LaidOrbit | None:
    """The orbit that the run settled on, or else that at Δ_crit, aligned with the run; ``None`` without an orbit."""
    orbit, simulation = beside(result.prediction, result.measurement).orbit, result.simulation
    if orbit is None:
        return None
    n, n_hat = result.actual.n, result.assumed.n
    if len(simulation.events):
        events = simulation.events
        start, x_bar = events.t[-1], reduce_state(result, events.x[-1], events.x_o[-1], events.x_h[-1])
    else:
        start, x_bar = simulation.t[0], reduce_state(result, simulation.x[0], simulation.x_o[0], simulation.x_h[0])
    return LaidOrbit(
        orbit,
        float(start),
        # |x̄ + o| < |x̄ − o| just where x̄ · o < 0; what is not a number is nearer to neither
        -1 if float(x_bar @ orbit.x_bar) < 0 else 1,
        output_rate(result, orbit.X[:, :n], orbit.u),
        orbit.X if simulation.delay else orbit.X[:, : n + n_hat],
    )
