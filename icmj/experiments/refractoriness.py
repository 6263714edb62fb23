"""Refractoriness: the extra delay of the response to the second of two steps, against the interval between them.

Four estimates of the refractory duration, as van de Kamp et al. (2013) took them, each with its confidence by drawing
pairs anew within every inter-step interval.

Which kind of controller explains reaction times to pairs of steps (van de Kamp et al. 2013, figure 8).

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

from icmj.base.array import Array, is_between
from icmj.base.blas_threads import ignore_warnings
from icmj.base.card import Card, WithCard
from icmj.base.numbers import amount
from icmj.errors import DataError

LEVEL = 0.05  # of the analysis of variance and of what follows it
FEWEST, FEWEST_INTERVALS = 3, 3  # pairs of an interval; intervals
RESAMPLES, FEWEST_RESAMPLES, CONFIDENCE = 2000, 100, 0.95
ESTIMATES = ("free", "slope", "fixed", "largest", "range")
OUTLYING = 5.0  # deviations of RT1
_NORMAL = 1.4826  # standard deviations in a median deviation of normal numbers
_NOTHING = 1e-12  # s²: a line that is better by less is none
_AT_ONCE = 4_000_000  # numbers drawn at a time


@dataclass(frozen=True)
class Estimate:
    """A duration with its confidence interval.

    Attributes:
        value: estimate [s].
        low, high: 95 % confidence interval [s].
    """

    value: float
    low: float
    high: float

    def __contains__(self, value: float) -> bool:
        return self.low <= value <= self.high


@dataclass(frozen=True, eq=False, repr=False)
class Refractoriness(WithCard):
    """Mean reaction times for K inter-step intervals, and four estimates of the refractory duration.

    Attributes:
        isi: inter-step intervals [s], increasing, shape (K,).
        count: number of pairs with each interval, shape (K,).
        rt1, rt2: mean reaction times [s], shape (K,).
        rt1_error, rt2_error: their standard errors [s], shape (K,).
        rt1_mean: mean first reaction time over all pairs [s].
        free: intercept a of the line a + b ISI, which RT2 − mean RT1 follows until it reaches zero, both of the pairs
            of the same intervals; a and b are fitted.
        slope: its slope b, without a unit; −1 under a refractory period. NaN if fewer than two intervals are on the
            line.
        fixed: the intercept of the same line with b = −1.
        largest: largest interval at which RT2 is longer than RT1, by an analysis of variance followed by Welch's tests
            with Holm's correction, at 5 % in total; 0 s if there is none.
        range: largest minus smallest mean RT2, which is less than the duration by the shortest interval tested.
        p: p-value of the analysis of variance (RT1 of all pairs, RT2 of each interval).
        discarded: number of pairs that were left out, because they have no reaction times or an outlying RT1.
    """

    isi: Array
    count: np.ndarray
    rt1: Array
    rt2: Array
    rt1_error: Array
    rt2_error: Array
    rt1_mean: float
    free: Estimate
    slope: Estimate
    fixed: Estimate
    largest: Estimate
    range: Estimate
    p: float
    discarded: int = field(default=0)

    def card(self) -> Card:
        """Its representation at a prompt or in a notebook."""
        names = {"free": "free regression", "fixed": "slope −1", "largest": "largest ISI", "range": "range of RT2"}
        rows = [("mean RT1", amount(self.rt1_mean, "s", 4))]
        for name, words in names.items():
            found = getattr(self, name)
            rows.append((words, f"{amount(found.value, 's', 4)} ({found.low:.3g} to {found.high:.3g})"))
        line = f"refractory for {self.fixed.value:.3g} s ({self.fixed.low:.3g} to {self.fixed.high:.3g}, slope −1)"
        return Card(f"{int(self.count.sum())} pairs at {len(self.isi)} intervals, {line}", tuple(rows))


def refractoriness(
    isi: ArrayLike,
    rt: ArrayLike,
    *,
    alike: float = 0.015,
    shortest: float = 0.0,
    outlying: float = OUTLYING,
    seed: int = 0,
    resamples: int = RESAMPLES,
) -> Refractoriness:
    """The refractory duration, from reaction times to pairs of steps.

    Args:
        isi: inter-step interval of each pair [s], shape (P,).
        rt: reaction times to first and second step [s], shape (P, 2), such as those of
            :func:`icmj.experiments.reconstruct_steps`; pairs with NaN are left out.
        alike: intervals that differ by at most this count as equal [s]; in a record they are known to one sampling
            interval.
        shortest: shortest interval that ``free``, ``fixed`` and ``largest`` use, of RT1 as of RT2 [s]; the steps of
            shorter ones may be within one sampling delay, where RT1 is another, too.
        outlying: pairs are left out if their RT1 deviates from the median by more than this number of standard
            deviations (estimated from the median deviation) and by more than ``alike``: a person who had just sampled
            was refractory at the first step.
        seed: seed of the resampling for the confidence intervals.
        resamples: number of resamples of the pairs.

    Raises:
        DataError: if shapes do not fit together, there are fewer than three intervals, or fewer than three pairs of
            one interval.
    """
    if resamples < FEWEST_RESAMPLES:
        raise DataError(f"{resamples} resamples; expected at least {FEWEST_RESAMPLES} for a confidence interval")
    each, times = usual(*reactions(isi, rt), outlying, alike)
    values, which = group_intervals(each, alike)
    if (left := int(is_between(values, shortest).sum())) < FEWEST_INTERVALS:
        raise DataError(
            f"{left} inter-step intervals of {shortest:g} s or more; expected at least "
            f"{FEWEST_INTERVALS} to estimate a trend"
        )
    count = np.bincount(which)
    if count.min() < FEWEST:
        at = values[int(np.argmin(count))]
        raise DataError(
            f"{count.min()} pairs with reaction times at an inter-step interval of {at:g} s; expected at least {FEWEST}"
        )
    of = [times[which == k] for k in range(len(values))]
    mean = np.array([part.mean(axis=0) for part in of])
    error = np.array([part.std(axis=0, ddof=1) / np.sqrt(len(part)) for part in of])
    found = _estimates(values, shortest, *_moments([part[None] for part in of]))
    drawn = _resample(values, shortest, of, np.random.default_rng(seed), resamples)
    tail = (1 - CONFIDENCE) / 2
    with ignore_warnings():  # where no line is, it has no slope
        low, high = np.nanquantile(drawn, [tail, 1 - tail], axis=0)
    estimates = (Estimate(*map(float, of)) for of in zip(found[0], low, high, strict=True))
    return Refractoriness(
        isi=values,
        count=count,
        rt1=mean[:, 0],
        rt2=mean[:, 1],
        rt1_error=error[:, 0],
        rt2_error=error[:, 1],
        rt1_mean=float(times[:, 0].mean()),
        **dict(zip(ESTIMATES, estimates, strict=True)),
        p=_variance_p(times[:, 0], [part[:, 1] for part in of]),
        discarded=len(np.asarray(isi)) - len(each),
    )


def reactions(isi: ArrayLike, rt: ArrayLike) -> tuple[Array, Array]:
    """Intervals (P,) and reaction times (P, 2) [s] of the pairs that have them.

    Raises:
        DataError: if shapes do not fit.
    """
    each, times = np.asarray(isi, dtype=float), np.asarray(rt, dtype=float)
    if each.ndim != 1 or times.shape != (len(each), 2):
        raise DataError(f"inter-step intervals {each.shape} and reaction times {times.shape}; expected (P,) and (P, 2)")
    good = np.isfinite(times).all(axis=1) & np.isfinite(each)
    return each[good], times[good]


def usual(isi: Array, rt: Array, outlying: float, least: float) -> tuple[Array, Array]:
    """The pairs whose first reaction time is not far from the others'."""
    away = np.abs(rt[:, 0] - np.median(rt[:, 0])) if len(rt) else np.zeros(0)
    kept = is_between(away, 0.0, max(outlying * _NORMAL * float(np.median(away)) if len(rt) else 0.0, least))
    return isi[kept], rt[kept]


