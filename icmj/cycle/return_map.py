"""The return map P of a simulated loop: from the state z at an event to the state at a later event.

The state is z = (x, x_o), of plant and observer as departures from the operating point, because an event sets the hold
to the observer; with a delay an event resets nothing yet, and z = (x, x_o, x_h). As the delay goes to zero, P forgets
the x_h that it is given, and still says which x_h the next event finds; so a loop without one can be taken with the
longer z, too, and a branch in the delay goes down to zero. On a plant that is odd-symmetric about
its operating point the mirror image of a motion is a motion, and a *mirrored* cycle is one with −P(z) = z.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Literal, Protocol, Self

import numpy as np

from icmj.base.array import Array
from icmj.controller.controller import Controller
from icmj.errors import CycleError
from icmj.plant.linear_plant import LinearPlant
from icmj.simulation.ending import Outcome
from icmj.simulation.open_loop import OpenLoop, OpenLoopInterval
from icmj.simulation.settings import Settings
from icmj.simulation.sources import Bias, Step
from icmj.theory.event_maps import is_still

if TYPE_CHECKING:
    from icmj.engine.open_loop import OpenLoops
    from icmj.engine.plant import MujocoPlant

PlantKind = Literal["linear", "mujoco"]
COLLAPSED = 1e-9  # relative: an interval this close to the least one was not ended by the event function


class LostInterval(CycleError):
    """A simulated interval did not end with an event.

    Attributes:
        outcome: how it ended instead.
        flown: how long it was [s].
    """

    outcome: Outcome
    flown: float

    @classmethod
    def after(cls, outcome: Outcome, flown: float) -> LostInterval:
        """The error of an interval that was ``flown`` for so long [s] and ended so."""
        lost = cls(f"from there the motion {outcome.message}, without a further event")
        lost.outcome, lost.flown = outcome, flown
        return lost


@dataclass(frozen=True, eq=False)
class Turn:
    """The result of simulating successive intervals.

    Attributes:
        intervals: their lengths [s], shape (p,).
        states: z at the event that begins each, shape (p, N).
        end: z at the last event, shape (N,).
        y_max, y_min: extremes of the outputs over all of them, shape (n_y,).
        rows: what each flight kept on the way, for its course; empty arrays where nothing was kept.
    """

    intervals: Array
    states: Array
    end: Array
    y_max: Array
    y_min: Array
    rows: tuple[Array, ...] = ()

    def extent(self, sign: int) -> tuple[Array, Array]:
        """Peak magnitude and peak to peak of the outputs over the whole period, shapes (n_y,)."""
        peak = np.maximum(np.abs(self.y_max), np.abs(self.y_min))
        return peak, (self.y_max - self.y_min if sign > 0 else 2 * peak)


class Flights(Protocol):
    """The interface that a search for cycles needs: :class:`ReturnMap`, or the map of another controller."""

    def turn(self, z: Array, p: int = 1) -> Turn:
        """Fly p intervals from z; :class:`LostInterval` if one does not end."""

    def another(self) -> Self:
        """The same map for another thread."""

    def has_collapsed(self, interval: float) -> bool:
        """Whether an interval has the minimum length."""

    @property
    def least(self) -> float:
        """The minimum length of an interval [s]."""


@dataclass(frozen=True, eq=False)
class ReturnMap:
    """A closed loop that simulates from event to event; use one for each thread.

    Attributes:
        plant: the actual one: linear, or on the engine.
        controller: with the event rule.
        settings: of the flights; their duration is the longest that is flown.
        every: how often flights on the engine keep a row [s]; never by default.
        loops: makes flights on the engine for several return maps, one at a time; each makes its own by default.
        held: z has the hold without a delay, too.
    """

    plant: LinearPlant | MujocoPlant
    controller: Controller
    settings: Settings
    every: float = np.inf
    loops: OpenLoops | None = None
    held: bool = False

    def __post_init__(self) -> None:
        changing = [s for s in self.settings.disturbance if not isinstance(s, Step | Bias) or s.start]
        if changing:
            raise CycleError(
                "cycles are computed only for a loop that does not vary with time, but "
                f"{type(changing[0]).__name__.lower()} "
                "acts; take simulation.disturbance out of the run file"
            )
        if self.controller.sampling_delay:
            raise CycleError(
                "cycles are computed only for a loop whose events are the instants at which its "
                "rule reaches the threshold; this one samples "
                f"{self.controller.sampling_delay:g} s later: take controller.sampling_delay out of the run file"
            )

    @property
    def kind(self) -> PlantKind:
        """The plant that it simulates: ``linear`` or ``mujoco``."""
        return "linear" if isinstance(self.plant, LinearPlant) else "mujoco"

    @property
    def linear(self) -> LinearPlant:
        """The plant, or its linearisation."""
        return self.plant if isinstance(self.plant, LinearPlant) else self.plant.linearisation.plant

    @cached_property
    def fly(self) -> OpenLoop:
        """One open-loop interval as a function."""
        if isinstance(self.plant, LinearPlant):
            from icmj.linear.open_loop import open_loop as linear_open_loop

            return linear_open_loop(self.plant, self.controller, self.settings)
        from icmj.engine.open_loop import OpenLoops

        return (self.loops or OpenLoops())(self.plant, self.controller, self.settings, self.every)

    @property
    def holds(self) -> bool:
        """Whether z contains the hold state."""
        return self.held or bool(self.controller.delay)

    @property
    def size(self) -> int:
        """N, the length of z."""
        return self.linear.n + self.controller.design.plant.n * (2 if self.holds else 1)

    def split(self, z: Array) -> tuple[Array, Array, Array]:
        """x, x_o and x_h right after the event at z, which without a delay resets the hold."""
        n, n_hat = self.linear.n, self.controller.design.plant.n
        x_o = z[n : n + n_hat]
        return z[:n], x_o, z[n + n_hat :] if self.controller.delay else x_o

    def join(self, x: Array, x_o: Array, x_h: Array) -> Array:
        """z from its parts right before the event, shape (..., N)."""
        return np.concatenate([x, x_o, *([x_h] if self.holds else [])], axis=-1)

    def turn(self, z: Array, p: int = 1) -> Turn:
        """Fly p intervals from z.

        Raises:
            Lost: if one does not end in an event.
        """
        intervals, states = np.zeros(p), np.zeros((p, self.size))
        y_max, y_min = np.full(self.linear.n_y, -np.inf), np.full(self.linear.n_y, np.inf)
        kept = []
        for i in range(p):
            states[i] = z
            flight, rows = self._fly(*self.split(z))
            kept.append(rows)
            if flight.outcome is not None:
                raise LostInterval.after(flight.outcome, flight.length)
            intervals[i], z = flight.length, self.join(flight.x, flight.x_o, flight.x_h)
            y_max, y_min = np.maximum(y_max, flight.y_max), np.minimum(y_min, flight.y_min)
        return Turn(intervals, states, z, y_max, y_min, tuple(kept))

    def _fly(self, x: Array, x_o: Array, x_h: Array) -> tuple[OpenLoopInterval, Array]:
        if isinstance(self.plant, LinearPlant):
            return self.fly(x, x_o, x_h), np.empty((0, 0))
        recorded: tuple[OpenLoopInterval, Array] = self.fly.recorded(x, x_o, x_h)  # type: ignore[attr-defined]
        return recorded

    @property
    def least(self) -> float:
        """The shortest interval that the controller allows [s]."""
        return self.controller.least

    def has_collapsed(self, interval: float) -> bool:
        """Whether an interval ended as soon as Δ_min or the delay allowed."""
        return bool(interval <= self.least * (1 + COLLAPSED) + 1e-12)

    def refine(self, factor: float) -> ReturnMap:
        """The same map at another timestep or tolerance; on the linear plant, unchanged."""
        if isinstance(self.plant, LinearPlant):
            return self
        from icmj.engine.stepping import refine

        return replace(self, settings=refine(self.plant, self.controller, self.settings, factor))

    def is_alternating(self, p: int, sign: int) -> bool:
        """Whether its mirrored cycles are members of families; see :func:`icmj.theory.event_maps.is_alternating`."""
        held, predicted = self.controller.hold.A_h, self.controller.delay.predicted
        return p == 1 and sign < 0 and not predicted and is_still(self.controller.faces.R, held)

    def another(self) -> ReturnMap:
        """The same map for another thread."""
        return replace(self, loops=None)

    def odd(self, z: Array, scale: Array, tolerance: float = 1e-8) -> bool:
        """Whether the flight from −z is the mirror image of that from z, relative to ``scale``, shape (N,)."""
        there, back = self.turn(z), self.turn(-z)
        return bool((np.abs(there.end + back.end) <= tolerance * scale).all())
