"""Which family: probabilities of several families for one person, and how often they are right of synthetic people.

A classifier (bayesflow) is trained on equally many simulated people of each family, so that all are equally probable
before. Its probabilities are tempered so that they are right of people who were held out.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from icmj.base.array import Array
from icmj.errors import FitError
from icmj.fits.misfit import SeenSummaries
from icmj.fits.network import Network, Tell, train
from icmj.fits.posterior import VERSION, read_networks, write_networks

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


def say_probability(p: float) -> str:
    """A probability for people: with two digits, and neither certain nor impossible."""
    return "> 0.99" if p > 0.994 else "< 0.01" if p < 0.006 else f"{p:.2f}"