def group_intervals(isi: Array, alike: float) -> tuple[Array, np.ndarray]:
    """Intervals that are the same but for how exactly times are known, as one: (K,) [s], and which each is (P,)."""
    order = np.argsort(isi, kind="stable")
    new = ~is_between(np.diff(isi[order], prepend=-np.inf), 0.0, alike)
    which = np.empty(len(isi), dtype=int)
    which[order] = np.cumsum(new) - 1
    return np.array([isi[which == k].mean() for k in range(int(new.sum()))]), which


def _moments(groups: list[Array]) -> tuple[Array, ...]:
    """Of draws of each interval (D, n_k, 2): counts (K,), means (D, K, 2), variances (D, K, 2)."""
    count = np.array([part.shape[1] for part in groups])
    mean = np.stack([part.mean(axis=1) for part in groups], axis=1)
    variance = np.stack([part.var(axis=1, ddof=1) for part in groups], axis=1)
    return count, mean, variance


def _resample(values: Array, shortest: float, of: list[Array], random: np.random.Generator, resamples: int) -> Array:
    """The estimates of pairs drawn anew, shape (resamples, 5)."""
    some = max(min(resamples, _AT_ONCE // max(sum(map(len, of)), 1)), 1)
    found = []
    for first in range(0, resamples, some):
        many = min(some, resamples - first)
        groups = [part[random.integers(len(part), size=(many, len(part)))] for part in of]
        found.append(_estimates(values, shortest, *_moments(groups)))
    return np.concatenate(found) if found else np.zeros((0, 5))


def _estimates(isi: Array, shortest: float, count: np.ndarray, mean: Array, variance: Array) -> Array:
    """Free intercept, its slope, that of slope −1, largest interval, and range; shape (D, 5)."""
    span, seen = np.ptp(mean[:, :, 1], axis=1), is_between(isi, shortest)
    isi, count, mean, variance = isi[seen], count[seen], mean[:, seen], variance[:, seen]
    later = mean[:, :, 1] - (mean[:, :, 0] @ (count / count.sum()))[:, None]
    free, slope = _broken_line(isi, later)
    return np.column_stack([free, slope, _fixed_line(isi, later), _largest(isi, count, mean, variance), span])


def _broken_line(isi: Array, later: Array) -> tuple[Array, Array]:
    """a and b of max(0, a + b ISI), b ≤ 0, nearest to ``later`` (D, K): by least squares over the first intervals.

    Each number of intervals on the line is tried; with one, or none, no line is there: (0, NaN).
    """
    best, found = (later**2).sum(axis=1), np.full((2, len(later)), np.nan)
    found[0] = 0.0
    for m in range(2, len(isi) + 1):
        x, y = isi[:m] - isi[:m].mean(), later[:, :m]
        b = np.minimum((y @ x) / (x @ x), 0.0)
        a = y.mean(axis=1) - b * isi[:m].mean()
        missed = ((later - np.maximum(a[:, None] + b[:, None] * isi, 0.0)) ** 2).sum(axis=1)
        better = (best - missed > _NOTHING) & (a > 0) & (b < 0)
        best = np.where(better, missed, best)
        found = np.where(better, [a, b], found)
    return found[0], found[1]


def _fixed_line(isi: Array, later: Array) -> Array:
    """a of max(0, a − ISI) nearest to ``later`` (D, K); 0 where no line is better: none shows up to the least ISI."""
    best, found = (later**2).sum(axis=1), np.zeros(len(later))
    for m in range(1, len(isi) + 1):
        a = (later[:, :m] + isi[:m]).mean(axis=1)
        missed = ((later - np.maximum(a[:, None] - isi, 0.0)) ** 2).sum(axis=1)
        better = best - missed > _NOTHING
        best, found = np.where(better, missed, best), np.where(better, a, found)
    return found


def _largest(isi: Array, count: np.ndarray, mean: Array, variance: Array) -> Array:
    """Largest interval at which RT2 is longer than RT1, after an analysis of variance; 0 where none is; shape (D,)."""
    from scipy.stats import t as student

    n, (m1, m2), (v1, v2) = count.sum(), np.moveaxis(mean, 2, 0), np.moveaxis(variance, 2, 0)
    all1 = m1 @ count / n
    within = v1 @ (count - 1) + ((m1 - all1[:, None]) ** 2) @ count
    var1 = within / (n - 1)
    differ = _p_of(all1, n, within, m2, count, v2 @ (count - 1)) < LEVEL
    a, b = (var1 / n)[:, None] + 0 * v2, v2 / count
    size = np.sqrt(np.maximum(a + b, 1e-24))
    freedom = np.maximum((a + b) ** 2, 1e-48) / np.maximum(a**2 / (n - 1) + b**2 / (count - 1), 1e-48)
    p = student.sf((m2 - all1[:, None]) / size, np.maximum(freedom, 1.0))
    order = np.argsort(p, axis=1, kind="stable")
    held = np.take_along_axis(p, order, axis=1) * np.arange(len(isi), 0, -1) >= LEVEL
    rejected = np.zeros(p.shape, dtype=bool)
    np.put_along_axis(rejected, order, np.cumsum(held, axis=1) == 0, axis=1)
    return np.where(rejected & differ[:, None], isi, 0.0).max(axis=1)


def _variance_p(first: Array, seconds: list[Array]) -> float:
    """p of the analysis of variance of RT1 of all pairs and RT2 of each interval."""
    count = np.array([len(part) for part in seconds])
    mean = np.array([[part.mean() for part in seconds]])
    within = np.array([sum(float(((part - part.mean()) ** 2).sum()) for part in seconds)])
    own = np.array([((first - first.mean()) ** 2).sum()])
    return float(_p_of(np.array([first.mean()]), len(first), own, mean, count, within)[0])


def _p_of(mean1: Array, n1: int, own: Array, means: Array, count: np.ndarray, within: Array) -> Array:
    """p of one-way analyses of variance (D,), from means, counts and sums of squares within the groups."""
    from scipy.stats import f as fisher

    n = np.append(n1, count)
    all_means = np.column_stack([mean1, means])
    grand = all_means @ n / n.sum()
    across = ((all_means - grand[:, None]) ** 2) @ n / len(count)
    left = np.maximum((own + within) / (n.sum() - len(n)), 1e-24)
    return np.asarray(fisher.sf(across / left, len(count), n.sum() - len(n)))


KINDS = {
    "continuous": "continuous and linear: RT1 = RT2 = c",
    "event": "triggered by events: RT1 = c, RT2 = c + max(0, D − ISI)",
    "clock": "driven by a clock of interval D: both RT from c to c + D, and responses a multiple of D apart",
    "sampling": "triggered by events, sampled d_s later: RT1 = c; RT2 = c − ISI until d_s, then as by events",
}
MARGIN = 10.0  # of Bayes' criterion: very strong evidence by Kass and Raftery's (1995) scale
FEWEST_PAIRS = 12  # pairs
_TICKS = 3  # resolutions that the interval of a clock has at least: a spread of a row or two is that of reading times
_FREEDOMS, _GRID, _PHASES = (4.0, 100.0), 48, 64


@dataclass(frozen=True, eq=False, repr=False)
class Explanation(WithCard):
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
        resolution: accuracy of the reaction times [s], such as the sampling interval: the smallest scale of the noise,
            and a third of the shortest interval of a clock.

    Raises:
        DataError: if shapes do not fit together, or there are too few pairs.
    """
    if not (np.isfinite(resolution) and resolution > 0):
        raise DataError(f"a resolution of {resolution:g} s; expected a positive one, such as the sampling interval")
    each, times = usual(*reactions(isi, rt), OUTLYING, 2 * resolution)
    if len(each) < FEWEST_PAIRS:
        raise DataError(
            f"{len(each)} pairs with reaction times; expected at least {FEWEST_PAIRS} to distinguish controllers"
        )
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


DIRECTIONS = ("same direction", "reversal")
_CLASSIFIED = {"clock": "clock-driven", "event": "event-driven", "sampling": "event-driven with delayed sampling"}


@dataclass(frozen=True, eq=False)
class Reactions:
    """What the reaction times of some pairs of steps say.

    Attributes:
        refractory: refractory duration, by four estimates.
        explanation: the kind of controller that explains the reaction times.
        resolution: accuracy of the reaction times [s].
    """

    refractory: Refractoriness
    explanation: Explanation
    resolution: float

    def agrees(self, other: Reactions) -> bool:
        """Whether both are of one kind, and the intervals of ``fixed`` overlap but for what times are known to."""
        one, two = self.refractory.fixed, other.refractory.fixed
        apart = max(one.low, two.low) - min(one.high, two.high)
        return self.explanation.kind == other.explanation.kind and apart < 1.5 * max(self.resolution, other.resolution)

    @property
    def numbers(self) -> dict[str, float]:
        """The estimates with their intervals [s], and by how much each criterion exceeds the least."""
        found = self.refractory
        numbers = {"mean RT1 (s)": found.rt1_mean}
        for name, one in (
            ("free regression", found.free),
            ("slope −1", found.fixed),
            ("largest ISI", found.largest),
            ("range of RT2", found.range),
        ):
            numbers |= {f"{name} (s)": one.value, f"{name}, from (s)": one.low, f"{name}, to (s)": one.high}
        least = min(self.explanation.bic.values())
        return numbers | {f"BIC, {kind}": self.explanation.bic[kind] - least for kind in KINDS}

    @property
    def curves(self) -> dict[str, Array]:
        """Mean reaction times and their errors [s] at each interval, shape (K,) each."""
        found = self.refractory
        return {
            "ISI (s)": found.isi,
            "pairs": found.count.astype(float),
            "RT1 (s)": found.rt1,
            "RT1, error (s)": found.rt1_error,
            "RT2 (s)": found.rt2,
            "RT2, error (s)": found.rt2_error,
        }

    @property
    def words(self) -> str:
        """The verdict, without a full stop."""
        one = self.refractory.fixed
        refractory = (
            f"a refractory period of {one.value:.3g} s (95 % interval {one.low:.3g} to {one.high:.3g} s)"
            if one.low > 0 and self.explanation.kind != "continuous"
            else f"no refractory period above {self.refractory.isi.min():.3g} s"
        )
        kind, pairs = _CLASSIFIED.get(self.explanation.kind, self.explanation.kind), int(self.refractory.count.sum())
        if self.explanation.kind == "clock":
            kind = f"{kind}, with an interval of {self.explanation.parameters['clock']['D']:.3g} s"
        return f"classified as {kind}; {refractory}, from {pairs} pairs of steps"


def analyse_reactions(isi: ArrayLike, rt: ArrayLike, resolution: float, shortest: float = 0.0) -> Reactions:
    """The kind of controller and the refractory duration, from reaction times to pairs of steps.

    Args:
        isi: inter-step interval of each pair [s], shape (P,).
        rt: reaction times to first and second step [s], shape (P, 2).
        resolution: accuracy of the reaction times [s], such as the sampling interval.
        shortest: as of :func:`icmj.refractoriness`; at least the sampling delay, if there is one.

    Raises:
        DataError: if shapes do not fit together, or there are too few pairs or intervals.
    """
    each, told = np.asarray(isi, dtype=float), explain_reactions(isi, rt, resolution)
    if told.kind == "sampling":  # what falls into one sample is no refractoriness
        late = told.parameters["sampling"]["d_s"]
        beyond = group_intervals(each[each >= late], 1.5 * resolution)[0]
        shortest = max(shortest, late) if len(beyond) >= FEWEST_INTERVALS else shortest
    return Reactions(refractoriness(each, rt, alike=1.5 * resolution, shortest=shortest), told, resolution)


def _best(kind: str, freedom: float, isi: Array, rt: Array, resolution: float) -> tuple[float, dict[str, float]]:
    """The largest log-likelihood of a kind, and the numbers that have it."""
    from scipy.optimize import minimize

    durations = np.geomspace(max((_TICKS if kind == "clock" else 2) * resolution, 0.02), 1.5, _GRID)
    starts: list[dict[str, float]] = [{}]
    if kind != "continuous":
        starts = [{"D": D} for D in durations]
    if kind == "sampling":
        starts = [{"D": D, "d_s": d_s} for D in durations[::2] for d_s in D * np.linspace(0.1, 0.9, 9)]
    best = max((_start(kind, freedom, start, isi, rt, resolution) for start in starts), key=lambda pair: pair[0])
    names = list(best[1])

    def cost(numbers: Array) -> float:
        return -_likelihood(kind, freedom, dict(zip(names, numbers, strict=True)), isi, rt, resolution)

    at = np.array([best[1][name] for name in names])
    simplex = at + np.vstack([np.zeros(len(at)), np.diag(0.05 * np.maximum(np.abs(at), resolution))])
    polished = minimize(cost, at, method="Nelder-Mead", options={"initial_simplex": simplex, "maxfev": 400})
    if -polished.fun > best[0]:
        best = -float(polished.fun), dict(zip(names, map(float, polished.x), strict=True))
    return best


def _start(
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
    least = _TICKS * resolution if kind == "clock" else 0.0
    if scale < resolution / 2 or D <= 0 or least > D or not 0 <= d_s < D:
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
