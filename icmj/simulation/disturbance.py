"""Disturbances d(t) of commands, pushes p(t) on the plant itself, errors n(t) of outputs for the observer.

ẋ = A x + B (u + d) + E p with a column of E for each push (:class:`icmj.plant.linear_plant.Push`). The observer knows u
only, and reads y + n; the plant does not feel n. All are sums of terms a·cos(ω t + φ) that live
in a window [start, end). A constant has ω = 0; a term that ends when it starts is an impulse of area a, which only a
controller's own signals have. Terms are functions of time alone, so what acts depends neither on the
timestep nor on the integrator, and a linear simulation can integrate it exactly with one oscillator for each term.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from icmj.base.array import Array, at_or_after
from icmj.controller.law import Law
from icmj.errors import SimulationError
from icmj.plant.linear_plant import LinearPlant, Push
from icmj.series.interpolation import snap_rows
from icmj.simulation.grid import interpolate_at
from icmj.simulation.settings import Settings
from icmj.simulation.sinusoids import Waves
from icmj.simulation.sources import Gaussian, Gridded, Impulse, Noise, Placed, Sinusoids, Source

LOW_PASS_END = 20.0  # corner frequencies at which a low-pass spectrum is cut; 3 % of the power would lie beyond
_FINE, _COARSE = 4000, 400  # instants: of one signal, and of each of many
_MANY = 20000  # sinusoids times instants: fewer are evaluated one by one
_SEEDS = 1000  # signals whose standard deviations tell what is to be expected
_ENOUGH = 200  # terms: more change the range of standard deviations no further


@dataclass(frozen=True, eq=False)
class Disturbance:
    """Terms a·cos(ω t + φ) on [start, end), each on one input; M of them.

    The inputs are the plant's, or for errors of the outputs those of the observer, which are the plant's outputs and
    then a controller's signals; or places that are pushed.

    Attributes:
        n_u: number of inputs.
        input: index of the input, shape (M,), integer.
        amplitude: a [unit of the input], shape (M,).
        omega: ω [rad/s], shape (M,); zero for a constant.
        phase: φ [rad], shape (M,).
        start, end: window [s], shape (M,); ``end`` may be infinite.
        gaussian: Gaussian noises and sampled disturbances beside the terms, each with the index of its input.
        shares: noises whose size is a share of the command, in the same form.
    """

    n_u: int
    input: np.ndarray
    amplitude: Array
    omega: Array
    phase: Array
    start: Array
    end: Array
    gaussian: tuple[tuple[int, Gridded], ...] = ()
    shares: tuple[tuple[int, Gaussian], ...] = ()

    def __len__(self) -> int:
        return len(self.input) + len(self.gaussian) + len(self.shares)

    @property
    def table(self) -> Array:
        """Its sinusoids, each (input, amplitude, ω, φ, start, end), shape (M, 6)."""
        return np.column_stack([self.input, self.amplitude, self.omega, self.phase, self.start, self.end])

    @property
    def edges(self) -> Array:
        """Times at which d(t) may jump, rising, positive and finite; a fixed-step integrator must land on them."""
        drawn = [noise.start for _, noise in (*self.gaussian, *self.shares)]
        times = np.unique(np.concatenate([self.start, self.end, drawn]))
        return times[np.isfinite(times) & (times > 0)]

    def __call__(self, t: ArrayLike) -> Array:
        """d(t), shape (..., n_u) for ``t`` of shape (...); at an edge the value from there on.

        Noises whose size is a share of the command are left out; ``beside`` has them.
        """
        t = np.asarray(t, dtype=float)
        found = self._of_terms(t)
        for index, noise in self.gaussian:
            found[..., index] += interpolate_at(noise, t)
        return found

    def beside(self, t: Array, u: Array) -> Array:
        """All of d(t) beside the commands ``u`` at these times, shapes (N,), (N, n_u) → (N, n_u)."""
        found = self(t)
        for index, noise in self.shares:
            found[:, index] += interpolate_at(noise, t) * u[:, index]
        return found

    def at_rows(self, t: Array, u: Array) -> Array:
        """The same at rows, of which one that is an edge but for rounding is exactly that."""
        return self.beside(snap_rows(t, self.edges), u)

    def _of_terms(self, t: Array) -> Array:
        if t.ndim == 1 and len(t) * len(self.input) > _MANY and np.all(t[1:] >= t[:-1]):
            return self._at_many(t)
        t = t[..., None]
        terms = (
            self.amplitude
            * np.cos(self.omega * t + self.phase)
            * (at_or_after(t, self.start) & ~at_or_after(t, self.end))
        )
        return terms @ (self.input[:, None] == np.arange(self.n_u)).astype(float)

    def _at_many(self, t: Array) -> Array:
        """The same for many increasing times: terms that act together are evaluated together."""
        found, order = np.zeros((len(t), self.n_u)), np.argsort(self.input, kind="stable")
        windows = np.stack([self.start, self.end], axis=1)[order]
        for start, end in np.unique(windows, axis=0):
            these = order[(windows == (start, end)).all(axis=1)]
            signal, amplitude, omega, phase = (of[these] for of in (self.input, self.amplitude, self.omega, self.phase))
            waves = Waves(signal, amplitude, omega, phase, self.n_u)
            acts = at_or_after(t, start) & ~at_or_after(t, end)
            found[acts] += waves(t[acts])
        return found


def make_no_disturbance(n_u: int) -> Disturbance:
    """d(t) = 0."""
    return _from_terms(n_u, [])


@dataclass(frozen=True, eq=False)
class Pushes:
    """Forces on the plant itself.

    Attributes:
        places: where they act, K of them.
        size: of each over time, K inputs.
    """

    places: tuple[Push, ...]
    size: Disturbance

    def __len__(self) -> int:
        return len(self.places)


def make_pushes(settings: Settings) -> Pushes:
    """p(t): the forces on the plant itself, summed for each place."""
    places, sources = settings.pushes, [of for of in settings.disturbance if isinstance(of, Placed)]
    pairs = [(places.index(source.push), source) for source in sources if source.push is not None]
    return Pushes(places, _gather(len(places), pairs))


class Acting(NamedTuple):
    """All exogenous inputs of a closed loop as functions of time.

    Attributes:
        disturbance: beside the plant's commands.
        errors: of its outputs as the controller reads them, and then the signals that the controller is given.
        pushes: on the plant itself.
    """

    disturbance: Disturbance
    errors: Disturbance
    pushes: Pushes

    @property
    def edges(self) -> Array:
        """Times at which any of it may jump, rising [s]."""
        return np.unique(np.concatenate([self.disturbance.edges, self.errors.edges, self.pushes.size.edges]))

    @property
    def gaussian(self) -> tuple[Gridded, ...]:
        """All Gaussian noises and sampled disturbances."""
        parts = self.disturbance, self.errors, self.pushes.size
        return tuple(noise for of in parts for _, noise in (*of.gaussian, *of.shares))

    @property
    def omega(self) -> Array:
        """Frequencies of all terms [rad/s]."""
        return np.concatenate([self.disturbance.omega, self.errors.omega, self.pushes.size.omega])


def make_acting(plant: LinearPlant, settings: Settings, controller: Law | None = None) -> Acting:
    """The exogenous inputs that the settings define, for a plant with these inputs and outputs.

    Raises:
        SimulationError: if a source names an input or output that the plant does not have, or is a share of commands
            that the controller does not hold (``expect_held``).
    """
    sources = settings.disturbance
    if controller is not None:
        expect_held(controller, settings)
    errors = make_reading_error(sources, plant.outputs)
    if controller is not None and len(signals := controller.realisation.signals):
        terms = np.vstack([errors.table, signals + np.array([plant.n_y, 0, 0, 0, 0, 0])])
        errors = _from_terms(controller.realisation.N.shape[1], terms, errors.gaussian)
    return Acting(make_disturbance(sources, plant.inputs), errors, make_pushes(settings))


def expect_held(law: Law, settings: Settings) -> None:
    """Refuse noise whose size is a share of the command, if that does not follow from a hold between events alone.

    Raises:
        SimulationError: if there is such noise and the command depends on what the controller reads.
    """
    real, shares = law.realisation, [of.share for of in settings.disturbance if isinstance(of, Gaussian) and of.share]
    if shares and (not law.observed or real.N[real.K.any(axis=0)].any()):
        raise SimulationError(
            f"gaussian noise with share = {shares[0]:g} needs commands that follow from a hold between events, not "
            f"from readings as under a {law.kind} controller; give size instead of share, or an event or clock trigger"
        )


def make_disturbance(sources: Sequence[Source], inputs: Sequence[str]) -> Disturbance:
    """d(t): those of these sources that act beside commands, for a plant whose inputs have these names.

    Noise is a multisine: sinusoids of equal power, one in each of as many bands, which split the spectrum into parts of
    equal power, frequencies within the bands and phases drawn from the seed. It does not repeat within any practical
    time, has exactly the standard deviation asked for on the long average, and no power beyond the spectrum's end.

    Raises:
        SimulationError: if a source names an input that the plant does not have.
    """
    return _sum([of for of in sources if isinstance(of, Placed) and of.push is None], inputs, "input")


def make_reading_error(sources: Sequence[Source], outputs: Sequence[str]) -> Disturbance:
    """n(t): those of these sources that act on outputs, for a plant whose outputs have these names.

    Raises:
        SimulationError: if a source names an output that the plant does not have.
    """
    return _sum(sources, outputs, "output")


def measure_realisation(noise: Noise, end: float) -> tuple[float, float]:
    """Mean and standard deviation of this realisation from its start to ``end`` [its unit]."""
    drawn = _gather(1, [(0, noise)])
    values = drawn(np.linspace(noise.start, end, _FINE, endpoint=False))[:, 0]
    return float(values.mean()), float(values.std())


def bound_realisation(noise: Noise, end: float) -> tuple[float, float]:
    """Interval that contains the standard deviation from start to ``end`` for 95 % of all seeds [its unit]."""
    edge = noise.bandwidth if noise.corner is None else noise.corner
    assert edge is not None
    low, high = _expect_spread(noise.corner is None, float(edge * (end - noise.start)), min(noise.terms, _ENOUGH))
    return low * noise.size, high * noise.size


@lru_cache(maxsize=256)
def _expect_spread(flat: bool, periods: float, terms: int) -> tuple[float, float]:
    """The same for a size of one and a spectrum whose upper end has this number of periods in that time."""
    edge = {"bandwidth": periods} if flat else {"corner": periods}
    t = np.linspace(0, 1, _COARSE, endpoint=False)
    spread = []
    for seed in range(_SEEDS):
        noise = Noise(input="u", size=1.0, seed=seed, terms=terms, **edge)  # type: ignore[arg-type]
        spread.append(_gather(1, [(0, noise)])(t)[:, 0].std())
    low, high = np.quantile(spread, [0.025, 0.975])
    return float(low), float(high)


def _sum(sources: Sequence[Source], names: Sequence[str], what: str) -> Disturbance:
    """All of these sources that name a place, as their ``what``, among those with these ``names``."""
    pairs = []
    for source in sources:
        name = getattr(source, what, None)
        if name is None:
            continue
        if name not in names:
            raise SimulationError(f"disturbance on {what} {name!r}: the plant's {what}s are {', '.join(names)}")
        pairs.append((names.index(name), source))
    found = _gather(len(names), pairs)
    shares = tuple((at, noise) for at, noise in found.gaussian if isinstance(noise, Gaussian) and noise.share)
    return replace(found, gaussian=tuple(pair for pair in found.gaussian if pair not in shares), shares=shares)


def _gather(n_u: int, sources: Sequence[tuple[int, Source]]) -> Disturbance:
    """The sum of sources, each with its place among ``n_u``."""
    terms = [(at, *term) for at, source in sources for term in list_terms(source)]
    return _from_terms(n_u, terms, [(at, source) for at, source in sources if isinstance(source, Gridded)])


def list_terms(source: Source) -> list[tuple[float, ...]]:
    """(a, ω, φ, start, end) of every term; what is given on a grid has none."""
    if isinstance(source, Gridded):
        return []
    if isinstance(source, Sinusoids):
        return [(*term, 0.0, np.inf)[:5] if len(term) == 3 else term for term in source.terms]
    if isinstance(source, Impulse):
        return [(source.size / source.duration, 0.0, 0.0, source.start, source.start + source.duration)]
    if not isinstance(source, Noise):
        return [(source.size, 0.0, 0.0, source.start, np.inf)]
    random, count = np.random.default_rng(source.seed), source.terms
    share = np.arange(count) + random.random(count)
    if source.corner is None:
        assert source.bandwidth is not None
        omega = 2 * np.pi * source.bandwidth / count * share
    else:
        # the power below f is as arctan f/corner
        omega = 2 * np.pi * source.corner * np.tan(np.arctan(LOW_PASS_END) * share / count)
    phase = 2 * np.pi * random.random(count)
    size = source.size * np.sqrt(2 / count)
    return [(size, w, p, source.start, np.inf) for w, p in zip(omega, phase, strict=True)]


def _from_terms(
    n_u: int, terms: Sequence[tuple[float, ...]] | Array, gaussian: Sequence[tuple[int, Gridded]] = ()
) -> Disturbance:
    index, amplitude, omega, phase, start, end = np.array(terms, dtype=float).reshape(-1, 6).T
    return Disturbance(n_u, index.astype(int), amplitude, omega, phase, start, end, tuple(gaussian))


NO_PUSHES = Pushes((), make_no_disturbance(0))
