"""The intermittent controller: design, hold and trigger, and its states (paper, section 2.2).

u = −k̂ x_h; between events x_h follows the hold, at an event x_h := x_o. The observer runs continuously. An *event* is
an instant at which the controller takes new feedback; an event rule or a clock determines it. With a delay
(:mod:`icmj.controller.delay`) the event only makes a prediction, and the *action* follows later: x_h := the
prediction.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any, cast

import numpy as np

from icmj.base.array import Array
from icmj.controller.delay import LEAST, NO_DELAY, Delay
from icmj.controller.design import Design
from icmj.controller.hold import Hold
from icmj.controller.law import Law, expect_part, expect_setpoint
from icmj.controller.layout import Layout
from icmj.controller.model_prediction import make_predictor
from icmj.controller.realisation import Mode, Rates, Realisation
from icmj.controller.setpoint import Setpoint
from icmj.controller.trigger import ClockTrigger, Continuous, EventRule, Faces, Kind, Trigger, record_trigger
from icmj.errors import AnalysisError
from icmj.plant.linear_plant import LinearPlant


@dataclass(frozen=True, eq=False)
class Controller(Law):
    """The intermittent controller: everything that the closed loop needs besides the plant.

    Attributes:
        sampling_delay: time d_s from the instant at which the event rule reaches its threshold to the event, at which
            the state is sampled [s]. Δ_min counts from threshold to threshold, and the rule is evaluated again after
            the action.

    Raises:
        AnalysisError: on construction, if a part has the wrong class, the sizes of hold and design differ, continuous
            control is combined with a delay, or a sampling delay is negative, not finite, or given without an event
            rule.
    """

    design: Design
    hold: Hold
    trigger: Trigger
    delay: Delay = NO_DELAY
    setpoint: Setpoint | None = None
    sampling_delay: float = 0.0
    observed = True

    def __post_init__(self) -> None:
        expect_part(self.design, Design)
        expect_part(self.hold, Hold, ", such as that of system_matched")
        expect_part(self.trigger, Trigger, ", such as EventTrigger")
        expect_part(self.delay, Delay)
        self.hold.expect_fit(self.design)
        expect_setpoint(self.setpoint, self.plant)
        if self.delay and not self.trigger.holds:
            raise AnalysisError(
                "continuous control has no events whose action could be delayed; take a ClockTrigger of a small "
                "interval, which is the continuous predictor controller in the limit"
            )
        d_s = self.sampling_delay
        if d_s and not (isinstance(d_s, int | float) and (LEAST <= d_s < np.inf)):
            raise AnalysisError(f"the sampling delay must be 0 or at least {LEAST:g} s, and finite, got {d_s}")
        if d_s and self.kind != "event":
            raise AnalysisError(
                f"a sampling delay of {d_s:g} s follows the threshold of an event rule, and a trigger of kind "
                f"{self.kind!r} has none; leave it out"
            )

    @property
    def plant(self) -> LinearPlant:
        """The plant for which it was designed."""
        return self.design.plant

    @property
    def kind(self) -> Kind:
        """The kind of its trigger: ``event``, ``clock`` or ``continuous``."""
        return self.trigger.kind

    @property
    def event_rule(self) -> EventRule | None:
        """Its trigger, if that is an event rule."""
        return self.trigger if isinstance(self.trigger, EventRule) else None

    def facts(self) -> Mapping[str, Any]:
        """The facts of its trigger, and the delay."""
        sampling = {"sampling_delay": self.sampling_delay} if self.sampling_delay else {}
        return {**self.trigger.facts(), "delay": self.delay.t_d, **sampling}

    @property
    def least(self) -> float:
        """The shortest time between two events [s]: the refractory period Δ_min, or a longer delay; 0 for a clock."""
        return 0.0 if np.isfinite(self.trigger.clock) else self.sampling_delay + self.wait

    @property
    def wait(self) -> float:
        """Time from an event until the event rule is evaluated again [s]; exactly t_d if t_d is longer than Δ_min."""
        return max(self.trigger.delta_min - self.sampling_delay, self.delay.t_d)

    @cached_property
    def faces(self) -> Faces:
        """Faces of the event rule on the difference of hold and observer, for the states of :attr:`model`."""
        faces = self.trigger.faces(self.design)
        return self.setpoint.faces(faces) if self.setpoint else faces

    @cached_property
    def model(self) -> tuple[Design, Hold]:
        """Design and hold of the model that they run: the assumed plant, extended by the set-point if there is one."""
        return self.setpoint.model(self.design, self.hold) if self.setpoint else (self.design, self.hold)

    @cached_property
    def realisation(self) -> Realisation:
        """A linear system with resets (paper, eqs. obs, hold, u); AnalysisError if the trigger does not fit."""
        return _realise_states(self)

    def to_record(self) -> Law:
        """The controller as a log keeps it: of an event rule that is not of icmj, its faces."""
        return self.triggered_by(record_trigger(self.trigger, self.design))

    def triggered_by(self, trigger: Trigger) -> Controller:
        """The same controller with another trigger; a sampling delay is kept only with an event rule."""
        return replace(self, trigger=trigger, sampling_delay=self.sampling_delay if trigger.kind == "event" else 0.0)


def expect_intermittent(law: Law) -> Controller:
    """The controller as one of design, hold and trigger.

    Raises:
        AnalysisError: if it is another.
    """
    if not law.observed:
        raise AnalysisError(f"a {law.kind} controller has no design, hold and trigger")
    return cast(Controller, law)


def make_layout(controller: Controller) -> Layout:
    """The controller's states: what the observer knows, the hold, and with a delay the predictions still to act."""
    n = controller.model[0].plant.n
    slots = controller.delay.in_flight(controller.trigger.clock)
    return Layout.of(x_o=n, x_h=n, **({"pending": slots * n} if slots else {}))


