"""One open-loop interval as a function: from the state at an event to the state at the next, without a recording.

Both simulators provide it. Growth, amplitude law, attractors and accuracy use it, as does code that iterates or
differentiates the return map.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from icmj.base.array import Array
from icmj.controller.controller import Controller
from icmj.errors import SimulationError
from icmj.simulation.ending import Outcome


@dataclass(frozen=True, eq=False)
class OpenLoopInterval:
    """The result of simulating one open-loop interval.

    Attributes:
        length: Δ_ol [s], or the duration of the flight if it did not end in an event.
        x, x_o, x_h: plant, observer and hold state at its end, before the reset; shapes (n,), (n̂,), (n̂,).
        y: outputs at its end, shape (n_y,).
        y_max, y_min: extremes of the outputs over the interval, shape (n_y,); NaN if it did not end in an event.
        outcome: ``None`` if it ended in an event, otherwise how it ended.
    """

    length: float
    x: Array
    x_o: Array
    x_h: Array
    y: Array
    y_max: Array
    y_min: Array
    outcome: Outcome | None


def expect_one_in_flight(controller: Controller) -> None:
    """Refuse loops whose state at an event is more than x, x_o and x_h: a clock faster than the delay, signals.

    Raises:
        SimulationError: if there is any.
    """
    if len(controller.realisation.signals):
        raise SimulationError(
            "the controller follows signals of its own: an interval is no function of the state at its event; take "
            "them away, or simulate the run instead"
        )
    if controller.delay.in_flight(controller.trigger.clock) > 1:
        raise SimulationError(
            f"a clock of {controller.trigger.clock:g} s ticks again before the delay of {controller.delay.t_d:g} s is "
            "over: an interval is no function of the state at its event; simulate the run instead"
        )


class OpenLoop(Protocol):
    """A closed loop prepared for simulations from event to event."""

    def __call__(self, x: Array, x_o: Array, x_h: Array | None = None, t: float = 0.0) -> OpenLoopInterval:
        """Fly from an event at time ``t``.

        Args:
            x, x_o: plant and observer state there, shapes (n,) and (n̂,).
            x_h: hold state right after it, shape (n̂,); ``x_o`` if ``None``, which is the reset. With a delay the event
                resets nothing yet, and x_h is needed.
            t: time of the event [s]; matters for clocks and disturbances.
        """
