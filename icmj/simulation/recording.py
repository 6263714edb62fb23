"""The recorded states of the controller and exogenous inputs of a run, the same for both plants."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from icmj.base.array import Array
from icmj.controller.controller import Controller
from icmj.controller.law import Law
from icmj.simulation.disturbance import Pushes


@dataclass(frozen=True, eq=False)
class Kept:
    """Rows of the controller's state as they are recorded.

    Attributes:
        x_o, x_h: observer and hold state, shape (N, n̂).
        u: commands, shape (N, n_u).
        E: event function, shape (N,); NaN where there is no event rule.
    """

    x_o: Array
    x_h: Array
    u: Array
    E: Array


def kept(controller: Controller, x_o: Array, x_h: Array, e: Array | None = None) -> Kept:
    """Rows of observer, hold and, where it is known more exactly than as their difference, hold error e_hp."""
    u, n = -x_h @ controller.model[0].k.T, controller.plant.n
    return Kept(x_o[:, :n], x_h[:, :n], u, controller.faces.E(x_h - x_o if e is None else e))


def driven(controller: Law, pushes: Pushes, t: Array) -> dict[str, Any]:
    """Optional fields of a run at its rows: the set-point, and pushes."""
    pushed = {"pushes": pushes.places, "pushed": pushes.size(t)} if len(pushes) else {}
    return {"setpoint": controller.setpoint, **pushed}