def start_state(controller: Controller, x_o: Array, x_h: Array) -> Array:
    """The controller's state right after an event at which observer and hold were there; shape (N_a,).

    Without a delay the caller has reset the hold, or not, as it likes. With one, the event is taken up here.

    Raises:
        AnalysisError: if the trigger does not fit the design.
    """
    layout = make_layout(controller)
    if controller.setpoint:
        x_o, x_h = (np.append(x, controller.setpoint(0.0)) for x in (x_o, x_h))
    if "pending" not in layout.names:
        return layout.join(x_o=x_o, x_h=x_h)
    from scipy.linalg import expm

    # predictions that would change nothing: where the hold will be by itself
    times = _expect_actions(controller)
    slots = controller.delay.in_flight(controller.trigger.clock)
    idle = [expm(controller.model[1].A_h * t) @ x_h for t in times]
    pending = np.concatenate([np.zeros((slots - len(idle)) * len(x_h)), *idle])
    a = layout.join(x_o=x_o, x_h=x_h, pending=pending)
    return np.asarray(controller.realisation.J @ a)


def continuous_limit(controller: Controller, clock: float = 0.0) -> Trigger:
    """The trigger of continuous control, used for comparison; with a delay, a clock of a twentieth of it.

    ``clock`` is the interval of one [s] where there must be a hold; 0 elsewhere.
    """
    clock = controller.delay.t_d / 20 or clock
    return ClockTrigger(clock) if clock else Continuous()


def _realise_states(controller: Controller) -> Realisation:
    (design, hold), layout, trigger = controller.model, make_layout(controller), controller.trigger
    o, h, n_y, r = layout["x_o"], layout["x_h"], design.plant.n_y, design.plant.n - controller.plant.n
    M, K = np.zeros((layout.size, layout.size)), np.zeros((design.plant.n_u, layout.size))
    N, J, G = np.zeros((layout.size, n_y + r)), np.eye(layout.size), np.eye(layout.size)
    A, B, H = np.zeros_like(M), np.zeros((layout.size, design.plant.n_u)), np.zeros((n_y + r, layout.size))
    M[o, o], N[o, :n_y], N[o.stop - r : o.stop, n_y:] = design.A_o, design.L, np.eye(r)
    A[o, o], B[o], H[:n_y, o] = design.plant.A, design.plant.B, design.plant.C
    if trigger.holds:
        M[o, h], M[h, h], K[:, h] = -design.plant.B @ design.k, hold.A_h, design.k
        # the system-matched hold is the model under the command, and nothing beside it
        A[h, h], B[h] = design.plant.A + (hold.A_h - design.A_c), design.plant.B
        if controller.delay:
            _add_delay(controller, layout, J, G)
        else:
            J[h] = np.eye(layout.size)[o]
    else:
        # x_h runs along with x_o, so that what is recorded as the hold state is the observer's
        M[o, o] -= design.plant.B @ design.k
        M[h, o], N[h], K[:, o] = M[o, o], N[o], design.k
        A[h, o], B[h] = A[o, o], B[o]
    faces = controller.faces
    R = np.zeros((len(faces.R), layout.size))
    R[:, o], R[:, h] = -faces.R, faces.R
    mode = Mode(trigger.kind, M, N, K, np.zeros((design.plant.n_u, n_y + r)), Rates(A, B, N, H))
    signals = controller.setpoint.terms if controller.setpoint else np.zeros((0, 6))
    return Realisation(
        layout, (mode,), J, G, R, faces.cuts, controller.delay.t_d, signals=signals, wait=controller.wait,
        clock=trigger.clock, sampling=controller.sampling_delay,
    )  # fmt: skip


def _expect_actions(controller: Controller) -> list[float]:
    """Times from a clock event until the controller expects the earlier predictions to act, oldest first [s]."""
    clock, delay = controller.trigger.clock, controller.delay
    return delay.expected([i * clock for i in range(delay.in_flight(clock) - 1, 0, -1)])


def _add_delay(controller: Controller, layout: Layout, J: Array, G: Array) -> None:
    """Resets with a delay: an event appends its prediction to the queue, and an action applies the oldest."""
    n, pending, trigger = layout.sizes[0], layout["pending"].start, controller.trigger
    slots = controller.delay.in_flight(trigger.clock)
    places = [slice(pending + i * n, pending + (i + 1) * n) for i in range(slots)]
    before = np.eye(layout.size)
    for place, following in pairwise(places):
        J[place] = before[following]
    times = _expect_actions(controller)
    E_p = make_predictor(*controller.model, controller.delay.predicted, times)
    inputs = [layout["x_o"], layout["x_h"], *places[slots - len(times) :]]
    J[places[-1]] = sum(E_p[:, i * n : (i + 1) * n] @ before[place] for i, place in enumerate(inputs))
    G[layout["x_h"]] = before[places[0]]
