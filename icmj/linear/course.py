"""The course of an open-loop interval on the linear plant, exactly: a matrix exponential for each of its parts."""

from __future__ import annotations

import numpy as np

from icmj.base.array import Array
from icmj.controller.closed_loop import compose
from icmj.controller.controller import Controller, start_state
from icmj.plant.linear_plant import LinearPlant
from icmj.simulation.course import Sample
from icmj.simulation.settings import Settings
from icmj.simulation.sources import Bias, Step


class LinearCourse:
    """See :class:`icmj.simulation.course.Course`."""

    def __init__(
        self,
        plant: LinearPlant,
        controller: Controller,
        settings: Settings,
        x: Array,
        x_o: Array,
        x_h: Array,
        length: float,
    ) -> None:
        """The trajectory from an event for ``length`` [s]; disturbances must be constant."""
        loop = compose(plant, controller)
        size = len(loop.F)
        self.plant, self.controller, self._loop = plant, controller, loop
        delay = controller.delay.t_d
        self.cuts: tuple[float, ...] = (0.0, delay, length) if 0 < delay < length else (0.0, length)
        F = np.zeros((size + 1, size + 1))  # the last state is 1: a constant push
        F[:size, :size] = loop.F
        for source in settings.disturbance:
            if isinstance(source, Step):
                if source.push:
                    F[: plant.n, size] += plant.effect(source.push) * source.size
                else:
                    F[:size, size] += loop.D[:, plant.inputs.index(str(source.input))] * source.size
            elif isinstance(source, Bias):
                F[:size, size] += loop.E[:, plant.outputs.index(source.output)] * source.size
        self._F = F
        w = np.concatenate([x, start_state(controller, x_o, x_h), [1.0]])
        self._starts = [w]
        if len(self.cuts) > 2:
            from scipy.linalg import expm

            w = expm(F * delay) @ w
            w[:size] = loop.G @ w[:size]
            self._starts.append(w)
        self.rate = F[:size] @ self._states(np.array([length]))[0]

    def _states(self, t: Array) -> Array:
        from scipy.linalg import expm

        states = np.zeros((len(t), len(self._F)))
        for part, w in enumerate(self._starts):
            here = (t >= self.cuts[part]) & ((t < self.cuts[part + 1]) | (part == len(self._starts) - 1))
            if here.any():
                states[here] = expm(self._F * (t[here] - self.cuts[part])[:, None, None]) @ w
        return states

    def sample(self, t: Array) -> Sample:
        """Its states at given times."""
        w = self._states(t)[:, :-1]
        parts = self._loop.layout.split(w)
        y, u = parts["x"] @ self.plant.C.T, -w @ self._loop.K.T
        return Sample(t, parts["x"], parts["x_o"], parts["x_h"], y, u, np.zeros((len(t), 0)))

    def generators(self, t: Array, part: int) -> Array:
        """F, the same at all times."""
        return np.broadcast_to(self._F[:-1, :-1], (len(t), len(self._F) - 1, len(self._F) - 1))
