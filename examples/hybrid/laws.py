"""Five controllers of one's own that are hybrid linear systems: with memory, mixtures of delays, sums, and saturation.

Each is a class of a run file (``kind = "laws:Hysteresis"``) and of Python. The first argument is the assumed plant, the
second the delay of the run file; the others are parameters.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

import icmj
from icmj.controller import Guard, Layout, Mode, Realisation, parallel, step


@dataclass(frozen=True, eq=False)
class PlainPD(icmj.Law):
    """Proportional and derivative feedback of the current outputs: u = −P θ − D θ', without a delay and a state."""

    assumed: icmj.LinearPlant
    P: float = 900.0
    D: float = 300.0
    kind = "plain PD"

    @property
    def plant(self):
        return self.assumed

    def facts(self):
        return {"P": self.P, "D": self.D}

    @cached_property
    def realisation(self):
        n_y = self.assumed.n_y
        S = np.zeros((1, n_y))
        S[0, self.assumed.outputs.index("lean")] = self.P
        S[0, self.assumed.outputs.index("lean_rate")] = self.D
        mode = Mode("on", np.zeros((0, 0)), np.zeros((0, n_y)), np.zeros((1, 0)), S)
        none = np.zeros((0, 0))
        return Realisation(Layout.of(), (mode,), none, none, none, np.zeros(1, dtype=int), taps=(0.0,))


@dataclass(frozen=True, eq=False)
class Intermittent(icmj.Law):
    """What the others begin with: the intermittent controller with a linear-quadratic design and an event rule.

    Attributes:
        q_t: threshold of the hold error.
        R_c, R_o: weights of command and measurement.
    """

    assumed: icmj.LinearPlant
    delay: float
    q_t: float = 0.002
    R_c: float = 1e-5
    R_o: float = 1e-4
    kind = "intermittent"

    @property
    def plant(self):
        return self.assumed

    def facts(self):
        return {"q_t": self.q_t, "delay": self.delay}

    @cached_property
    def base(self):
        """The intermittent controller."""
        plant = self.assumed
        design = icmj.design_lq(plant, R_c=self.R_c, Q_o=plant.B @ plant.B.T, R_o=self.R_o)
        rule = icmj.EventTrigger(plant.C.T @ plant.C, self.q_t, delta_min=0.0)
        return icmj.Controller(design, icmj.system_matched(design), rule, icmj.Delay(self.delay), self.setpoint)

    @cached_property
    def realisation(self):
        return self.base.realisation


@dataclass(frozen=True, eq=False)
class Hysteresis(Intermittent):
    """An event rule with memory: it fires at q_t, and then not again before the hold error was below release · q_t.

    An error that grows instead fires at alarm · q_t.
    """

    release: float = 0.5
    alarm: float = 3.0
    kind = "hysteresis"

    def facts(self):
        return {**super().facts(), "release": self.release, "alarm": self.alarm}

    @cached_property
    def realisation(self):
        real = self.base.realisation
        n_v, N_a = real.N.shape[1], real.layout.size
        guards = []
        for factor in (self.release, self.alarm):  # whether the hold error is beyond factor · q_t
            Q = np.zeros((n_v + N_a, n_v + N_a))
            Q[n_v:, n_v:] = real.R.T @ real.R / factor**2
            guards.append(Guard(Q, -1.0))
        armed, spent = (replace(real.modes[0], name=name) for name in ("armed", "spent"))
        return replace(
            real,
            modes=(armed, spent),
            guards=tuple(guards),
            table=np.array([[0, 0, 0, 0], [0, 1, 0, 0]]),  # spent while beyond the one and not beyond the other
            watched=(True, False),
            after=(1, 1),
        )


@dataclass(frozen=True, eq=False)
class WithReflex(Intermittent):
    """A fast reflex, delayed PD, beside the intermittent controller; their commands are added."""

    reflex_delay: float = 0.05
    P: float = 100.0
    D: float = 20.0
    kind = "reflex and intermittent"

    def facts(self):
        return {**super().facts(), "reflex_delay": self.reflex_delay, "P": self.P, "D": self.D}

    @cached_property
    def realisation(self):
        reflex = icmj.SwitchingPD(
            self.assumed, "lean", "lean_rate", P=self.P, D=self.D, delay=self.reflex_delay, switches=False
        )
        return parallel(self.base.realisation, reflex.realisation, self.assumed.n_y)


