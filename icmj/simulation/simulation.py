"""The result of a simulation on either plant: rows over time, events, how it ended, and notices about it.

A *row* is a recorded instant; an *event* is an instant at which the controller takes new feedback.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import ArrayLike

from icmj.base.array import Array, list_multiples
from icmj.base.card import Card, WithCard
from icmj.base.numbers import amount, amounts, count
from icmj.controller.controller import expect_intermittent
from icmj.controller.law import Law
from icmj.controller.setpoint import Setpoint
from icmj.plant.linear_plant import Push
from icmj.plant.quality import Notice
from icmj.series.even_rows import step_of
from icmj.series.interpolation import NEAR, piecewise, snap_rows
from icmj.series.series import COUNTER, Series, is_steady
from icmj.simulation.ending import Outcome

if TYPE_CHECKING:
    from control import TimeResponseData
    from pandas import DataFrame
    from xarray import Dataset

from icmj.simulation.columns import Block, look_up_columns
from icmj.simulation.labels import UNKNOWN, Labels
from icmj.simulation.pressure import Pressure


@dataclass(frozen=True, eq=False)
class Events:
    """The K events t_i of the controller after the one at t = 0, including those of a clock.

    For a controller with several modes, the events are the switches from one mode to another.

    Attributes:
        t: times [s], shape (K,).
        x, x_o, x_h: plant, observer and hold state at the event, before the reset x_h := x_o (which occurs later if
            there is a delay); shapes (K, n), (K, n̂), (K, n̂).
        y_max, y_min: extremes of each output over the open-loop interval that ends here, shape (K, n_y).
    """

    t: Array
    x: Array
    x_o: Array
    x_h: Array
    y_max: Array
    y_min: Array

    @property
    def interval(self) -> Array:
        """Open-loop intervals Δ_i [s] that end at each event, shape (K,) (eq. Delta_i)."""
        return np.diff(self.t, prepend=0.0)

    def __len__(self) -> int:
        return len(self.t)


@dataclass(frozen=True, eq=False, repr=False)
class Simulation(WithCard):
    """One simulated run; states are deviations from the operating point.

    Attributes:
        plant: ``linear`` or ``mujoco``.
        control: ``event``, ``clock``, ``continuous`` or ``switching``, or the ``kind`` of your own controller.
        t: times of the rows [s], strictly increasing, shape (N,); values at an event are those before the reset.
        x, y, u, x_o, x_h: plant state, outputs, inputs, observer and hold state; shapes (N, ...). Under
            continuous control x_h is x_o.
        E: event function (eq. ED_e), shape (N,); NaN without an event rule.
        events: the events.
        outcome: how it ended.
        precision: facts about the integration (integrator, order, timestep, event tolerance, error estimate ...).
        delay: delay t_d from an event to its action [s].
        least: the minimum open-loop interval, the larger of Δ_min and t_d [s].
        noisy: whether noise acted, so that the motion is described by its statistics.
        qpos: MuJoCo positions for the 3D pose, shape (N, nq); empty (0, 0) for the linear plant.
        applied: the input that acts, in the units of u, shape (N, n_u): the command plus the disturbance, within the
            limits of the actuators (u + d without saturation). Empty (0, 0) for the linear plant without a disturbance,
            because it has no limits.
        pushes: the K places at which disturbances act on the plant itself.
        pushed: their sizes, shape (N, K); empty (0, 0) if there are none.
        pressure: the ground reaction on a body that stands on a floor; otherwise ``None``.
        setpoint: the set-point r(t) that the controller followed; ``None`` if there was none.
        labels: names and units of states, inputs and outputs; empty if unknown.
        mode: index of the active mode of a controller with several modes, shape (N,); otherwise empty (0,).
        modes: names of the modes.
        edges: instants within the run at which what acts on it, or a signal of the controller, jumps, begins or ends,
            and at which the controller reads that [s], rising; there is a row at each.
        jumps: of a controller without an observer, times of events and switches whose rows contain what is before [s],
            and the commands right after them, shape (K, 1 + n_u); empty in logs of before.
        leads: times of actions, of edges, and, of a controller without an observer, of instants at which it reads what
            these, events and switches have done [s], and right before them ``u``, ``applied``, ``pushed`` and, where
            there is an observer, ``x_h`` and ``E``, shape (S, 1 + n_u + …): a row there contains what is after. Empty
            in logs of before.
    """

    plant: Literal["linear", "mujoco"]
    control: str
    t: Array
    x: Array
    y: Array
    u: Array
    x_o: Array
    x_h: Array
    E: Array
    events: Events
    outcome: Outcome
    precision: Mapping[str, float | int | str] = field(default_factory=dict)
    qpos: Array = field(default_factory=lambda: np.zeros((0, 0)))
    delay: float = 0.0
    applied: Array = field(default_factory=lambda: np.zeros((0, 0)))
    least: float = 0.0
    noisy: bool = False
    pressure: Pressure | None = None
    labels: Labels = UNKNOWN
    pushes: tuple[Push, ...] = ()
    pushed: Array = field(default_factory=lambda: np.zeros((0, 0)))
    mode: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    modes: tuple[str, ...] = ()
    setpoint: Setpoint | None = None
    edges: Array = field(default_factory=lambda: np.zeros(0))
    jumps: Array = field(default_factory=lambda: np.zeros((0, 0)))
    leads: Array = field(default_factory=lambda: np.zeros((0, 0)))

    @property
    def r(self) -> Array:
        """The set-point at the rows, shape (N, R); (N, 0) if there is none."""
        return self.setpoint(snap_rows(self.t, self.setpoint.edges)) if self.setpoint else np.zeros((len(self.t), 0))

    def card(self) -> Card:
        """Its representation at a prompt or in a notebook."""
        intervals, facts = self.events.interval, self.precision
        reach = np.abs(self.y).max(axis=0, initial=0.0)
        last = float(intervals[-1]) if len(intervals) else None
        step = f", step {facts['timestep']:g} s" if "timestep" in facts else ""
        rows = (
            ("plant", self.plant),
            ("control", self.control + (f", delay {self.delay:g} s" if self.delay else "")),
            ("end", self.outcome.message),
            ("rows", f"{len(self.t)} from {self.t[0]:g} to {self.t[-1]:.6g} s"),
            ("events", str(len(self.events))),
            ("last open-loop interval", amount(last, "s")),
            ("largest outputs", amounts(reach, self.labels.outputs, self.labels.output_units)),
            ("integrator", f"{facts.get('integrator', 'not known')}{step}"),
        )
        what = f"{self.plant} plant under {self.control} control"
        return Card(f"{what}, {count(len(self.events), 'event')}, {self.outcome.message}", rows)

    def to_series(self, rate: float | None = None, controller: Law | None = None, breaks: ArrayLike = ()) -> Series:
        """Every recorded signal under its name: ``x.ankle``, ``y.shank``, ``u.ankle_torque``, ``x_o.…``, ``x_h.…``.

        ``interval`` counts the previous events: it is 0 until the first event, whose row belongs to the interval that
        it ends. ``E`` is the event function, ``applied.…`` the input that acts, ``push.…`` the forces on the plant
        itself, named after the input or body that is pushed, ``cop.x`` and ``cop.y`` the centre of pressure, and
        ``load.…`` the normal force at each contact. Signals that the run does not have are left out.

        Where a signal jumps, recorded and interpolated rows give the same side: at an event, and where the controller
        changes its mode, the value before it; at an action that follows an event after a delay, and at a step of a
        set-point or a disturbance, the value from there on.

        Args:
            rate: rows per second [Hz], evenly spaced from t = 0; the recorded rows as they are if ``None``. At a
                recorded row the series has its values. Values between rows are interpolated by a cubic spline within
                each open-loop interval, never across an event, an action or a step (:mod:`icmj.series.interpolation`).
            controller: controller of the run; if given, the inputs and the event function right after each event are
                computed instead of extrapolated from the next row.
            breaks: further times [s] across which values are not interpolated; there the value is the one from there
                on.

        Raises:
            DataError: if the rate is not usable.
        """
        blocks = self._blocks(controller)
        names = tuple(name for block in blocks for name in block.names)
        units = tuple(unit for block in blocks for unit in block.units)
        values = np.concatenate([block.values for block in blocks], axis=1)
        facts = {"plant": self.plant, "control": self.control, "outcome": self.outcome.message}
        if rate is None:
            t = self.t
        else:
            t = list_multiples(step_of(rate, float(self.t[-1])), float(self.t[-1]))
            after = np.concatenate([block.right_after(len(self.resets)) for block in blocks], axis=1)
            before = np.concatenate([block.right_before(len(self.leads)) for block in blocks], axis=1)
            values = self.interpolate(names, values, t, after, breaks, before)
            if self.setpoint:
                values[:, [name.startswith("r.") for name in names]] = self.setpoint(t)
            facts |= {"resampled": f"cubic spline within each open-loop interval at {rate:g} Hz"}
        near = 0.0 if rate is None else NEAR
        interval = np.searchsorted(self.events.t, t - near, side="left")[:, None].astype(float)
        return Series(t, np.concatenate([values, interval], axis=1), (*names, COUNTER), (*units, ""), facts)

    def interpolate(
        self,
        names: Sequence[str],
        values: Array,
        t: Array,
        after: Array | None = None,
        breaks: ArrayLike = (),
        before: Array | None = None,
    ) -> Array:
        """Signals at other times than those of the rows, across none of :attr:`breaks`.

        Args:
            names: what they are called, as in :meth:`to_series`: states and outputs do not jump.
            values: at the rows, shape (N, w).
            t: times [s], increasing, within the run, shape (M,).
            after: values right after each of :attr:`resets`, NaN if unknown, shape (K, w).
            breaks: further times across which nothing is interpolated [s].
            before: values right before each of ``leads``, NaN if unknown, shape (S, w).
        """
        kinds, resets = np.array([name.split(".")[0] for name in names]), self.resets
        bends, after = is_steady(names), np.full((len(resets), len(names)), np.nan) if after is None else after
        held, error = np.isin(kinds, ("u", "x_h")) & (self.x_o.shape[1] > 0), kinds == "E"
        if self.control == "continuous":  # whose hold is the observer; the set-point moves its commands at once
            steady_held = held & ((kinds == "x_h") | (self.setpoint is None))
            bends, held = bends | steady_held, held & False
        # what is held jumps at actions alone, and knows of no edge; the event function bends where the observer does
        given, found = np.concatenate([self.actions, np.ravel(breaks)]), np.empty((len(t), len(names)))
        led = self.leads[:, 0] if self.leads.size else np.zeros(0)
        jumping = np.concatenate([given, self.edges, led])
        for these, others, bending in (
            (held, given, None),
            (error, jumping if self.setpoint else given, self.edges),
            (~(held | error), jumping, None),
        ):
            if these.any():
                found[:, these] = piecewise(
                    self.t, values[:, these], t, jumps=resets, after=after[:, these],
                    breaks=others, before=None if before is None else (led, before[:, these]),
                    bends=bending, steady=bends[these],
                )  # fmt: skip
        return found

    @property
    def actions(self) -> Array:
        """Times at which what an event has decided acts, after a delay [s]; empty without one."""
        observes, events = self.x_o.shape[1] > 0, self.events.t
        actions = np.append(0.0, events) + self.delay if self.delay else np.zeros(0)
        if not observes and len(actions) and len(events):  # the row of an event shows what is before an action, too
            near = np.abs(events[np.clip(np.searchsorted(events, actions - NEAR), 0, len(events) - 1)] - actions)
            actions = actions[near > NEAR]
        return actions

    @property
    def switches(self) -> Array:
        """Times at which the controller changes its mode without an event [s], whose rows contain what is before."""
        if len(self.mode) != len(self.t):
            return np.zeros(0)
        if self.jumps.size:
            times = self.jumps[:, 0]
            return times[~np.isin(times, self.events.t)]
        # the row of an action or an edge has the mode from there on: what changes before it does not change at a row
        later = np.append(np.sort(np.concatenate([self.actions, self.edges])), np.inf)
        after = self.t[1:]
        planned = np.abs(later[np.searchsorted(later, after - NEAR)] - after) <= NEAR
        times = self.t[:-1][(np.diff(self.mode) != 0) & ~planned]
        return times[~np.isin(times, self.events.t)]

    @property
    def breaks(self) -> tuple[Array, Array]:
        """Times of resets, whose rows contain the values before, and of actions and edges, whose rows are after [s]."""
        # with a delay an event of observer and hold resets nothing yet
        resets = np.zeros(0) if self.delay and self.x_o.shape[1] > 0 else self.events.t
        return resets, np.concatenate([self.actions, self.edges])

    @property
    def resets(self) -> Array:
        """Times of all rows that contain what is before a jump: those of resets and of changes of mode, rising [s]."""
        return np.sort(np.concatenate([self.breaks[0], self.switches]))

    def u_after(self, controller: Law) -> Array:
        """The commands of the run's controller right after each event, for a run without a delay; shape (K, n_u).

        Raises:
            AnalysisError: if it has no observer, from which they follow.
        """
        k, r = expect_intermittent(controller).design.k, self.setpoint
        return -self.events.x_o @ k.T + (r(self.events.t) @ r.gain(k).T if r else 0.0)

    def events_to_series(self) -> Series:
        """One row for each event: Δ_i, states before the reset, and extremes of outputs since the previous event."""
        events, labels = self.events, self.labels
        blocks = [
            look_up_columns("", ("interval",), ("s",), events.interval[:, None]),
            look_up_columns("x", labels.states, labels.state_units, events.x),
            look_up_columns("x_o", labels.assumed, labels.assumed_units, events.x_o),
            look_up_columns("x_h", labels.assumed, labels.assumed_units, events.x_h),
            look_up_columns("y_max", labels.outputs, labels.output_units, events.y_max),
            look_up_columns("y_min", labels.outputs, labels.output_units, events.y_min),
        ]
        return Series(
            events.t,
            np.concatenate([block.values for block in blocks], axis=1),
            tuple(name for block in blocks for name in block.names),
            tuple(unit for block in blocks for unit in block.units),
            {"plant": self.plant, "control": self.control},
        )

    @property
    def push_names(self) -> tuple[str, ...]:
        """Names of the inputs or bodies that are pushed, with a number if one body is pushed in several ways."""
        names = [push.where for push in self.pushes]
        return tuple(
            name if names.count(name) == 1 else f"{name}.{names[:i].count(name)}" for i, name in enumerate(names)
        )

    @property
    def push_units(self) -> tuple[str, ...]:
        """Units of :attr:`push_values`."""
        units = dict(zip(self.labels.inputs, self.labels.input_units, strict=True))
        return tuple(push.unit(units.get(push.where, "")) for push in self.pushes)

    @property
    def push_values(self) -> Array:
        """The force at each place [N], or the torque [N m], or the size of both together; shape (N, K)."""
        return self.pushed * [push.magnitude for push in self.pushes] if self.pushes else self.pushed

    def to_pandas(self, rate: float | None = None, controller: Law | None = None, breaks: ArrayLike = ()) -> DataFrame:
        """:meth:`to_series` as a pandas ``DataFrame``, indexed by time, with units in ``attrs["units"]``.

        Raises:
            DataError: if pandas is not installed, or the rate is not usable.
        """
        return self.to_series(rate, controller, breaks).to_pandas()

    def to_xarray(self, rate: float | None = None, controller: Law | None = None, breaks: ArrayLike = ()) -> Dataset:
        """:meth:`to_series` as an ``xarray.Dataset``; see :meth:`icmj.Series.to_xarray`.

        Raises:
            DataError: if xarray is not installed, or the rate is not usable.
        """
        return self.to_series(rate, controller, breaks).to_xarray()

    def to_timeresponse(self) -> TimeResponseData:
        """The recorded rows as ``TimeResponseData`` of python-control, whose ``plot()`` draws them.

        Inputs are the commands u, outputs are y, and states are x. Because of events, rows are not evenly spaced.
        """
        from control import TimeResponseData

        labels = self.labels
        return TimeResponseData(
            self.t,
            outputs=self.y.T,
            states=self.x.T,
            inputs=self.u.T,
            output_labels=list(look_up_columns("y", labels.outputs, (), self.y).bare),
            state_labels=list(look_up_columns("x", labels.states, (), self.x).bare),
            input_labels=list(look_up_columns("u", labels.inputs, (), self.u).bare),
            title=f"{self.control} control, {self.plant} plant",
            plot_inputs=True,
        )

    def _blocks(self, controller: Law | None) -> list[Block]:
        """The recorded signals, and their values right after each reset where they are known."""
        labels, at = self.labels, np.searchsorted(self.t, self.resets)
        # with a delay the commands of an observer and a hold jump at actions, not at events
        command = self.u_after(controller) if controller and controller.observed and not self.delay else None
        if self.jumps.size:
            place = np.minimum(np.searchsorted(self.jumps[:, 0], self.resets), len(self.jumps) - 1)
            known = np.abs(self.jumps[place, 0] - self.resets) <= NEAR
            command = np.where(known[:, None], self.jumps[place, 1:], np.nan)
        led = acted = pushed = held = level_before = None
        if self.leads.size:
            widths = (1, *(of.shape[1] for of in (self.u, self.applied, self.pushed, self.x_h)))
            _, led, acted, pushed, held, level_before = np.split(self.leads, np.cumsum(widths), axis=1)
        blocks = [
            look_up_columns("x", labels.states, labels.state_units, self.x, self.x[at]),
            look_up_columns("y", labels.outputs, labels.output_units, self.y, self.y[at]),
            look_up_columns("u", labels.inputs, labels.input_units, self.u, command, led),
            look_up_columns("x_o", labels.assumed, labels.assumed_units, self.x_o, self.x_o[at]),
            look_up_columns("x_h", labels.assumed, labels.assumed_units, self.x_h, self.x_o[at], held),
        ]
        if np.isfinite(self.E).any():
            level = np.full((len(at), 1), -controller.faces.unit) if controller else None
            blocks.append(look_up_columns("", ("E",), ("",), self.E[:, None], level, level_before))
        if self.applied.size:
            limited = bool(self.precision.get("saturated_share"))
            acting = None if command is None or limited else self.applied[at] + command - self.u[at]
            blocks.append(look_up_columns("applied", labels.inputs, labels.input_units, self.applied, acting, acted))
        if self.pushes:
            led = None if pushed is None else pushed * [push.magnitude for push in self.pushes]
            values = self.push_values
            blocks.append(look_up_columns("push", self.push_names, self.push_units, values, values[at], led))
        if self.setpoint:
            blocks.append(look_up_columns("r", self.setpoint.names, self.setpoint.units, self.r, self.r[at]))
        if self.pressure is not None:
            ground, known = self.pressure, 0 < len(self.pressure.t_after) == len(at)
            newtons = ("N",) * len(ground.geoms)
            blocks += [
                look_up_columns("cop", ("x", "y"), ("m", "m"), ground.centre, ground.centre_after if known else None),
                look_up_columns("load", ground.geoms, newtons, ground.load, ground.load_after if known else None),
            ]
        return blocks


LARGE = 1e-3
"""Largest relative error of an interval, or of the outputs, that goes without a word."""


def list_remarks(simulation: Simulation) -> tuple[Notice, ...]:
    """Notices on a run, from its facts."""
    return tuple(_remarks(simulation))


def get_relative_error(simulation: Simulation) -> float:
    """Estimated error of the last interval relative to it, or of the outputs where there is none; NaN if not known."""
    facts = simulation.precision
    error, stretch = (float(facts.get(name, np.nan)) for name in ("interval_error", "error_stretch"))
    if np.isfinite(error) and stretch > 0:
        return error / stretch
    return float(facts.get("output_error", np.nan))


def _remarks(simulation: Simulation) -> Iterator[Notice]:
    facts = simulation.precision
    if float(facts.get("saturated_share", 0.0)) > 0:
        words = (
            f"the actuators reach their limits ({facts.get('saturated', '')} of the time), where the plant is not "
            "linear: u is the command, applied what acts; widen their ranges, or lower the threshold"
        )
        yield Notice("saturation", "warning", words)
    if facts.get("clipped"):
        words = (
            f"sensors reach their cutoff ({facts['clipped']} of the time), where the controller sees less than there "
            "is; widen cutoff, or lower the threshold"
        )
        yield Notice("saturation", "warning", words)
    if facts.get("not_adaptive"):
        words = (
            f"the motion is not smooth ({facts['not_adaptive']}), so no tolerance can be kept to: "
            f"{facts['integrator']} steps by {float(facts['timestep']):g} s; give [simulation] a timestep instead of it"
        )
        yield Notice("not smooth", "warning", words)
    if simulation.pressure is not None and (lifted := simulation.pressure.lifted):
        words = (
            f"{' and '.join(lifted)} lifts from the ground during the run, where the plant is not the one that was "
            "linearised; lower the threshold or what disturbs, or widen what the body stands on"
        )
        yield Notice("lift-off", "warning", words)
    error = get_relative_error(simulation)
    if error > LARGE and facts.get("tolerance"):
        words = f"the tolerance of {float(facts['tolerance']):g} let an interval err by {error:.1g} of itself"
        yield Notice("large step", "warning", words)
    elif error > LARGE:
        words = (
            f"the step of {float(facts['timestep']):g} s with {facts['integrator']} errs by {error:.1g} of an interval;"
            " shorten [simulation] timestep" + (', or take integrator = "RK4"' if facts["integrator"] != "RK4" else "")
        )
        yield Notice("large step", "warning", words)
