"""Which family: probabilities of several families for one person, and how often they are right of synthetic people.

A classifier (bayesflow) is trained on equally many simulated people of each family, so that all are equally probable
before. Its probabilities are tempered so that they are right of people who were held out.

Groups of people: in which number they differ, and of which the data cannot tell.

Each person's posterior is taken as normal in the standard normal variable z of a number. The prior, which draws its
mean towards zero, is divided out; what is left is what the trials alone say. A person whose trials say next to nothing
is left out. Means of groups are compared with regard to the spread between people (DerSimonian and Laird) and with
Hartung and Knapp's interval; where the same people stood under both conditions, it is the differences within them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from icmj.base.array import Array
from icmj.errors import FitError
from icmj.fitting.network import Network, SeenSummaries, Tell, train
from icmj.fitting.posterior import VERSION, read_networks, write_networks

EPOCHS = 60
TOLD_APART = 0.75
"""Share of the synthetic people of two families that must be given to the right one of the two."""
ORIGIN = (
    "The figures on how far a fit can be trusted come from a test of the method on eight people who had no part in "
    "setting up the families, and on synthetic people of an independent simulator (48 trials, four families, 4,000 "
    "draws)"
)
"""Where the figures of all caveats come from."""
CAVEAT = (
    "A probability compares these families, each with the noise that it assumes, and nothing else. With other noise it "
    "names a wrong family, and a misfit is hardly ever reported (table). It rests on the 24 shares of the histograms: "
    "without them, 13 of 33 cases of real people were assigned to event and 19 to switching"
)
"""What must be known beside a probability."""
AT_ONCE = (
    "with the noise that the families assume: of people under continuous delayed PD whose noise was slowly modulated "
    "in size, 76 % were assigned to switching"
)
"""The same in a few words, for the first line."""
TRIED = (
    ("Synthetic people under", "with", "assigned to"),
    (
        ("continuous delayed PD", "noise that is slowly modulated in size", "switching: 76 % (misfit reported: 1 %)"),
        ("continuous delayed PD", "noise with a ripple of heartbeat and breathing", "clock: 48 of 60"),
        ("switched delayed PD", "broadband noise", "clock: 42 %"),
    ),
)
"""Head and rows of a table: what synthetic people were assigned to whose noise no family assumes."""
_HELD_OUT = 0.2


@dataclass(frozen=True, eq=False)
class Choice:
    """A choice among m families, for whoever comes.

    Attributes:
        families: their names.
        seen: the simulations' summaries, of all families together.
        network: the classifier.
        temperature: that its logits are divided by.
        draws: simulated people it was trained on.
    """

    families: tuple[str, ...]
    seen: SeenSummaries
    network: Network
    temperature: float
    draws: int

    def probabilities(self, S: ArrayLike) -> Array:
        """Probabilities of the families, shape (n, m), for people's trials (n, k, s), or (m,) for one's (k, s).

        Raises:
            FitError: if there are other summaries, or more trials, than it was trained on.
        """
        given = np.asarray(S, dtype=float)
        one = given.ndim == 2
        found = _softmax(self.network.logits(self.seen.pool(given[None] if one else given)) / self.temperature)
        return found[0] if one else found

    def save(self, path: Path | str, mark: str = "") -> None:
        """Write an npz file without pickles, with its digest beside it; ``mark`` says what it was trained on.

        Raises:
            FitError: if it cannot be written.
        """
        head = {
            "version": VERSION,
            "mark": mark,
            "names": self.families,
            "draws": self.draws,
            "temperature": self.temperature,
        }
        write_networks(Path(path), head, self.seen, [self.network])

    @classmethod
    def load(cls, path: Path | str, mark: str = "") -> Choice:
        """The choice of a file that :meth:`save` wrote.

        Raises:
            FitError: if it cannot be read as one, was changed, or was trained on something else than ``mark`` says.
        """
        head, seen, networks = read_networks(Path(path), "classifier", mark)
        temperature = head.get("temperature")
        if len(networks) != 1 or not (isinstance(temperature, float) and 0 < temperature < np.inf):
            raise FitError(f"{path}: not a choice among families; remove it, and it is trained again")
        return cls(tuple(head["names"]), seen, networks[0], temperature, head["draws"])


@dataclass(frozen=True, eq=False)
class Confusion:
    """What a choice makes of synthetic people, whose family is known.

    Attributes:
        families: their names.
        counts: people of a family (rows) who were given to a family (columns), the most probable; shape (m, m).
        mean: mean probability, of families (rows) by families (columns); shape (m, m).
        confidence: mean of the largest probability.
        accuracy: share of people given to their own family.
        error: standard error of the accuracy; a confidence within two of it is calibrated.
        pairs: of two families each, the share of their people who are given to the right one of the two.
    """

    families: tuple[str, ...]
    counts: Array
    mean: Array
    confidence: float
    accuracy: float
    error: float
    pairs: Mapping[tuple[str, str], float]

    @property
    def alike(self) -> tuple[tuple[str, str], ...]:
        """Pairs of families that such data cannot tell apart: fewer than ``TOLD_APART`` are given rightly."""
        return tuple(pair for pair, share in self.pairs.items() if share < TOLD_APART)

    @property
    def words(self) -> str:
        """One sentence."""
        share = f"{100 * self.accuracy:.0f} % of {int(self.counts.sum())} synthetic people"
        if not self.alike:
            return f"{share} are assigned to their own family"
        pairs = ", nor ".join(" from ".join(pair) for pair in self.alike)
        return f"{share} are assigned to their own family; such data do not distinguish {pairs}"


def train_choice(
    banks: Mapping[str, ArrayLike],
    summary_names: Sequence[str],
    *,
    seed: int = 0,
    epochs: int = EPOCHS,
    progress: Tell | None = None,
) -> Choice:
    """Train the choice among families.

    Args:
        banks: summaries of the simulated people of each family, shape (n, K, s) each; of the more numerous the first
            are taken.
        summary_names: of the summaries.
        seed: of everything random.
        epochs: at most.
        progress: called with what is under way and the fraction done.

    Raises:
        FitError: if bayesflow is missing, there is one family only, or shapes do not fit.
    """
    from scipy.optimize import minimize_scalar

    families, m = tuple(banks), len(banks)
    if m < 2:
        raise FitError("a choice needs at least two families")
    given = [np.asarray(S, dtype=float) for S in banks.values()]
    n, K = min(map(len, given)), min(S.shape[1] for S in given)
    if n < 50:
        raise FitError(f"{n} people of a family; expected at least 50")
    S = np.stack([each[:n, :K] for each in given], axis=1).reshape(n * m, K, -1)  # families by turns
    seen = SeenSummaries.of(S, summary_names)
    targets = np.tile(np.eye(m), (n, 1))
    kept = m * (n - int(_HELD_OUT * n))
    held = targets[kept:], seen.draw_pooled(S[kept:], np.random.default_rng((seed, 4)))

    def rows(generator: np.random.Generator) -> tuple[Array, Array]:
        return targets[:kept], seen.draw_pooled(S[:kept], generator)

    network = train("classifier", rows, held, seed, epochs=epochs, progress=progress)
    logits, right = network.logits(held[1]), held[0].argmax(axis=1)

    def surprise(log_temperature: float) -> float:
        p = _softmax(logits / np.exp(log_temperature))[np.arange(len(right)), right]
        return float(-np.mean(np.log(np.maximum(p, 1e-300))))

    best = minimize_scalar(surprise, bounds=(-3, 3), method="bounded")
    return Choice(families, seen, network, float(np.exp(best.x)), n * m)


def confusion(choice: Choice, people: Mapping[str, ArrayLike]) -> Confusion:
    """What a choice makes of synthetic people that it was not trained on.

    Args:
        choice: among families.
        people: summaries (n, k, s) of people of each family.

    Raises:
        FitError: if a family has no people.
    """
    m = len(choice.families)
    if set(people) != set(choice.families) or not all(len(np.asarray(S)) for S in people.values()):
        raise FitError(f"people of {', '.join(people)}; expected some of each of {', '.join(choice.families)}")
    found = [choice.probabilities(people[name]) for name in choice.families]
    counts = np.array([np.bincount(p.argmax(axis=1), minlength=m) for p in found])
    every = np.concatenate(found)
    accuracy, n = float(np.trace(counts) / len(every)), len(every)
    pairs = {}
    for i in range(m):
        for j in range(i + 1, m):
            right = np.mean(found[i][:, i] > found[i][:, j]), np.mean(found[j][:, j] > found[j][:, i])
            pairs[choice.families[i], choice.families[j]] = float(np.mean(right))
    return Confusion(
        choice.families,
        counts,
        np.array([p.mean(axis=0) for p in found]),
        float(every.max(axis=1).mean()),
        accuracy,
        float(np.sqrt(max(accuracy * (1 - accuracy), 1 / n) / n)),
        pairs,
    )


def _softmax(logits: Array) -> Array:
    e = np.exp(logits - logits.max(axis=1, keepdims=True))
    return np.asarray(e / e.sum(axis=1, keepdims=True))


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


def say_probability(p: float) -> str:
    """A probability for people: with two digits, and neither certain nor impossible."""
    return "> 0.99" if p > 0.994 else "< 0.01" if p < 0.006 else f"{p:.2f}"


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