@dataclass(frozen=True, eq=False)
class Alert(Intermittent):
    """The observer trusts what it reads more for a while after the set-point has moved.

    The state s with s' = −s/T + r' remembers how far the set-point of the lean has moved within the last T; while |s|
    is above ``level``, the observer's gain is that of a measurement whose weight R_o is ``trust`` times smaller.
    """

    size: float = 0.02
    start: float = 5.0
    T: float = 1.0
    level: float = 0.002
    trust: float = 100.0
    kind = "alert"

    def facts(self):
        return {**super().facts(), "size": self.size, "T": self.T, "level": self.level, "trust": self.trust}

    @cached_property
    def setpoint(self):
        return icmj.setpoint(self.assumed, [icmj.Target({"lean": 1.0}, step(self.size, self.start))])

    @cached_property
    def realisation(self):
        real, plant = self.base.realisation, self.assumed
        n_v, n_y, N_a, x = real.N.shape[1], plant.n_y, real.layout.size, slice(0, plant.n)
        sharp = icmj.design_lq(plant, R_c=self.R_c, Q_o=plant.B @ plant.B.T, R_o=self.R_o / self.trust)
        more = sharp.L - self.base.design.L

        def wider(matrix):  # for one state more
            return np.pad(matrix, ((0, 1), (0, 1)))

        M, N = wider(real.M), np.pad(real.N, ((0, 1), (0, 0)))
        M[-1, -1], N[-1, n_y] = -1 / self.T, 1.0
        M_alert, N_alert = M.copy(), N.copy()
        M_alert[x, x] -= more @ plant.C
        N_alert[x, :n_y] += more
        K, S = np.pad(real.K, ((0, 0), (0, 1))), real.modes[0].S
        J, G = wider(real.J), wider(real.G)
        J[-1, -1] = G[-1, -1] = 1.0
        Q = np.zeros((n_v + N_a + 1, n_v + N_a + 1))
        Q[-1, -1] = 1 / self.level**2
        return replace(
            real,
            layout=Layout((*real.layout.names, "s"), (*real.layout.sizes, 1)),
            modes=(Mode("calm", M, N, K, S), Mode("alert", M_alert, N_alert, K, S)),
            J=J,
            G=G,
            R=np.pad(real.R, ((0, 0), (0, 1))),
            guards=(Guard(Q, -1.0),),
            table=np.array([[0, 1], [0, 1]]),
        )


@dataclass(frozen=True, eq=False)
class Saturating(Intermittent):
    """The command is limited to ±u_max, and observer and hold know it: in each of three modes all is linear.

    The limit is a signal, the constant u_max, so that a guard can be linear in the state: (∓k x_h) u_max − u_max².
    """

    u_max: float = 6.0
    kind = "saturating"

    def facts(self):
        return {**super().facts(), "u_max": self.u_max}

    @cached_property
    def realisation(self):
        real, plant = self.base.realisation, self.assumed
        n_y, N_a, o, h = plant.n_y, real.layout.size, real.layout["x_o"], real.layout["x_h"]
        N = np.pad(real.N, ((0, 0), (0, 1)))
        zero = np.zeros((1, n_y + 1))
        modes = [Mode("free", real.M, N, real.K, zero)]
        for name, sign in (("up", 1.0), ("down", -1.0)):
            M, N_limit, S = real.M.copy(), N.copy(), zero.copy()
            M[o, h] = 0.0
            M[h, h] = plant.A
            N_limit[o, -1:] = N_limit[h, -1:] = sign * plant.B
            S[0, -1] = -sign
            modes.append(Mode(name, M, N_limit, np.zeros_like(real.K), S))
        guards = []
        for sign in (1.0, -1.0):
            Q = np.zeros((n_y + 1 + N_a, n_y + 1 + N_a))
            Q[n_y, n_y + 1 :] = -sign * real.K[0] / 2
            guards.append(Guard(Q + Q.T, -(self.u_max**2)))
        constant = np.array([[0, self.u_max, 0.0, 0.0, 0.0, np.inf]])
        table = np.tile([0, 1, 2, 0], (3, 1))
        return replace(real, modes=tuple(modes), guards=tuple(guards), table=table, signals=constant)
