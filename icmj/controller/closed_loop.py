"""The closed loop of a linear plant and a controller as one linear system with resets.

Between events

    ẇ = F w + D d(t) + E n(t),      u = −K w,      y = C x

with d on the plant's inputs, which the controller does not know, and n an error of its readings, or a signal that it is
given. An event sets w := J w, its action w := G w, and the event rule's faces are |R_j w| = 1.

*Coordinates.* The states are x and the segments of the controller's state, each as it is or counted from another:
:data:`ORIGINAL` is (x, x_o, x_h), :data:`ERRORS` the paper's (x, x_o − T̂x, x_h − T̂x), and :data:`CHAIN` is
(x, x_o − T̂x, x_h − x_o), in which the reset x_h := x_o is e := 0 and an exact model leaves the observer's error alone.
Such zeros are exact: differences are taken of the parts of a rate (:class:`icmj.controller.realisation.Rates`) before
anything is multiplied out, so that what is equal cancels and leaves no rounding.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from icmj.base.array import Array
from icmj.controller.controller import Controller
from icmj.controller.layout import Layout
from icmj.plant.linear_plant import LinearPlant, transformation

ORIGINAL: Mapping[str, str] = {}
ERRORS: Mapping[str, str] = {"x_o": "x", "x_h": "x"}
CHAIN: Mapping[str, str] = {"x_o": "x", "x_h": "x_o"}


@dataclass(frozen=True, eq=False)
class Coordinates:
    """Coordinates of the closed loop: the segments of (x, a) that are expressed relative to other segments.

    Attributes:
        layout: of (x, a), and of w.
        origin: name of the segment that a segment is counted from, by its name; x stands for T̂x.
        T_hat: T̂, shape (n̂, n).
    """

    layout: Layout
    origin: Mapping[str, str]
    T_hat: Array

    def of_states(self, states: Array) -> Array:
        """w from (x, a), or the rows of a map to w from those of a map to (x, a); along the first axis."""
        w = np.array(states, dtype=float)
        for name, origin in self.origin.items():
            there = states[self.layout[origin]]
            w[self.layout[name]] = states[self.layout[name]] - (self.T_hat @ there if origin == "x" else there)
        return w

    def on_w(self, rows: Array) -> Array:
        """Rows that act on w from rows that act on (x, a), shape (r, N)."""
        turned = np.array(rows, dtype=float)
        outwards = sorted(self.origin.items(), key=lambda pair: pair[1] != "x")  # origins come first
        for name, origin in reversed(outwards):
            here = turned[:, self.layout[name]]
            turned[:, self.layout[origin]] += here @ self.T_hat if origin == "x" else here
        return turned


@dataclass(frozen=True, eq=False)
class ClosedLoop:
    """See the module; N states, of which the last that no rate moves are predictions under way.

    Attributes:
        plant, controller: what it is composed of.
        coordinates: of w.
        F: shape (N, N).
        D, E: shapes (N, n_u), (N, n_v), with columns of E for readings and signals of the controller.
        K: shape (n_u, N).
        J, G: shape (N, N).
        R: shape (r, N); ``cuts`` as in :class:`icmj.controller.realisation.Realisation`.
    """

    plant: LinearPlant
    controller: Controller
    coordinates: Coordinates
    F: Array
    D: Array
    E: Array
    K: Array
    J: Array
    G: Array
    R: Array
    cuts: np.ndarray

    @property
    def layout(self) -> Layout:
        """The segments of w."""
        return self.coordinates.layout


def compose(
    plant: LinearPlant, controller: Controller, origin: Mapping[str, str] = ORIGINAL, T_hat: Array | None = None
) -> ClosedLoop:
    """The closed loop of ``plant`` under ``controller``, whose inputs and outputs are in the same order.

    Args:
        plant: the actual plant.
        controller: of which the realisation says how it moves.
        origin: the coordinates; one of :data:`ORIGINAL`, :data:`ERRORS` and :data:`CHAIN`.
        T_hat: T̂, shape (n̂, n); states of the same name are matched if ``None``.

    Raises:
        AnalysisError: if the trigger does not fit the design.
    """
    real, n, n_u = controller.realisation, plant.n, plant.n_u
    T_hat = transformation(controller.design.plant, plant) if T_hat is None else T_hat
    own, size = real.rates, real.layout.size
    # what the plant has no part in: further states of the controller, signals that it is given
    T_hat = np.pad(T_hat, ((0, real.layout.sizes[0] - len(T_hat)), (0, 0)))
    C = np.pad(plant.C, ((0, own.N.shape[1] - plant.n_y), (0, 0)))
    layout = Layout(("x", *real.layout.names), (n, *real.layout.sizes))
    at = Coordinates(layout, origin, T_hat)
    x, a = slice(0, n), slice(n, n + size)
    # of every state's rate: what it makes of itself, of u = −K a + d for the plant, of y + n − H a for the controller
    A, B, N = np.zeros((n + size, n + size)), np.zeros((n + size, n_u)), np.zeros((n + size, len(C)))
    A[x, x], A[a, a], B[x], B[a], N[a] = plant.A, own.A, plant.B, own.B, own.N
    D = np.vstack([plant.B, np.zeros((size, n_u))])
    K, innovation = np.zeros((n_u, n + size)), np.hstack([C, -own.H])
    K[:, a] = real.K
    K, innovation, N = at.on_w(K), at.on_w(innovation), at.of_states(N)
    with np.errstate(over="ignore", invalid="ignore"):  # what overflows is refused by the analysis
        F = at.on_w(at.of_states(A)) + N @ innovation - at.of_states(B) @ K

    def whole(jump: Array) -> Array:
        both = np.eye(n + size)
        both[a, a] = jump
        return at.on_w(at.of_states(both))

    R = np.zeros((len(real.R), n + size))
    R[:, a] = real.R
    return ClosedLoop(
        plant, controller, at, F, at.of_states(D), N, K, whole(real.J), whole(real.G), at.on_w(R), real.cuts
    )
