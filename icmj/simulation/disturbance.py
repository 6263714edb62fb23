"""Disturbances d(t) on the plant's inputs: ẋ = A x + B (u + d); the observer knows u only.

Every disturbance is a sum of terms a·cos(ω t + φ) that live in a window [start, end). A constant has ω = 0. Terms are
functions of time alone, so what acts on the plant depends neither on the timestep nor on the integrator, and a linear
simulation can integrate it exactly with one oscillator for each term.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from icmj.base.array import Array
from icmj.errors import SimulationError
from icmj.simulation.settings import Impulse, Source, Step

# sinusoids of one noise: enough for a nearly normal amplitude distribution, cheap enough for each stage
NOISE_TERMS = 40


@dataclass(frozen=True, eq=False)
class Disturbance:
    """Terms a·cos(ω t + φ) on [start, end), each on one input; M of them.

    Attributes:
        n_u: number of inputs of the plant.
        input: index of the input, shape (M,), integer.
        amplitude: a [unit of the input], shape (M,).
        omega: ω [rad/s], shape (M,); zero for a constant.
        phase: φ [rad], shape (M,).
        start, end: window [s], shape (M,); ``end`` may be infinite.
    """

    n_u: int
    input: np.ndarray
    amplitude: Array
    omega: Array
    phase: Array
    start: Array
    end: Array

    def __len__(self) -> int:
        return len(self.input)

    @property
    def edges(self) -> Array:
        """Times at which d(t) may jump, rising, positive and finite; a fixed-step integrator must land on them."""
        times = np.unique(np.concatenate([self.start, self.end]))
        return times[np.isfinite(times) & (times > 0)]

    def __call__(self, t: ArrayLike) -> Array:
        """d(t), shape (..., n_u) for ``t`` of shape (...); at an edge the value from there on."""
        t = np.asarray(t, dtype=float)[..., None]
        terms = self.amplitude * np.cos(self.omega * t + self.phase) * ((t >= self.start) & (t < self.end))
        return terms @ (self.input[:, None] == np.arange(self.n_u)).astype(float)


def no_disturbance(n_u: int) -> Disturbance:
    """d(t) = 0."""
    return _from_terms(n_u, [])


def disturbance_of(sources: Sequence[Source], inputs: Sequence[str]) -> Disturbance:
    """The sum of these sources for a plant whose inputs have these names.

    Noise is a multisine: ``NOISE_TERMS`` sinusoids of equal power, one in each of as many equal bands up to the
    bandwidth, frequencies within the bands and phases drawn from the seed. It does not repeat within any
    practical time, has exactly the standard deviation asked for on the long average, and no power beyond the bandwidth.

    Raises:
        SimulationError: if a disturbance names an input that the plant does not have.
    """
    terms: list[tuple[float, ...]] = []
    for item in sources:
        if item.input not in inputs:
            raise SimulationError(f"disturbance on input {item.input!r}: the plant's inputs are {', '.join(inputs)}")
        i = inputs.index(item.input)
        if isinstance(item, Impulse):
            terms.append((i, item.size / item.duration, 0.0, 0.0, item.start, item.start + item.duration))
        elif isinstance(item, Step):
            terms.append((i, item.size, 0.0, 0.0, item.start, np.inf))
        else:
            random = np.random.default_rng(item.seed)
            band = 2 * np.pi * item.bandwidth / NOISE_TERMS
            omega = band * (np.arange(NOISE_TERMS) + random.random(NOISE_TERMS))
            phase = 2 * np.pi * random.random(NOISE_TERMS)
            size = item.size * np.sqrt(2 / NOISE_TERMS)
            terms += [(i, size, w, p, item.start, np.inf) for w, p in zip(omega, phase, strict=True)]
    return _from_terms(len(inputs), terms)


def _from_terms(n_u: int, terms: Sequence[tuple[float, ...]]) -> Disturbance:
    columns = np.array(terms, dtype=float).reshape(-1, 6).T
    return Disturbance(n_u, columns[0].astype(int), *columns[1:])
