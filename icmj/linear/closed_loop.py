"""The closed loop between events as one linear system in z = (x, d, e), plus disturbance and errors of the outputs.

d = x_o − T̂x is the observer's error and e = x_h − x_o the hold error. With e as a state the reset x_h := x_o is e := 0,
and E = eᵀQ_t e − q_t² is free of cancellation; with d as a state an exact model stays exact (no round-off of x leaks
into d), so that the interval can grow without bound as it should.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from icmj.base.array import Array
from icmj.controller.controller import Controller
from icmj.controller.layout import Layout
from icmj.controller.trigger import Faces
from icmj.errors import SimulationError
from icmj.linear.propagator import Propagator
from icmj.plant.linear_plant import LinearPlant, transformation
from icmj.simulation.disturbance import Disturbance


@dataclass(frozen=True, eq=False)
class LinearLoop:
    """Plant, observer and hold between events: ż = M z + disturbance, z = (x, d, e) (eqs. sys, obs, hold).

    Attributes:
        plant: the actual plant.
        controller: design, hold and trigger. Under continuous control e stays zero.
        T_hat: T̂, states of the same name matched, shape (n̂, n).
        M: shape (n + 2n̂, n + 2n̂).
        faces: of the event rule; none for a clock or continuous control.
    """

    plant: LinearPlant
    controller: Controller
    T_hat: Array
    M: Array
    faces: Faces

    @property
    def n(self) -> int:
        """Number of states of the actual plant."""
        return self.plant.n

    @property
    def n_hat(self) -> int:
        """Number of states of the assumed plant."""
        return self.controller.design.plant.n

    @property
    def positions(self) -> np.ndarray:
        """Indices of the states that the limit guards: those with a ``<name>_rate`` beside them, else all."""
        states = self.plant.states
        return np.array([i for i, name in enumerate(states) if f"{name}_rate" in states] or range(self.n))

    @cached_property
    def layout(self) -> Layout:
        """The segments of z."""
        return Layout.of(x=self.n, d=self.n_hat, e=self.n_hat)

    def state(self, x: Array, x_o: Array, x_h: Array) -> Array:
        """z from (x, x_o, x_h)."""
        return self.layout.join(x=x, d=x_o - self.T_hat @ x, e=x_h - x_o)

    @cached_property
    def _segments(self) -> tuple[slice, slice, slice]:
        return self.layout["x"], self.layout["d"], self.layout["e"]

    def x(self, Z: Array) -> Array:
        """Plant state, last axis; any leading shape."""
        return Z[..., self._segments[0]]

    def x_o(self, Z: Array) -> Array:
        """Observer state."""
        return Z[..., self._segments[1]] + self.x(Z) @ self.T_hat.T

    def e(self, Z: Array) -> Array:
        """Hold error e_hp = x_h − x_o."""
        return Z[..., self._segments[2]]

    def x_h(self, Z: Array) -> Array:
        """Hold state."""
        return self.x_o(Z) + self.e(Z)

    def reset(self, z: Array, x_h: Array | None = None) -> Array:
        """z right after x_h was set to a prediction, or to x_o."""
        after = z.copy()
        after[self._segments[2]] = 0 if x_h is None else x_h - self.x_o(z)
        return after


def closed_loop(plant: LinearPlant, controller: Controller) -> LinearLoop:
    """Build the closed loop of ``plant`` under ``controller``; their orders may differ.

    Raises:
        SimulationError: if inputs or outputs of plant and assumed plant differ in number.
    """
    design, assumed = controller.design, controller.design.plant
    if (plant.n_u, plant.n_y) != (assumed.n_u, assumed.n_y):
        raise SimulationError(
            f"the plant has {plant.n_u} inputs and {plant.n_y} outputs, the controller's model "
            f"{assumed.n_u} and {assumed.n_y}; they must agree"
        )
    k, L, T = design.k, design.L, transformation(assumed, plant)
    B_k, B_tilde_k = plant.B @ k, (assumed.B - T @ plant.B) @ k
    C_tilde = assumed.C @ T - plant.C
    plant_row = np.hstack([plant.A - B_k @ T, -B_k, -B_k])
    observer_row = np.hstack(
        [assumed.A @ T - T @ plant.A - B_tilde_k @ T - L @ C_tilde, design.A_o - B_tilde_k, -B_tilde_k]
    )
    if not controller.trigger.holds:
        error_row = np.zeros((assumed.n, plant.n + 2 * assumed.n))
    else:
        # e' = A_h x_h − x_o'; the first difference is exactly zero for the system-matched hold
        A_h = controller.hold.A_h
        H = A_h - design.A_c
        error_row = np.hstack([H @ T + L @ C_tilde, H + L @ assumed.C, A_h + assumed.B @ k])
    M = np.vstack([plant_row, observer_row, error_row])
    return LinearLoop(plant, controller, T, M, controller.trigger.faces(design))


@dataclass(frozen=True, eq=False)
class Stretch:
    """A stretch of time in which the same terms of disturbance and errors act.

    Attributes:
        start, end: [s].
        propagator: of z followed by two oscillator states for each acting term, a cos(ωt + φ) and a sin(ωt + φ).
        amplitude, omega, phase: of these terms.
    """

    start: float
    end: float
    propagator: Propagator
    amplitude: Array
    omega: Array
    phase: Array

    def augmented(self, z: Array, t: float) -> Array:
        """z with the oscillators' states at ``t``."""
        angle = self.omega * t + self.phase
        return np.concatenate([z, self.amplitude * np.cos(angle), self.amplitude * np.sin(angle)])


def stretches(loop: LinearLoop, disturbance: Disturbance, errors: Disturbance, duration: float) -> list[Stretch]:
    """The run from 0 to ``duration`` cut where a term switches; those that act become oscillators.

    Args:
        loop: the closed loop.
        disturbance: on the plant's inputs.
        errors: of its outputs as the observer reads them.
        duration: [s].
    """
    x, d, e = (loop.layout[name] for name in ("x", "d", "e"))
    B, L = np.zeros((len(loop.M), disturbance.n_u)), np.zeros((len(loop.M), errors.n_u))
    # the observer does not know of the disturbance: x_o is not driven, hence d = x_o − T̂x is
    B[x], B[d] = loop.plant.B, -loop.T_hat @ loop.plant.B
    # an error drives x_o, hence e = x_h − x_o against it; without a hold e stays zero
    L[d] = loop.controller.design.L
    if loop.controller.trigger.holds:
        L[e] = -loop.controller.design.L
    edges = np.union1d(disturbance.edges, errors.edges)
    edges = np.concatenate([[0.0], edges[edges < duration], [duration]])
    result = []
    for start, end in pairwise(float(t) for t in edges):
        chosen = [(terms.start <= start) & (start < terms.end) for terms in (disturbance, errors)]

        def acting(name: str, chosen: list[np.ndarray] = chosen) -> Array:
            values = [getattr(terms, name)[here] for terms, here in zip((disturbance, errors), chosen, strict=True)]
            return np.concatenate(values)

        drive = np.hstack([B[:, disturbance.input[chosen[0]]], L[:, errors.input[chosen[1]]]])
        omega = acting("omega")
        flow = Propagator(loop.M, drive=drive, omega=omega)
        result.append(Stretch(start, end, flow, acting("amplitude"), omega, acting("phase")))
    return result
