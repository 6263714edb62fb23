"""The recorded states of the controller and exogenous inputs of a run, the same for both plants."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from icmj.base.array import Array
from icmj.controller.controller import Controller
from icmj.controller.law import Law
from icmj.series.interpolation import NEAR, snap_rows
from icmj.simulation.disturbance import Acting


@dataclass(frozen=True, eq=False)
class ControllerRows:
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


def keep_rows(controller: Controller, x_o: Array, x_h: Array, e: Array | None = None) -> ControllerRows:
    """Rows of observer, hold and, where it is known more exactly than as their difference, hold error e_hp."""
    u, n = -x_h @ controller.model[0].k.T, controller.plant.n
    return ControllerRows(x_o[:, :n], x_h[:, :n], u, controller.faces.E(x_h - x_o if e is None else e))


def part_rows(t: Array, u: Array) -> tuple[np.ndarray, Array]:
    """Of the rows of a run by stretches, of which two may be at one instant, those before it, and what comes after.

    Args:
        t: times of the rows [s], rising, shape (M,).
        u: commands, shape (M, n_u).

    Returns:
        a mask with one row for each instant, shape (M,), and (t, u) right after those of which there are two, shape
        (K, 1 + n_u). Of the start, at which what happens is of the start, only the last row counts.
    """
    same = np.diff(t) <= 0
    second, first = np.append(False, same) & (t > 0), np.append(same, False) & (t <= 0)
    return ~(second | first), np.column_stack([t, u])[second]


def list_edges(acting: Acting, law: Law) -> Array:
    """Instants at which a motion jumps or bends by what is given: rising, positive and finite [s].

    There what acts, or a signal of the controller's own, begins, ends or jumps, or the controller reads that later, as
    it reads the start of the run; and where what it then does is read in its turn, which bends its command once more.
    """
    real = law.realisation
    given = np.unique(np.concatenate([acting.edges, real.signals[:, 4:].ravel()]))
    given = np.append(0.0, given[np.isfinite(given) & (given > 0)])
    for _ in range(2):
        given = np.unique(np.concatenate([given, np.add.outer(given, real.taps).ravel()]))
    return given[given > 0]


def collect_drives(controller: Law, acting: Acting, t: Array) -> dict[str, Any]:
    """Optional fields of a run at its rows: the set-point, pushes, and when what is given jumps."""
    pushes, end, edges = acting.pushes, float(t[-1]), list_edges(acting, controller)
    pushed = {"pushes": pushes.places, "pushed": pushes.size(snap_rows(t, edges))} if len(pushes) else {}
    return {"setpoint": controller.setpoint, "edges": edges[edges <= end + NEAR], **pushed}
