"""Quiet standing as one writes it first, in numba: Euler–Maruyama steps with noise drawn on the way.

The same plant, controller, delay and predictor, and the same to be recorded; events are looked for once a step.
"""

import numba
import numpy as np
from scipy.linalg import expm

from icmj import Controller, LinearPlant


@numba.njit(nogil=True)
def _run(M, D, C, R, predictor, rate, size, delay, least, w, steps, h, every, random, given, events, rows):  # type: ignore[no-untyped-def]
    whole, n, n_hat, noises, n_y = len(w), C.shape[1], len(predictor), D.shape[1], len(C)
    noise, ahead, pending = np.zeros(noises), np.zeros(whole), np.zeros(n_hat)
    for i in range(noises):
        noise[i] = given[0, i] if len(given) else size[i] * random.standard_normal()
    high, low = np.full(n_y, -np.inf), np.full(n_y, np.inf)
    ready, action, count = least, np.inf, 0
    for step in range(steps):
        t = step * h
        if step % every == 0:
            rows[step // every] = w
        for i in range(n_y):
            y = 0.0
            for j in range(n):
                y += C[i, j] * w[j]
            high[i], low[i] = max(high[i], y), min(low[i], y)
        if t >= action:
            w[n + n_hat :] = pending
            action = np.inf
        if t >= ready:
            level = 0.0
            for i in range(len(R)):
                e = 0.0
                for j in range(n_hat):
                    e += R[i, j] * (w[n + n_hat + j] - w[n + j])
                level += e * e
            if level >= 1:
                events[count, 0] = t
                events[count, 1 : 1 + n_y], events[count, 1 + n_y :] = high, low
                high[:], low[:] = -np.inf, np.inf
                count, ready, action = count + 1, t + least, t + delay
                for i in range(n_hat):
                    pending[i] = 0.0
                    for j in range(2 * n_hat):
                        pending[i] += predictor[i, j] * w[n + j]
        for i in range(whole):
            rise = 0.0
            for j in range(whole):
                rise += M[i, j] * w[j]
            for j in range(noises):
                rise += D[i, j] * noise[j]
            ahead[i] = w[i] + h * rise
        for i in range(whole):
            w[i] = ahead[i]
        for i in range(noises):
            if len(given):
                noise[i] = given[step + 1, i]
            else:
                noise[i] += -rate[i] * h * noise[i] + size[i] * np.sqrt(2 * rate[i] * h) * random.standard_normal()
    return count


class EulerMaruyama:
    """The loop for one plant and controller, with a delay; noise on every input and reading, in that order."""

    def __init__(self, plant: LinearPlant, controller: Controller, sizes: np.ndarray, corners: np.ndarray) -> None:
        d, P, n, m = controller.design, controller.design.plant, plant.n, controller.design.plant.n
        none = np.zeros((m, n))
        # (x, x_o, x_h), as the paper writes them
        M = np.block([
            [plant.A, none.T, -plant.B @ d.k],
            [d.L @ plant.C, d.A_o, -P.B @ d.k],
            [none, np.zeros((m, m)), controller.hold.A_h],
        ])  # fmt: skip
        D = np.zeros((n + 2 * m, plant.n_u + plant.n_y))
        D[:n, : plant.n_u], D[n : n + m, plant.n_u :] = plant.B, d.L
        model = np.block([[P.A, -P.B @ d.k], [np.zeros((m, m)), controller.hold.A_h]])
        predictor = expm(model * controller.delay.predicted)[:m]
        self.M, self.D, self.R, self.predictor = M, D, controller.faces.R, predictor
        self.delay, self.least = controller.delay.t_d, controller.least
        self._parts = (M, D, plant.C, self.R, predictor, 2 * np.pi * corners, sizes, self.delay, self.least)
        self._n_y = plant.n_y

    def run(
        self, x: np.ndarray, duration: float, h: float, interval: float, seed: int, given: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Events with the outputs' extremes, and rows; under ``given`` noise at every step, or drawn from the seed."""
        steps, every = round(duration / h), round(interval / h)
        w = np.concatenate([x, np.zeros(len(self.M) - len(x))])
        events, rows = np.empty((steps, 1 + 2 * self._n_y)), np.empty((-(-steps // every), len(w)))
        given = np.zeros((0, 0)) if given is None else given
        count = _run(*self._parts, w, steps, h, every, np.random.default_rng(seed), given, events, rows)
        return events[:count], rows
