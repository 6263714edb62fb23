"""Maps from event to event: the return map of the event-driven rule, linearised at an orbit, and the clock's.

From one event to the next x̄ ↦ φ(Δ(x̄)) x̄, with Δ(x̄) given by E = 0. On a mirrored orbit (λ = −1) the map takes
x̄* to −x̄*; it is odd, so its derivative at −x̄* is the same J, and two intervals have J². The multipliers given are
those of J, for one interval, in both cases: the orbit is attracting iff every one is inside the unit circle. With a
delay one is zero, because the state at an event lies on the surface E = 0; without one the state is x̄, which leaves
out e_hp, and none need be zero (docs/theory.md).
Under a clock the map is linear, also where the clock is faster than the delay.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from icmj.base.array import Array, argsort_descending
from icmj.base.balancing import compute_exponential
from icmj.controller.closed_loop import compose
from icmj.controller.controller import Controller
from icmj.controller.hold import system_matched
from icmj.controller.trigger import EventRule
from icmj.plant.linear_plant import LinearPlant
from icmj.theory.error_system import ErrorSystem
from icmj.theory.flow import Flow, make_flow
from icmj.theory.orbit import Orbit, find_ties
from icmj.theory.reduction import Reduction

# events over which a deviation is followed before its growth is taken, and over which it is
_FOLLOWED = 200


def compute_jacobians(system: ErrorSystem, trigger: EventRule, orbit: Orbit, *, prepared: Flow | None = None) -> Array:
    """J on each of the faces that the orbit reaches together, the active one first; shape (F', n + n̂, n + n̂).

    J = φ − (𝔗A_D Ā_C X⁻)(g e^{Ā_CΔ}𝔗̄)/(g Ā_C X⁻), with g the gradient of E at X⁻: for the paper's rule g = 2X⁻ᵀM with
    M = 𝔗_tᵀQ_t𝔗_t; in general it is the gradient on the face. Beside an orbit that reaches several, the map is the J of
    the face that is reached first (:func:`compute_growth`).

    One of NaN throughout where E grazes zero at the event (E' = 0): the map has no derivative there.
    """
    e_A = (prepared or make_flow(system.A_C)).exponential(orbit.delta - system.delay.t_d)
    X = e_A @ (system.entry @ orbit.x_bar)
    faces, e = trigger.faces(system.design), system.T_t @ X
    velocity, flight = system.A_C @ X, e_A @ system.entry
    found = []
    for face in find_ties(faces.squares(faces.R @ e)):
        R = faces.R[faces.rows(int(face))]
        gradient = 2 * faces.unit * (R @ e) @ R @ system.T_t
        slope = gradient @ velocity
        if not abs(slope) > 1e-13 * (np.abs(gradient) @ np.abs(velocity)):
            return np.full((1, len(system.exit), len(system.exit)), np.nan)
        found.append(system.exit @ flight - np.outer(system.exit @ velocity, gradient @ flight) / slope)
    return np.array(found)


def compute_event_shift(system: ErrorSystem, orbit: Orbit, *, prepared: Flow | None = None) -> Array:
    """𝔗A_D Ā_C X⁻, by which the state at the event of an orbit moves for each second that it comes later."""
    e_A = (prepared or make_flow(system.A_C)).exponential(orbit.delta - system.delay.t_d)
    return np.asarray(system.exit @ (system.A_C @ (e_A @ (system.entry @ orbit.x_bar))))


def compute_growth(J: Array, shift: Array, sign: int) -> float:
    """The factor per event by which a deviation grows in the long run beside an orbit that reaches several faces.

    To first order, the face that is reached first deciding from event to event; over deviations in many directions.

    Args:
        J: on each face, shape (F', m, m); they differ by matrices of rank one, shift times a row.
        shift: :func:`compute_event_shift`, shape (m,).
        sign: of the orbit.
    """
    size = J.shape[1]
    earlier = -(shift @ (J - J[0])) / (shift @ shift)
    away = np.hstack([np.eye(size), -np.eye(size), np.random.default_rng(0).normal(size=(size, 2 * size))])
    total = np.zeros(away.shape[1])
    for step in range(2 * _FOLLOWED):
        first = (earlier @ away).argmax(axis=0)
        away = sign * np.einsum("ijk,ki->ji", J[first], away)
        length = np.maximum(np.linalg.norm(away, axis=0), np.finfo(float).tiny)
        away, total = away / length, total + np.log(length) * (step >= _FOLLOWED)
    return float(np.exp(total.max() / _FOLLOWED))


def is_still(R: Array, A_h: Array) -> bool:
    """Whether R x_h does not move between events, as with a zero-order hold."""
    return bool((np.abs(R @ A_h) <= 1e-12 * (np.abs(R) @ np.abs(A_h))).all())


def is_alternating(system: ErrorSystem, trigger: EventRule, orbit: Orbit, reduced: Reduction) -> bool:
    """Whether the mirrored orbit is one of a family of cycles of two unequal intervals, by the structure of the loop.

    Where what the rule sees of the hold stands still between events (a zero-order hold) and no delay is predicted, so
    that an action sets the hold to what the observer was at its event, the error at an event is what the observer has
    moved since the last. So over two intervals that close, the second event's error is minus the first's: one condition
    on the state at an event is met by itself, and J has the multiplier +1. Its left eigenvector is the gradient of E on
    x_o; along neutral modes that this sees there is drift.
    """
    if orbit.sign > 0 or system.delay.predicted or not np.isfinite(orbit.gamma):
        return False
    faces, A_h = trigger.faces(system.design), (system.hold or system_matched(system.design)).A_h
    one = np.eye(system.n_hat)
    x_o, e = np.hstack([system.T_hat, one, 0 * one]) @ system.lift, orbit.e_hp[-1]
    for face in find_ties(faces.squares(faces.R @ e)):
        R = faces.R[faces.rows(int(face))]
        if not is_still(R, A_h) or reduced.shown_by((R @ e)[None] @ R @ x_o).any():
            return False
    return True


def compute_multipliers(J: Array) -> NDArray[np.complex128]:
    """Eigenvalues of J by falling magnitude, shape (n + n̂,)."""
    values = np.linalg.eigvals(J).astype(complex)
    return values[argsort_descending(np.abs(values), values.real, values.imag)]


def compute_clocked_map(plant: LinearPlant, controller: Controller) -> Array:
    """Matrix from (x, a) right after one event to (x, a) right after the next, shape (n + N_a, n + N_a).

    Args:
        plant: the actual plant.
        controller: with a clock; a its states, predictions under way included.
    """
    loop = compose(plant, controller)
    interval, delay = controller.trigger.clock, controller.delay
    if not delay:
        return np.asarray(loop.J @ compute_exponential(loop.F * interval))
    # of the events under way one acts in each interval; where the delay is a multiple of it, just before the next event
    acts = delay.t_d - (delay.in_flight(interval) - 1) * interval
    rest = max(interval - acts, 0.0)
    return np.asarray(loop.J @ compute_exponential(loop.F * rest) @ loop.G @ compute_exponential(loop.F * acts))


def is_stable(plant: LinearPlant, controller: Controller) -> bool:
    """Whether every eigenvalue of the clock-driven loop lies inside the unit circle.

    Predictions are remembered, so that some are zero; none can be one that nothing sees.
    """
    return bool(np.abs(np.linalg.eigvals(compute_clocked_map(plant, controller))).max() < 1)
