"""Which kind of controller explains reaction times to pairs of steps (van de Kamp et al. 2013, figure 8).

Each kind predicts both reaction times from few numbers. What is left is taken for noise with Student's distribution of
4 degrees of freedom or of 100, whichever is likelier: with tails that forgive a pair now and then, or normal. Bayes'
criterion decides, and it leaves a kind of fewer numbers only for one that is better by ``MARGIN``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import lgamma

import numpy as np
from numpy.typing import ArrayLike

from icmj.base.array import Array
from icmj.base.card import Card, Shown
from icmj.errors import DataError
from icmj.experiments.double_step.refractoriness import OUTLYING, reactions, usual

KINDS = {
    "continuous": "continuous and linear: RT1 = RT2 = c",
    "event": "triggered by events: RT1 = c, RT2 = c + max(0, D − ISI)",
    "clock": "driven by a clock of interval D: both RT from c to c + D, and responses a multiple of D apart",
    "sampling": "triggered by events, sampled d_s later: RT1 = c; RT2 = c − ISI until d_s, then as by events",
}
MARGIN = 10.0  # of Bayes' criterion: very strong evidence by Kass and Raftery's (1995) scale
FEWEST = 12  # pairs
_FREEDOMS, _GRID, _PHASES = (4.0, 100.0), 48, 64


@dataclass(frozen=True, eq=False, repr=False)
class Explanation(Shown):
    """How well each kind of controller explains the reaction times.

    Attributes:
        kind: the kind that explains them best: ``continuous``, ``event``, ``clock`` or ``sampling``.
        bic: Bayesian information criterion of each kind; smaller is better.
        parameters: parameters of each kind: c, D and d_s [s] if it has them, and the scale of the noise [s].
    """

    kind: str
    bic: Mapping[str, float]
    parameters: Mapping[str, Mapping[str, float]] = field(default_factory=dict)

    @property
    def intermittent(self) -> bool:
        """Whether the kind is one of those that sample: all except ``continuous``."""
        return self.kind != "continuous"

    def card(self) -> Card:
        """Its representation at a prompt or in a notebook."""
        least = min(self.bic.values())
        rows = tuple((name, f"{self.bic[name] - least:.1f} above the least") for name in self.bic)
        return Card(f"{self.kind} control, {KINDS[self.kind]}", rows)


def explain_reactions(isi: ArrayLike, rt: ArrayLike, resolution: float) -> Explanation:
    """The kind of controller that explains reaction times to pairs of steps best.

    Args:
        isi: inter-step interval of each pair [s], shape (P,).
        rt: reaction times to first and second step [s], shape (P, 2). Pairs with NaN are left out, and so are pairs
            whose RT1 is far from the others (see :func:`icmj.refractoriness`).
        resolution: accuracy of the reaction times [s], such as the sampling interval: the smallest scale of the noise.

    Raises:
        DataError: if shapes do not fit together, or there are too few pairs.
    """
    if not (np.isfinite(resolution) and resolution > 0):
        raise DataError(f"a resolution of {resolution:g} s; expected a positive one, such as the sampling interval")
    each, times = usual(*reactions(isi, rt), OUTLYING, 2 * resolution)
    if len(each) < FEWEST:
        raise DataError(f"{len(each)} pairs with reaction times; expected at least {FEWEST} to tell controllers apart")
    bic: dict[str, float] = {}
    parameters: dict[str, dict[str, float]] = {}
    for kind in KINDS:
        likelihood, found = max(
            (_best(kind, freedom, each, times, resolution) for freedom in _FREEDOMS), key=lambda pair: pair[0]
        )
        parameters[kind] = found
        bic[kind] = len(found) * float(np.log(times.size)) - 2 * likelihood
    best = min(bic, key=lambda kind: bic[kind])
    simpler = [
        kind for kind in KINDS if len(parameters[kind]) < len(parameters[best]) and bic[kind] - bic[best] < MARGIN
    ]
    best = min(simpler, key=lambda kind: len(parameters[kind]), default=best)
    return Explanation(best, bic, parameters)


def _best(kind: str, freedom: float, isi: Array, rt: Array, resolution: float) -> tuple[float, dict[str, float]]:
    """The largest log-likelihood of a kind, and the numbers that have it."""
    from scipy.optimize import minimize

    durations = np.geomspace(max(2 * resolution, 0.02), 1.5, _GRID)
    starts: list[dict[str, float]] = [{}]
    if kind != "continuous":
        starts = [{"D": D} for D in durations]
    if kind == "sampling":
        starts = [{"D": D, "d_s": d_s} for D in durations[::2] for d_s in D * np.linspace(0.1, 0.9, 9)]
    best = max((_started(kind, freedom, start, isi, rt, resolution) for start in starts), key=lambda pair: pair[0])
    names = list(best[1])

    def cost(numbers: Array) -> float:
        return -_likelihood(kind, freedom, dict(zip(names, numbers, strict=True)), isi, rt, resolution)

    at = np.array([best[1][name] for name in names])
    simplex = at + np.vstack([np.zeros(len(at)), np.diag(0.05 * np.maximum(np.abs(at), resolution))])
    polished = minimize(cost, at, method="Nelder-Mead", options={"initial_simplex": simplex, "maxfev": 400})
    if -polished.fun > best[0]:
        best = -float(polished.fun), dict(zip(names, map(float, polished.x), strict=True))
    return best


def _started(
    kind: str, freedom: float, start: dict[str, float], isi: Array, rt: Array, resolution: float
) -> tuple[float, dict[str, float]]:
    """The likelihood with c and scale as medians have them."""
    if kind == "clock":
        c, scale = float(np.quantile(rt, 0.02)), max(resolution, 0.1 * start["D"])
        tried = [{"c": c, **start, "scale": s} for s in (scale, resolution)]
    else:
        left = rt - _course(kind, start, isi)
        c = float(np.median(left))
        tried = [{"c": c, **start, "scale": max(resolution, float(np.median(np.abs(left - c))))}]
    found = [(_likelihood(kind, freedom, numbers, isi, rt, resolution), numbers) for numbers in tried]
    return max(found, key=lambda pair: pair[0])


def _course(kind: str, numbers: Mapping[str, float], isi: Array) -> Array:
    """RT1 and RT2 less the constant c, shape (P, 2)."""
    later = np.zeros(len(isi))
    if kind in ("event", "sampling"):
        later = np.maximum(numbers["D"] - isi, 0.0)
    if kind == "sampling":
        later = np.where(isi < numbers["d_s"], -isi, later)
    return np.column_stack([np.zeros(len(isi)), later])


def _likelihood(
    kind: str, freedom: float, numbers: Mapping[str, float], isi: Array, rt: Array, resolution: float
) -> float:
    scale, D, d_s = numbers["scale"], numbers.get("D", 1.0), numbers.get("d_s", 0.0)
    if scale < resolution / 2 or D <= 0 or not 0 <= d_s < D:
        return -np.inf
    if kind != "clock":
        left = (rt - numbers["c"] - _course(kind, numbers, isi)) / scale
        return float(_log_student(left, freedom).sum() - rt.size * np.log(scale))
    # the phase at the first step is anything from 0 to D
    phase = D * (np.arange(_PHASES) + 0.5) / _PHASES
    first = _log_student((rt[:, :1] - numbers["c"] - phase) / scale, freedom)
    second = _log_student((rt[:, 1:] - numbers["c"] - np.mod(phase - isi[:, None], D)) / scale, freedom)
    both = first + second
    largest = both.max(axis=1)
    mean = largest + np.log(np.exp(both - largest[:, None]).mean(axis=1))
    return float(mean.sum() - rt.size * np.log(scale))


def _log_student(x: Array, freedom: float) -> Array:
    """Log of Student's density."""
    size = lgamma((freedom + 1) / 2) - lgamma(freedom / 2) - 0.5 * np.log(freedom * np.pi)
    return np.asarray(size - (freedom + 1) / 2 * np.log1p(x**2 / freedom))
