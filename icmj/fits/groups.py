"""Groups of people: in which number they differ, and of which the data cannot tell.

Each person's posterior is taken as normal in the standard normal variable z of a number. The prior, which draws its
mean towards zero, is divided out; what is left is what the trials alone say. A person whose trials say next to nothing
is left out. Means of groups are compared with regard to the spread between people (DerSimonian and Laird) and with
Hartung and Knapp's interval; where the same people stood under both conditions, it is the differences within them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import ArrayLike

from icmj.base.array import Array
from icmj.errors import FitError

_SAYS_NOTHING = 0.95  # of the prior's variance that the posterior has
_LEAST = 3  # people of a group
_SIGNIFICANT = 0.05


@dataclass(frozen=True)
class Difference:
    """One number, compared between two groups.

    Attributes:
        name: of the number.
        groups: which two.
        people: how many of each have something to say.
        paired: whether the same people are in both.
        means: of the groups, in z.
        value: second less first, in z: standard deviations of the prior.
        low, high: its confidence interval of 95 %.
        p: that a difference as large arises where there is none.
        holm: the same, for all numbers and pairs that were compared (Holm).
        verdict: ``differs``, ``no difference found`` or ``no conclusion``.
        words: one sentence.
    """

    name: str
    groups: tuple[str, str]
    people: tuple[int, int]
    paired: bool
    means: tuple[float, float]
    value: float
    low: float
    high: float
    p: float
    holm: float
    verdict: str
    words: str


def compare(
    names: Sequence[str],
    means: ArrayLike,
    variances: ArrayLike,
    groups: Sequence[str],
    people: Sequence[str],
    identified: Sequence[str],
) -> tuple[Difference, ...]:
    """Compare every number between every two groups.

    Args:
        names: of the p numbers.
        means, variances: of the posteriors in z, shape (n, p).
        groups: of the n posteriors.
        people: whose they are.
        identified: numbers that are; of the others nothing is said.

    Raises:
        FitError: if shapes do not fit, or one person is twice in a group.
    """
    m, v = np.asarray(means, dtype=float), np.asarray(variances, dtype=float)
    n = len(groups)
    if m.shape != (n, len(names)) or v.shape != m.shape or len(people) != n:
        raise FitError(f"posteriors of shape {m.shape}; expected ({n}, {len(names)})")
    if len(set(zip(groups, people, strict=True))) < n:
        raise FitError("a person appears twice in one group; give all trials of a person and condition as one")
    found = [
        _difference(name, pair, m[:, i], v[:, i], groups, people, name in identified)
        for pair in combinations(sorted(set(groups)), 2)
        for i, name in enumerate(names)
    ]
    told = sorted((one for one in found if np.isfinite(one.p)), key=lambda one: one.p)
    holm, least = {}, 0.0
    for rank, one in enumerate(told):
        least = max(least, min(1.0, (len(told) - rank) * one.p))
        holm[one.groups, one.name] = least
    return tuple(_judge(one, holm.get((one.groups, one.name), np.nan)) for one in found)


def _difference(
    name: str,
    pair: tuple[str, str],
    m: Array,
    v: Array,
    groups: Sequence[str],
    people: Sequence[str],
    identified: bool,
) -> Difference:
    said: list[dict[str, tuple[float, float]]] = []
    for group in pair:
        here = [i for i, one in enumerate(groups) if one == group and v[i] < _SAYS_NOTHING]
        said.append({people[i]: (m[i] / (1 - v[i]), v[i] / (1 - v[i])) for i in here})
    counts = len(said[0]), len(said[1])
    both = sorted(said[0].keys() & said[1].keys())
    paired = len(both) >= _LEAST and len(both) == max(counts)
    nan = float("nan")
    if not identified or min(counts) < _LEAST:
        return Difference(name, pair, counts, paired, (nan, nan), nan, nan, nan, nan, nan, "", "")
    first, second = (np.array(list(one.values())).T for one in said)
    a, b = _mean(*first), _mean(*second)
    if paired:
        x = np.array([said[1][who][0] - said[0][who][0] for who in both])
        d, error, freedom = _mean(x, np.array([said[1][who][1] + said[0][who][1] for who in both]))
    else:
        d, error = b[0] - a[0], float(np.hypot(a[1], b[1]))
        freedom = error**4 / (a[1] ** 4 / a[2] + b[1] ** 4 / b[2])  # Welch and Satterthwaite
    from scipy.stats import t

    reach = float(t.ppf(0.975, freedom)) * error
    p = float(2 * t.sf(abs(d) / error, freedom))
    return Difference(name, pair, counts, paired, (a[0], b[0]), d, d - reach, d + reach, p, nan, "", "")


def _mean(x: Array, variance: Array) -> tuple[float, float, float]:
    """The mean of people who differ, its standard error, and degrees of freedom."""
    n, w = len(x), 1 / variance
    centre = w @ x / w.sum()
    between = max(0.0, (w @ (x - centre) ** 2 - (n - 1)) / (w.sum() - (w @ w) / w.sum()))
    w = 1 / (variance + between)
    mean = float(w @ x / w.sum())
    scale = max(1.0, float(w @ (x - mean) ** 2) / (n - 1))  # never narrower than the posteriors say
    return mean, float(np.sqrt(scale / w.sum())), n - 1.0


def _judge(one: Difference, holm: float) -> Difference:
    from dataclasses import replace

    first, second = one.groups
    if not np.isfinite(one.p):
        few = min(one.people) < _LEAST
        why = f"recordings of fewer than {_LEAST} people of a group constrain it" if few else "it is not identified"
        return replace(one, verdict="no conclusion", words=f"{one.name}: no conclusion, because {why}")
    interval = f"{one.value:+.2f} ({one.low:+.2f} to {one.high:+.2f}) deviations of the prior from {first} to {second}"
    verdict = "differs" if holm < _SIGNIFICANT else "no difference found"
    ruled = "" if verdict == "differs" else "; a difference within this interval is not ruled out"
    return replace(one, holm=holm, verdict=verdict, words=f"{one.name}: {verdict}, {interval}, p {holm:.2g}{ruled}")
