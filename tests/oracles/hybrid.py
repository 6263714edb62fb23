"""A controller's realisation beside a linear plant, by SciPy's DOP853 and sign changes on a fine grid.

It knows nothing of polynomials: what is due at an instant is carried out one by one, in the order of
docs/simulation.md, and between two instants an integrator goes on whose dense output is what delayed readings read.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Sequence

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

_TOGETHER = 1e-11  # s


class Hybrid:
    """A run of (plant, realisation); ``events`` are of the rule or the clock, ``switches`` changes of the mode."""

    def __init__(
        self,
        plant,
        real,
        x0,
        a0=None,
        acts: Callable[[float], np.ndarray] | None = None,
        edges: Sequence[float] = (),
        longest: float = 0.02,
    ) -> None:
        self.plant, self.real, self.longest = plant, real, longest
        self.acts = acts or (lambda t: np.zeros(plant.n_u))
        self.edges = sorted({*edges, *real.signals[:, 4], *real.signals[np.isfinite(real.signals[:, 5]), 5]})
        self.n, self.size = plant.n, real.layout.size
        self.z = np.concatenate([x0, np.zeros(self.size) if a0 is None else a0])
        self.start, self.starts, self.pieces = self.z.copy(), [], []
        self.t, self.events, self.switches = 0.0, [], []
        self.queue = [real.delay] if real.eventful and real.delay else []
        self.ready, self.sample, self.tick, self.reset = real.wait, np.inf, real.clock, real.period
        self.mode = real.following(0, self.w(0.0, self.z))
        self.signs = self.signs_at(self.z)

    def x(self, t: float) -> np.ndarray:
        """The plant's state at a time so far."""
        if t <= 0 or not self.pieces:
            return self.start[: self.n]
        return self.pieces[max(bisect_right(self.starts, t) - 1, 0)](t)[: self.n]

    def signals(self, t: float) -> np.ndarray:
        n_v = self.real.modes[0].S.shape[1]
        found = np.zeros(n_v - self.plant.n_y * len(self.real.taps))
        for number, a, omega, phi, start, end in self.real.signals:
            if start <= t < end:
                found[int(number)] += a * np.cos(omega * t + phi)
        return found

    def w(self, t: float, z: np.ndarray) -> np.ndarray:
        """Readings and the controller's state."""
        read = [self.plant.C @ (z[: self.n] if tau == 0 else self.x(t - tau)) for tau in self.real.taps]
        return np.concatenate([*read, self.signals(t), z[self.n :]])

    def u(self, t: float, z: np.ndarray, mode: int) -> np.ndarray:
        on = self.real.modes[mode]
        return -on.K @ z[self.n :] - on.S @ self.w(t, z)[: on.S.shape[1]]

    def rate(self, t: float, z: np.ndarray, first: float, last: float) -> np.ndarray:
        t = min(max(t, first), last)
        on = self.real.modes[self.mode]
        v = self.w(t, z)[: on.S.shape[1]]
        x = self.plant.A @ z[: self.n] + self.plant.B @ (self.u(t, z, self.mode) + self.acts(t))
        return np.concatenate([x, on.M @ z[self.n :] + on.N @ v])

    def signs_at(self, z: np.ndarray) -> tuple[bool, ...]:
        return tuple(float(guard(self.w(self.t, z))) > 0 for guard in self.real.guards)

    def level(self, z: np.ndarray) -> float:
        """The largest |R_j a|² − 1."""
        parts = (self.real.R @ z[self.n :]) ** 2
        return max((parts[a:b].sum() for a, b in zip(self.real.cuts, self.real.cuts[1:], strict=False)), default=-1) - 1

    def armed(self) -> bool:
        watched = not self.real.watched or self.real.watched[self.mode]
        return len(self.real.cuts) > 1 and watched and self.ready <= self.t + _TOGETHER and self.sample == np.inf

    def map(self, matrix: np.ndarray) -> None:
        self.z[self.n :] = matrix @ self.z[self.n :]

    def fire(self) -> None:
        real = self.real
        self.events.append(self.t)
        self.map(real.J)
        if real.delay:
            self.queue.append(self.t + real.delay)
        self.ready, self.sample = self.t + real.wait, np.inf
        before = self.mode
        if real.after:
            self.mode = real.after[self.mode]
        self.mode = real.chosen(self.mode, self.signs)
        if self.mode != before:
            self.switches.append(self.t)

    def happen(self) -> None:
        """What is due at the present instant, in its order."""
        real = self.real
        for number, a, _, _, start, end in real.signals:
            if start == end and abs(start - self.t) < _TOGETHER:
                column = real.modes[0].S.shape[1] - len(self.signals(0.0)) + int(number)
                self.z[self.n :] += real.modes[self.mode].N[:, column] * a
        while self.queue and self.queue[0] <= self.t + _TOGETHER:
            self.queue.pop(0)
            self.map(real.G)
        if self.reset <= self.t + _TOGETHER:
            self.map(real.J)
            self.reset += real.period
        if self.tick <= self.t + _TOGETHER or self.sample <= self.t + _TOGETHER:
            if self.tick <= self.t + _TOGETHER:
                self.tick = (round(self.tick / real.clock) + 1) * real.clock
            self.fire()
        self.judge()

    def judge(self) -> None:
        """Guards and the rule where they are, until nothing is beyond its level."""
        real = self.real
        for _ in range(4):
            signs = self.signs_at(self.z)
            if signs != self.signs:
                self.signs, before = signs, self.mode
                self.mode = real.chosen(self.mode, signs)
                if self.mode != before:
                    self.switches.append(self.t)
            elif self.armed() and self.level(self.z) >= 0:
                self.reach()
            else:
                break

    def reach(self) -> None:
        if self.real.sampling:
            self.ready, self.sample = np.inf, self.t + self.real.sampling
        else:
            self.fire()

    def run(self, duration: float) -> Hybrid:
        real = self.real
        delays = [tau for tau in real.taps if tau > 0]
        rough = [0.0, *self.edges]
        self.happen()
        while self.t < duration - _TOGETHER:
            t = self.t
            due = [*self.edges, *self.queue[:1], self.reset, self.tick, self.sample, self.ready, duration]
            due += [b + tau for b in rough for tau in delays]
            end = min(t + self.longest, *(t + tau for tau in delays), *(d for d in due if d > t + _TOGETHER))
            found = solve_ivp(
                self.rate, (t, end), self.z, method="DOP853", rtol=1e-12, atol=1e-16, dense_output=True,
                first_step=end - t, args=(t + 1e-14, end - 1e-14),
            )  # fmt: skip
            self.starts.append(t)
            self.pieces.append(found.sol)
            levels = [lambda s, g=guard, z=found.sol: float(g(self.w(s, z(s)))) for guard in real.guards]
            signs = list(self.signs)
            if self.armed():
                levels.append(lambda s, z=found.sol: self.level(z(s)))
                signs.append(False)
            looks, first = np.linspace(t + 1e-9 * (end - t), end, 40), None
            for number, (level, sign) in enumerate(zip(levels, signs, strict=True)):
                past = np.array([level(s) > 0 for s in looks]) != sign
                if past.any() and not past[0]:
                    k = int(np.argmax(past))
                    at = brentq(level, looks[k - 1], looks[k], xtol=1e-15, rtol=1e-15)
                    if first is None or at < first[0]:
                        first = at, number
            self.t = end if first is None or abs(first[0] - end) < _TOGETHER else first[0]
            self.z = found.sol(self.t).copy()
            before, modes, events = self.z.copy(), len(self.switches), len(self.events)
            if self.t < end and first[1] < len(real.guards):
                self.signs = tuple(not s if i == first[1] else s for i, s in enumerate(self.signs))
                mode, self.mode = self.mode, real.chosen(self.mode, self.signs)
                if self.mode != mode:
                    self.switches.append(self.t)
                    if self.armed() and self.level(self.z) >= 0:  # it was not watched before
                        self.reach()
            elif self.t < end:
                self.reach()
            else:
                self.happen()
            if len(self.switches) > modes or len(self.events) > events or not np.array_equal(before, self.z):
                rough.append(self.t)
            rough = [b for b in rough if b + max(delays, default=0.0) > self.t - 1e-9]
        return self
