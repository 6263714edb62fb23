"""Maps from event to event: the return map of the event-driven rule, linearised at an orbit, and the clock's.

From one event to the next x̄ ↦ φ(Δ(x̄)) x̄, with Δ(x̄) given by E = 0. On a mirrored orbit (λ = −1) the map takes
x̄* to −x̄*; it is odd, so its derivative at −x̄* is the same J, and two intervals have J². The multipliers given are
those of J, for one interval, in both cases: the orbit is attracting iff every one is inside the unit circle. One is
always zero, because the state after an event lies on the image of the surface E = 0 (docs/theory.md).
Under a clock the map is linear, also where the clock is faster than the delay.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from icmj.base.array import Array, falling
from icmj.controller.closed_loop import compose
from icmj.controller.controller import Controller
from icmj.controller.trigger import EventRule
from icmj.plant.linear_plant import LinearPlant
from icmj.theory.error_system import ErrorSystem
from icmj.theory.flow import Flow, flow
from icmj.theory.orbit import Orbit


def jacobian(system: ErrorSystem, trigger: EventRule, orbit: Orbit, *, prepared: Flow | None = None) -> Array:
    """J = φ − (𝔗A_D Ā_C X⁻)(g e^{Ā_CΔ}𝔗̄)/(g Ā_C X⁻), with g the gradient of E at X⁻, shape (n + n̂, n + n̂).

    For the paper's rule g = 2X⁻ᵀM with M = 𝔗_tᵀQ_t𝔗_t; in general it is the gradient on the active face.

    NaN throughout where E grazes zero at the event (E' = 0): the map has no derivative there.
    """
    e_A = (prepared or flow(system.A_C)).exponential(orbit.delta - system.delay.t_d)
    X = e_A @ (system.entry @ orbit.x_bar)
    gradient = trigger.faces(system.design).gradient(system.T_t @ X) @ system.T_t
    velocity = system.A_C @ X
    slope = gradient @ velocity
    if not abs(slope) > 1e-13 * np.linalg.norm(gradient) * np.linalg.norm(velocity):
        return np.full((len(system.exit),) * 2, np.nan)
    flight = e_A @ system.entry
    return system.exit @ flight - np.outer(system.exit @ velocity, gradient @ flight) / slope


def multipliers(J: Array) -> NDArray[np.complex128]:
    """Eigenvalues of J by falling magnitude, shape (n + n̂,)."""
    values = np.linalg.eigvals(J).astype(complex)
    return values[falling(np.abs(values), values.real, values.imag)]


def clocked_map(plant: LinearPlant, controller: Controller) -> Array:
    """Matrix from (x, a) right after one event to (x, a) right after the next, shape (n + N_a, n + N_a).

    Args:
        plant: the actual plant.
        controller: with a clock; a its states, predictions under way included.
    """
    loop = compose(plant, controller)
    interval, delay = controller.trigger.clock, controller.delay
    if not delay:
        return np.asarray(loop.J @ expm(loop.F * interval))
    # of the events under way one acts in each interval; where the delay is a multiple of it, just before the next event
    acts = delay.t_d - (delay.in_flight(interval) - 1) * interval
    rest = max(interval - acts, 0.0)
    return np.asarray(loop.J @ expm(loop.F * rest) @ loop.G @ expm(loop.F * acts))


def is_stable(plant: LinearPlant, controller: Controller) -> bool:
    """Whether every eigenvalue of the clock-driven loop lies inside the unit circle.

    Predictions are remembered, so that some are zero; none can be one that nothing sees.
    """
    return bool(np.abs(np.linalg.eigvals(clocked_map(plant, controller))).max() < 1)
