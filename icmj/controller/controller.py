"""The intermittent controller: design, hold and trigger, and the states it runs with (paper, section 2.2).

u = −k̂ x_h; between events x_h follows the hold, at an event x_h := x_o. The observer runs all the time. An *event* is
an instant at which the controller takes up new feedback, whether an event rule, or a clock, decides when.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from icmj.base.array import Array
from icmj.controller.design import Design
from icmj.controller.hold import Hold
from icmj.controller.layout import Layout
from icmj.controller.trigger import Trigger
from icmj.errors import AnalysisError


@dataclass(frozen=True, eq=False)
class Controller:
    """Everything that the closed loop needs besides the plant.

    Raises:
        AnalysisError: on construction, if the trigger is none.
    """

    design: Design
    hold: Hold
    trigger: Trigger

    def __post_init__(self) -> None:
        if not isinstance(self.trigger, Trigger):
            raise AnalysisError(
                f"the controller's trigger is a {type(self.trigger).__name__}; expected a Trigger, such as EventTrigger"
            )

    def triggered_by(self, trigger: Trigger) -> Controller:
        """The same controller with another trigger."""
        return replace(self, trigger=trigger)


@dataclass(frozen=True, eq=False)
class Realisation:
    """A controller as one linear system with resets in its state a, which a simulator runs without knowing its parts.

    Attributes:
        layout: the segments of a.
        M, N: ȧ = M a + N y between events, shapes (N_a, N_a) and (N_a, n_y) (eqs. obs, hold).
        K: u = −K a, shape (n_u, N_a) (eq. u).
        J: a := J a at an event, shape (N_a, N_a) (eq. imp).
        R: the event function's faces are |R_j a| = 1, with R_j the rows between ``cuts``; shape (r, N_a) (eq. ED_e).
        cuts: first row of each face, and the number of rows; shape (f + 1,). No face: no event function.
    """

    layout: Layout
    M: Array
    N: Array
    K: Array
    J: Array
    R: Array
    cuts: np.ndarray


def layout_of(controller: Controller) -> Layout:
    """The controller's states: what the observer knows, and the hold."""
    n = controller.design.plant.n
    return Layout.of(x_o=n, x_h=n)


def realise(controller: Controller) -> Realisation:
    """The controller as a linear system with resets (paper, eqs. obs, hold, u).

    Raises:
        AnalysisError: if the trigger does not fit the design.
    """
    design, layout, trigger = controller.design, layout_of(controller), controller.trigger
    o, h = layout["x_o"], layout["x_h"]
    M, K = np.zeros((layout.size, layout.size)), np.zeros((design.plant.n_u, layout.size))
    N, J = np.zeros((layout.size, design.plant.n_y)), np.eye(layout.size)
    M[o, o], N[o] = design.A_o, design.L
    if trigger.holds:
        M[o, h], M[h, h], K[:, h] = -design.plant.B @ design.k, controller.hold.A_h, design.k
        J[h] = np.eye(layout.size)[o]
    else:
        # x_h runs along with x_o, so that what is recorded as the hold state is the observer's
        M[o, o] -= design.plant.B @ design.k
        M[h, o], N[h], K[:, o] = M[o, o], N[o], design.k
    faces = trigger.faces(design)
    R = np.zeros((len(faces.R), layout.size))
    R[:, o], R[:, h] = -faces.R, faces.R
    return Realisation(layout, M, N, K, J, R, faces.cuts)
