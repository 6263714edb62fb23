"""The time series that the viewer shows, taken from a result, in groups.

Plain numpy; how they are drawn is in :mod:`icmj.log.blueprint`, how they are stored in :mod:`icmj.log.writer`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np

from icmj.base.array import RELATIVE_ROUNDING, Array
from icmj.case.laid_orbit import lay_orbit
from icmj.case.motion import acting, modes, reduce_state, running_interval, with_resets
from icmj.case.quantity import in_brackets
from icmj.case.result import Result
from icmj.controller.controller import expect_intermittent
from icmj.controller.setpoint import Setpoint
from icmj.log import palette
from icmj.log.palette import Colour
from icmj.simulation.simulation import Simulation
from icmj.theory.prediction import Prediction


@dataclass(frozen=True, eq=False)
class Entity:
    """Series of one kind that share their times: one entity of the log.

    Attributes:
        path: entity path.
        t: times [s], shape (M,); may repeat where a value jumps.
        values: shape (M, w).
        names, colours: for the legend, length w.
        width: stroke width, or marker size of points [ui points].
        kind: ``lines`` or ``points``.
    """

    path: str
    t: Array
    values: Array
    names: tuple[str, ...]
    colours: tuple[Colour, ...]
    width: float = 1.5
    kind: Literal["lines", "points"] = "lines"

    @property
    def aggregation(self) -> Literal["Off", "MinMax"]:
        """How the viewer draws more points than pixels: a sawtooth is kept as it is, smooth curves by extremes."""
        return "Off" if len(self.t) < 3000 else "MinMax"


def list_groups(result: Result) -> Iterator[Entity]:
    """Every group of series of ``result``; those that do not exist (no cycle, no trigger ...) are left out."""
    if (prediction := result.prediction) is None:
        yield from _bare_signals(result)
    else:
        yield from _signals(result, prediction)
        yield from _trigger(result)
        yield from _intervals(result, prediction)
        yield from _modes(result, prediction)
    yield from list_acting_groups(result)
    yield from list_pressure_groups(result)
    run = result.simulation
    if run.mode.size:
        yield Entity("mode/run", run.t, run.mode[:, None].astype(float), (", ".join(run.modes),), (palette.RUNNING,))


def _bare_signals(result: Result) -> Iterator[Entity]:
    """Outputs, inputs and states of a run with nothing to be compared with."""
    run, plant = result.simulation, result.actual
    for path, values, names in (
        ("outputs/run", run.y, plant.outputs),
        ("inputs/run", run.u, plant.inputs),
        ("states/plant", run.x, plant.states),
    ):
        yield Entity(path, run.t, values, names, palette.choose_colours(len(names)))
    yield from list_setpoint_groups(run)


def _signals(result: Result, prediction: Prediction) -> Iterator[Entity]:
    """Outputs, inputs and states: continuous, predicted and run, in this (alphabetical) order drawn on each other."""
    simulation, continuous = result.simulation, result.continuous
    y_names, u_names = result.actual.outputs, result.actual.inputs
    y_colours, u_colours = palette.choose_colours(len(y_names)), palette.choose_colours(len(u_names))
    laid = lay_orbit(result) if prediction.cycle else None
    if laid is not None:
        y, u = (laid.at(simulation.t, signal) for signal in (laid.orbit.y, laid.orbit.u))
        for where, values, names, colours in (("outputs", y, y_names, y_colours), ("inputs", u, u_names, u_colours)):
            dim = tuple(palette.darken(colour) for colour in colours)
            yield Entity(f"{where}/predicted", simulation.t, values, ("predicted orbit",) * len(names), dim, 5.0)
    if continuous is not None:
        for where, values, names in (("outputs", continuous.y, y_names), ("inputs", continuous.u, u_names)):
            grey = (palette.CONTINUOUS,) * len(names)
            yield Entity(f"{where}/continuous", continuous.t, values, ("continuous control",) * len(names), grey, 1.0)
    yield Entity("outputs/run", simulation.t, simulation.y, y_names, y_colours)
    yield from list_setpoint_groups(simulation)
    events, u_after = simulation.events, simulation.u_after(expect_intermittent(result.controller))
    yield Entity("inputs/run", *with_resets(simulation, simulation.u, u_after), u_names, u_colours)
    for path, (t, values), names in (
        ("states/plant", (simulation.t, simulation.x), result.actual.states),
        ("states/observer", (simulation.t, simulation.x_o), result.assumed.states),
        ("states/hold", with_resets(simulation, simulation.x_h, events.x_o), result.assumed.states),
    ):
        yield Entity(path, t, values, names, palette.choose_colours(len(names)))


def list_setpoint_groups(simulation: Simulation) -> Iterator[Entity]:
    """The set-point that a run followed, if any."""
    if simulation.setpoint:
        names = tuple(f"set-point {name}" for name in simulation.setpoint.names)
        colours = tuple(palette.fade(colour) for colour in palette.choose_colours(len(names)))
        yield Entity("outputs/setpoint", *_upright(simulation.setpoint, simulation.t), names, colours, 1.0)


def _upright(r: Setpoint, t: Array) -> tuple[Array, Array]:
    """The set-point at these times, and before and after each of its jumps between them."""
    edges = r.edges[r.edges < t[-1]]
    when = np.concatenate([edges, t, edges])
    values = np.concatenate([r((1 - RELATIVE_ROUNDING) * edges), r(t), r(edges)])
    order = np.argsort(when, kind="stable")
    return when[order], values[order]


def list_acting_groups(result: Result) -> Iterator[Entity]:
    """The inputs that act on the plant where they differ from the command: limited, and with disturbances."""
    inputs = acting(result)
    if inputs:
        names = tuple(f"{result.actual.inputs[i]}, what acts" for i in inputs)
        colours = tuple(palette.fade(palette.choose_colours(result.actual.n_u)[i]) for i in inputs)
        values = np.ascontiguousarray(result.simulation.applied[:, inputs])
        yield Entity("inputs/what_acts", result.simulation.t, values, names, colours, 1.0)
    run = result.simulation
    if run.pushes:
        names = tuple(
            f"push on {name}{in_brackets(unit)}" for name, unit in zip(run.push_names, run.push_units, strict=True)
        )
        colours = tuple(palette.fade(colour) for colour in palette.choose_colours(len(names)))
        yield Entity("inputs/pushes", run.t, np.ascontiguousarray(run.push_values), names, colours, 1.0)


def list_pressure_groups(result: Result) -> Iterator[Entity]:
    """Centre of pressure, its value at rest, and the load of each contact."""
    simulation, pressure = result.simulation, result.simulation.pressure
    if pressure is None:
        return
    axes = pressure.axes or ("x",)
    there = ["xy".index(axis) for axis in axes]
    colours = palette.choose_colours(len(axes))
    rest = np.tile(pressure.at_rest[there], (2, 1))
    dim = tuple(palette.darken(colour) for colour in colours)
    yield Entity("pressure/at_rest", simulation.t[[0, -1]], rest, ("at rest",) * len(axes), dim, 1.5)
    for path, values, after, names in (
        ("pressure/centre", pressure.centre[:, there], pressure.centre_after[:, there], axes),
        ("load/borne", pressure.load, pressure.load_after, pressure.geoms),
    ):
        t = simulation.t
        if len(after):
            t, values = with_resets(simulation, values, after)
        yield Entity(path, t, np.ascontiguousarray(values), names, palette.choose_colours(len(names)))


def _trigger(result: Result) -> Iterator[Entity]:
    """The hold error over its threshold, which E is computed from, the level of an event, and the events on it."""
    simulation, controller = result.simulation, expect_intermittent(result.controller)
    faces = controller.trigger.faces(controller.design)
    if not len(faces) or not np.isfinite(simulation.E).any():
        return
    events = simulation.events
    share = np.sqrt(np.maximum(1 + simulation.E[:, None] / faces.unit, 0))  # E = unit · (share² − 1)
    t, share = with_resets(simulation, share, np.zeros((len(events), 1)))
    yield Entity("trigger/threshold", simulation.t[[0, -1]], np.ones((2, 1)), ("threshold",), (palette.LEVEL,), 1.5)
    yield Entity("trigger/E", t, share, ("hold error / threshold",), (palette.E,))
    if len(events):
        at = np.ones((len(events), 1))
        yield Entity("trigger/events", events.t, at, ("event",), (palette.EVENT,), 3.0, "points")


def _intervals(result: Result, prediction: Prediction) -> Iterator[Entity]:
    """Open-loop interval as it runs and at events, with Δ_crit."""
    simulation = result.simulation
    if simulation.control == "continuous":
        return
    t, since = running_interval(simulation)
    yield Entity("interval/running", t, since[:, None], ("time since last event",), (palette.RUNNING,), 1.0)
    if prediction.delta_crit is not None:
        name = "Δ_crit" if prediction.cycle else "Δ_crit (no cycle predicted)"
        line = np.full((2, 1), prediction.delta_crit)
        yield Entity("interval/delta_crit", simulation.t[[0, -1]], line, (name,), (palette.LEVEL,), 1.5)
    if len(simulation.events):
        at = simulation.events.interval[:, None]
        yield Entity("interval/events", simulation.events.t, at, ("Δ_i",), (palette.EVENT,), 4.0, "points")


def _modes(result: Result, prediction: Prediction) -> Iterator[Entity]:
    """χ, its real part, with ±γ and the critical mode at the events."""
    simulation = result.simulation
    if prediction.V_inv is None:
        return
    chi = modes(result, reduce_state(result, simulation.x, simulation.x_o, simulation.x_h)).real
    if chi.shape[1] > 1:
        others = ("other modes",) * (chi.shape[1] - 1)
        grey = (palette.OTHER_MODES,) * len(others)
        yield Entity("modes/others", simulation.t, np.ascontiguousarray(chi[:, 1:]), others, grey, 1.0)
    if prediction.gamma is not None:
        lines = np.outer([1, 1], [prediction.gamma, -prediction.gamma])
        yield Entity("modes/gamma", simulation.t[[0, -1]], lines, ("γ", "−γ"), (palette.LEVEL,) * 2, 1.5)
    yield Entity("modes/critical", simulation.t, chi[:, :1].copy(), ("critical mode",), (palette.CRITICAL,))
    if len(simulation.events):
        events = simulation.events
        at = modes(result, reduce_state(result, events.x, events.x_o, events.x_h)).real[:, :1].copy()
        yield Entity("modes/events", events.t, at, ("event",), (palette.EVENT,), 3.0, "points")
