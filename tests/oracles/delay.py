"""Delay-differential loops by the method of steps with SciPy's DOP853, which starts anew wherever something jumps."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

Rate = Callable[[float, np.ndarray, np.ndarray, int], np.ndarray]


@dataclass
class Delayed:
    """ż = rate(t, z, v, mode) with v = (read(t − τ_1), …); the mode is choose(mode, v), which may change where a guard
    does that is a function of v. Before t = 0 what is read is that at the start.
    """

    rate: Rate
    read: Callable[[float, np.ndarray], np.ndarray]
    taps: tuple[float, ...]
    z0: np.ndarray
    guards: tuple[Callable[[np.ndarray], float], ...] = ()
    choose: Callable[[int, tuple[bool, ...]], int] = lambda mode, signs: mode
    edges: tuple[float, ...] = ()
    longest: float = 0.02
    starts: list[float] = field(default_factory=list)
    pieces: list = field(default_factory=list)
    switches: list[float] = field(default_factory=list)

    def z(self, t: float) -> np.ndarray:
        """The state at a time so far."""
        if t <= 0:
            return np.array(self.z0, dtype=float)
        return self.pieces[max(bisect_right(self.starts, t) - 1, 0)](t)

    def v(self, t: float) -> np.ndarray:
        """What is read at t."""
        return np.concatenate([self.read(max(t - tau, 0.0), self.z(t - tau)) for tau in self.taps])

    def _inside(self, t: float, z: np.ndarray, mode: int, first: float, last: float) -> np.ndarray:
        """The rate, with what is read between two jumps even at these."""
        return self.rate(t, z, self.v(min(max(t, first), last)), mode)

    def run(self, duration: float) -> Delayed:
        """From 0 on."""
        t, z, v = 0.0, np.array(self.z0, dtype=float), self.v(0.0)
        signs = tuple(guard(v) > 0 for guard in self.guards)
        mode = self.choose(0, signs)
        rough = [0.0, *self.edges]
        while t < duration - 1e-13:
            ahead = [b + tau for b in rough for tau in (0.0, *self.taps) if b + tau > t + 1e-11]
            end = min([t + self.longest, t + min(self.taps), duration, *ahead])
            changed = None
            for number, guard in enumerate(self.guards):
                looks = np.linspace(t + min(1e-10, (end - t) / 2), end, 60)
                past = np.array([guard(self.v(s)) > 0 for s in looks]) != signs[number]
                if past.any():
                    k = int(np.argmax(past))
                    low, high = (t if k == 0 else looks[k - 1]), looks[k]
                    at = high if k == 0 else brentq(lambda s, g=guard: g(self.v(s)), low, high, xtol=1e-15, rtol=1e-15)
                    if changed is None or at < changed[0]:
                        changed = (at, number)
            stop = end if changed is None else changed[0]
            if stop > t:
                found = solve_ivp(
                    self._inside, (t, stop), z, method="DOP853", rtol=1e-13, atol=1e-16, dense_output=True,
                    first_step=stop - t, args=(mode, t + 1e-14, stop - 1e-14),
                )  # fmt: skip
                self.starts.append(t)
                self.pieces.append(found.sol)
                z = found.y[:, -1]
            if any(abs(stop - b) < 1e-11 for b in ahead):
                rough.append(stop)
            if changed is not None:
                signs = tuple(not sign if i == changed[1] else sign for i, sign in enumerate(signs))
                following = self.choose(mode, signs)
                if following != mode:
                    self.switches.append(stop)
                    rough.append(stop)
                mode = following
            t = stop
            rough = [b for b in rough if b + max(self.taps) > t - 1e-9]
        return self


def of_law(plant, law, x0, disturbance=None, errors=None, edges=(), longest=0.02) -> Delayed:
    """A linear plant under a law, z = (x, a), from its matrices alone."""
    real, n = law.realisation, plant.n
    acts = disturbance or (lambda t: np.zeros(plant.n_u))
    error = errors or (lambda t: np.zeros(plant.n_y))

    def rate(t, z, v, mode):
        m = real.modes[mode]
        x, a = z[:n], z[n:]
        u = -m.K @ a - m.S @ v
        return np.concatenate([plant.A @ x + plant.B @ (u + acts(t)), m.M @ a + m.N @ v])

    guards = tuple((lambda v, g=g: float(v @ g.Q @ v + g.c)) for g in real.guards)
    z0 = np.concatenate([x0, np.zeros(real.layout.size)])
    return Delayed(
        rate, lambda t, z: plant.C @ z[:n] + error(t), real.taps, z0, guards, lambda mode, s: real.chosen(mode, s),
        tuple(edges), longest,
    )  # fmt: skip
