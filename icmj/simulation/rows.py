"""The recorded states of the controller and exogenous inputs of a run, the same for both plants."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from icmj.base.array import Array
from icmj.base.balancing import propagate
from icmj.controller.controller import Controller
from icmj.controller.law import Law
from icmj.plant.linear_plant import LinearPlant
from icmj.series.interpolation import NEAR, has_instants, snap_rows
from icmj.simulation.disturbance import Acting
from icmj.simulation.labels import make_labels
from icmj.simulation.native.taps import KEPT
from icmj.simulation.settings import Settings
from icmj.simulation.taps import get_delay, get_least_interval


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


def part_rows(t: Array, u: Array, mode: np.ndarray) -> tuple[np.ndarray, Array, Array, np.ndarray]:
    """Of the rows of a run by stretches, of which two may be at one instant, those that stay, and what others tell.

    Args:
        t: times of the rows [s], rising, shape (M,).
        u: commands, shape (M, n_u).
        mode: of each row, shape (M,); of a second one that is to stay, ``KEPT`` less it.

    Returns:
        a mask with one row for each instant, shape (M,); (t, u) right after and right before those of which there are
        two, shapes (K, 1 + n_u), (S, 1 + n_u); and the modes. Of the start, at which what happens is of the start, only
        the last row counts.
    """
    first, all_of = np.flatnonzero(np.diff(t) <= 0), np.column_stack([t, u])
    last = (mode[first + 1] <= KEPT) | (t[first] <= 0)
    stays, later = np.ones(len(t), bool), t[first] > 0
    stays[np.where(last, first, first + 1)] = False
    mode = np.where(mode <= KEPT, KEPT - mode, mode)
    return stays, all_of[first[~last] + 1], all_of[first[last & later]], mode


JUST_BEFORE = 2 * NEAR  # [s]: beside an edge by so much, what is given is that of the side


def keep_leads(
    leads: Array, applied: Callable[[Array, Array], Array], acting: Acting, held: Sequence[Array] = ()
) -> Array:
    """Commands right before rows, and what acts there of them and beside them.

    Args:
        leads: (t, u), shape (S, 1 + n_u).
        applied: the input that acts at times [s] under commands, of any width.
        acting: what acts.
        held: hold state and event function there, of a controller that has them; shapes (S, n̂), (S, 1).

    Returns:
        (t, u, applied, pushed, *held), of the last three what there is; (0, 0) if there are no rows.
    """
    if not len(leads):
        return np.zeros((0, 0))
    earlier = leads[:, 0] - JUST_BEFORE
    return np.hstack([leads, applied(earlier, leads[:, 1:]), acting.pushes.size(earlier), *held])


def lead_jumps(leads: Array, jumps: Array, t: Array, u: Array, edges: Array) -> Array:
    """With them what is right before events and switches on an edge, whose rows contain what is between the two.

    Args:
        leads, jumps: (t, u) right before some rows and right after others, shapes (S, 1 + n_u), (K, 1 + n_u).
        t, u: times of the rows [s], rising, and their commands, shapes (N,), (N, n_u).
        edges: [s], rising.
    """
    if not len(jumps):
        return leads
    rows = np.flatnonzero(np.isin(t, jumps[:, 0]) & has_instants(t, edges) & ~np.isin(t, leads[:, 0]))
    found = np.vstack([leads, np.column_stack([t, u])[rows]])
    return found[np.argsort(found[:, 0], kind="stable")]


def lead_rows(
    controller: Controller, t: Array, x_o: Array, x_h: Array, events: Array, edges: Array
) -> tuple[Array, tuple[Array, Array]]:
    """What observer and hold are right before actions and edges, whose rows contain what is after.

    Between two rows the hold goes on by itself. An observer does not jump, but for the set-point that it knows.

    Args:
        controller: the controller.
        t: times of the rows [s], rising, shape (N,).
        x_o, x_h: observer and hold at the rows, the set-point included, shapes (N, n̂ + R).
        events, edges: times of each [s], rising.

    Returns:
        (t, u), shape (S, 1 + n_u), and hold state and event function, shapes (S, n̂), (S, 1).
    """
    n, delay, setpoint = controller.plant.n, controller.delay.t_d, controller.setpoint
    actions = np.append(0.0, events) + delay if delay else np.zeros(0)
    rows = np.flatnonzero(has_instants(t, np.concatenate([actions, edges])))
    rows = rows[t[rows] > NEAR]
    acts, before = has_instants(t[rows], actions), x_o[rows].copy()
    if setpoint:
        before[:, n:] = setpoint(t[rows] - JUST_BEFORE)
    if controller.trigger.holds:
        held, last = x_h[rows].copy(), np.searchsorted(t, t[rows[acts]] - NEAR) - 1
        held[acts] = propagate(controller.model[1].A_h, x_h[last], t[rows[acts]] - t[last])
    else:
        held = before
    kept = keep_rows(controller, before, held)
    return np.column_stack([t[rows], kept.u]), (kept.x_h, kept.E[:, None])


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


def collect_controls(
    law: Law, plant: LinearPlant, settings: Settings, rows: ControllerRows, mode: np.ndarray
) -> dict[str, Any]:
    """Fields of a run of ``plant`` that are its controller's: its kind, and what it was at the rows."""
    real, names = law.realisation, tuple(mode.name for mode in law.realisation.modes)
    found: dict[str, Any] = {"mode": mode.astype(np.int64), "modes": names} if len(names) > 1 else {}
    found |= {"control": law.kind, "delay": get_delay(real), "least": get_least_interval(real), "noisy": settings.noisy}
    return {**found, **vars(rows), "labels": make_labels(plant, law.plant if rows.x_o.size else None)}


def collect_drives(controller: Law, acting: Acting, t: Array) -> dict[str, Any]:
    """Optional fields of a run at its rows: the set-point, pushes, and when what is given jumps."""
    pushes, end, edges = acting.pushes, float(t[-1]), list_edges(acting, controller)
    pushed = {"pushes": pushes.places, "pushed": pushes.size(snap_rows(t, edges))} if len(pushes) else {}
    return {"setpoint": controller.setpoint, "edges": edges[edges <= end + NEAR], **pushed}
