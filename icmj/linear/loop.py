"""The closed loop of a linear plant in the form for simulation, w = (x, d, e, p), and its exogenous inputs.

d = x_o − T̂x is the observer's error and e = x_h − x_o the hold error; p are predictions under way. With e as a state
the reset x_h := x_o is e := 0, and E = eᵀQ_t e − q_t² is free of cancellation; with d as a state an exact model stays
exact (no round-off of x leaks into d), so that the interval can grow without bound as it should.

Noise d = ξ(t) u whose size is a share of the command u = −k̂ x_h is exact, too, because the hold moves by itself and ξ
is straight between the points of its grid: p = ξ x_h and q = ξ' x_h, the *products*, follow ṗ = A_h p + q and q̇ = A_h
q from values that are set anew at every point and after every jump of the hold. They are states of the loop.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from icmj.base.array import Array
from icmj.controller.closed_loop import CHAIN, ClosedLoop, compose
from icmj.controller.controller import Controller
from icmj.controller.layout import Layout
from icmj.plant.activation import is_activation
from icmj.plant.linear_plant import LinearPlant
from icmj.simulation.disturbance import Disturbance, Pushes
from icmj.simulation.readings import expect_ports


@dataclass(frozen=True, eq=False)
class LinearLoop:
    """A composed loop, with views of its state; Z holds the moving part z = (x, d, e) of w in its last axis.

    Attributes:
        composed: in the coordinates of :data:`icmj.controller.closed_loop.CHAIN`, with the products of noises and
            hold, p and q of the first and so on, as a segment ``products`` if there are any.
    """

    composed: ClosedLoop

    @property
    def plant(self) -> LinearPlant:
        """The actual plant."""
        return self.composed.plant

    @property
    def controller(self) -> Controller:
        """Design, hold, trigger and delay."""
        return self.composed.controller

    @cached_property
    def moving(self) -> int:
        """Length m of z; what follows in w are predictions, which no rate moves."""
        layout = self.composed.layout
        return layout.size - (layout.sizes[-1] if layout.names[-1] == "pending" else 0)

    @property
    def M(self) -> Array:
        """ż = M z, shape (m, m)."""
        return self.composed.F[: self.moving, : self.moving]

    @property
    def positions(self) -> np.ndarray:
        """Indices of the states that the limit guards."""
        return find_positions(self.plant)

    def state(self, x: Array, a: Array) -> Array:
        """w from the states of plant and controller."""
        states = np.concatenate([x, a])
        if "products" in self.composed.layout.names:  # they are set where the motion goes on
            there = self.composed.layout["products"]
            states = np.insert(states, there.start, np.zeros(there.stop - there.start))
        return self.composed.coordinates.of_states(states)

    @property
    def held(self) -> Array:
        """x_h from z, shape (n̂, m)."""
        there = self.composed.layout["x_h"]
        rows = np.eye(self.composed.layout.size)[there]
        return np.ascontiguousarray(self.composed.coordinates.on_w(rows)[:, : self.moving])

    def x(self, Z: Array) -> Array:
        """Plant state, last axis; any leading shape."""
        return Z[..., self.composed.layout["x"]]

    def x_o(self, Z: Array) -> Array:
        """Observer state."""
        return Z[..., self.composed.layout["x_o"]] + self.x(Z) @ self.composed.coordinates.T_hat.T

    def e(self, Z: Array) -> Array:
        """Hold error e_hp = x_h − x_o."""
        return Z[..., self.composed.layout["x_h"]]

    def x_h(self, Z: Array) -> Array:
        """Hold state."""
        return self.x_o(Z) + self.e(Z)


def find_positions(plant: LinearPlant) -> np.ndarray:
    """Indices of the states that a limit guards: those with a ``<name>_rate`` beside them, else all but activations."""
    states = plant.states
    moving = [i for i, name in enumerate(states) if not is_activation(name, plant.inputs)]
    return np.array([i for i in moving if f"{states[i]}_rate" in states] or moving, dtype=int)


def make_linear_loop(plant: LinearPlant, controller: Controller, shares: Sequence[int] = ()) -> LinearLoop:
    """The closed loop of ``plant`` under ``controller``; their orders may differ.

    ``shares`` are the inputs of noises whose size is a share of the command.

    Raises:
        SimulationError: if inputs or outputs of plant and assumed plant differ in number.
    """
    expect_ports(controller, plant)
    composed = compose(plant, controller, CHAIN)
    return LinearLoop(_with_products(composed, shares) if len(shares) else composed)


def _with_products(loop: ClosedLoop, shares: Sequence[int]) -> ClosedLoop:
    """The loop with the products of these noises, each on the input of this number, behind the moving part."""
    design, hold = loop.controller.model
    n, layout = len(hold.A_h), loop.layout
    first = layout["pending"].start if "pending" in layout.names else layout.size
    more, place = 2 * n * len(shares), layout.names.index("pending") if "pending" in layout.names else len(layout.names)
    at = np.r_[:first, first + more : layout.size + more]  # of what has been there before
    names, sizes = ((*of[:place], new, *of[place:]) for of, new in ((layout.names, "products"), (layout.sizes, more)))
    square = np.ix_(at, at)
    F, J, G = np.zeros((layout.size + more,) * 2), np.eye(layout.size + more), np.eye(layout.size + more)
    F[square], J[square], G[square] = loop.F, loop.J, loop.G
    D, E = np.zeros((len(F), loop.D.shape[1])), np.zeros((len(F), loop.E.shape[1]))
    D[at], E[at] = loop.D, loop.E
    K, R = np.zeros((len(loop.K), len(F))), np.zeros((len(loop.R), len(F)))
    K[:, at], R[:, at] = loop.K, loop.R
    for number, index in enumerate(shares):
        p = slice(first + 2 * n * number, first + 2 * n * number + n)
        q = slice(p.stop, p.stop + n)
        F[:, p] = -np.outer(D[:, index], design.k[index])
        F[p, p] = F[q, q] = hold.A_h
        F[p, q] = np.eye(n)
    coordinates = replace(loop.coordinates, layout=Layout(names, sizes))
    return replace(loop, coordinates=coordinates, F=F, D=D, E=E, K=K, J=J, G=G, R=R)


@dataclass(frozen=True, eq=False, kw_only=True)
class Forcing(Disturbance):
    """The exogenous input on z: a disturbance whose inputs are S signals, and whose terms are ordered by them.

    Attributes:
        D: what each signal does to ż, shape (m, S).
    """

    D: Array


def make_forcing(loop: LinearLoop, disturbance: Disturbance, errors: Disturbance, pushes: Pushes) -> Forcing:
    """All exogenous inputs as one: added to the commands, on the plant itself, and on the outputs as read.

    Raises:
        SimulationError: if the plant does not know what is pushed.
    """
    E_p = np.zeros((len(loop.composed.F), len(pushes.places)))
    for column, push in enumerate(pushes.places):
        E_p[: loop.plant.n, column] = loop.plant.effect(push)
    pushed = loop.composed.coordinates.of_states(E_p)
    acting = (disturbance, errors, pushes.size)
    effects = np.hstack([loop.composed.D, loop.composed.E, pushed])[: loop.moving]
    first = np.cumsum([0, disturbance.n_u, errors.n_u])
    ports = np.concatenate([at + of.input for at, of in zip(first, acting, strict=True)]).astype(np.int64)
    drawn = [(at + index, noise) for at, of in zip(first, acting, strict=True) for index, noise in of.gaussian]
    used = np.unique(np.concatenate([ports, np.array([port for port, _ in drawn], dtype=np.int64)]))
    signal = np.searchsorted(used, ports)
    terms, order = ("amplitude", "omega", "phase", "start", "end"), np.argsort(signal, kind="stable")
    amplitude, omega, phase, start, end = (
        np.concatenate([getattr(of, name) for of in acting])[order] for name in terms
    )
    gaussian = tuple((int(np.searchsorted(used, port)), noise) for port, noise in drawn)
    D = np.ascontiguousarray(effects[:, used])
    return Forcing(len(used), signal[order], amplitude, omega, phase, start, end, gaussian, D=D)
