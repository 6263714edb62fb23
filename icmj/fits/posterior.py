"""The posterior: what a person's trials say of a family's parameters, by networks that serve for all people.

A coupling flow is trained on simulated people (bayesflow). It is shown the mean of their trials' summaries, and how
many there are, from one to all that were simulated; so it is ready for whoever stood one trial or three. Of numbers it
knows the standard normal variables z that the family's prior makes of them, one each. A single flow is too certain
where few simulated people resemble the person; the posterior is therefore a mixture of several flows with equal
weights, each trained from another start and with other people held out, as wide as still others ask for.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields, replace
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from icmj.base.array import Array
from icmj.base.npz import read_npz
from icmj.base.text import one_line, parse_json
from icmj.errors import FitError
from icmj.fits.calibration import MASS
from icmj.fits.misfit import Misfit, SeenSummaries
from icmj.fits.network import Network, Tell, train
from icmj.work.folder import Folder

CALIBRATION_CAVEAT = (
    "A parameter near the threshold of the verdict may be called identified in one run, and not identified in another "
    "with another seed"
)
"""What must be known beside a verdict."""


EPOCHS = 80
MEMBERS = 4
"""Flows of a posterior."""
_HELD_OUT = 0.15
_LEAST = 100  # simulated people
_MOST_BYTES = 2e8
VERSION = 3


@dataclass(frozen=True, eq=False)
class Posterior:
    """The posterior of p numbers, for whoever comes.

    Attributes:
        names: of the p numbers.
        seen: the simulations' summaries.
        networks: the flows, of which the posterior is the mixture with equal weights.
        draws: simulated people it was trained on.
    """

    names: tuple[str, ...]
    seen: SeenSummaries
    networks: tuple[Network, ...]
    draws: int

    def sample(self, S: ArrayLike, draws: int = 2000, seed: int = 0) -> Array:
        """Draws from the posterior of one person.

        Args:
            S: summaries of the person's k trials, shape (k, s).
            draws: how many.
            seed: of them.

        Returns:
            z, shape (draws, p); independent of each other.

        Raises:
            FitError: if there are other summaries, or more trials, than it was trained on.
        """
        return self.sample_all(np.asarray(S, dtype=float)[None], draws, seed)[0]

    def sample_all(self, S: ArrayLike, draws: int = 500, seed: int = 0) -> Array:
        """Draws of several people with equally many trials (n, k, s), shape (n, draws, p)."""
        conditions = self.seen.pool(S)
        p, n = len(self.names), len(conditions)
        found = np.random.default_rng((seed, 3)).standard_normal((n, draws, p))
        for i, network in enumerate(self.networks):  # by turns, so that the first draws are of all
            normal = found[:, i :: len(self.networks)]
            given = np.repeat(conditions, normal.shape[1], axis=0)
            if len(given):
                normal[:] = network.invert(normal.reshape(-1, p), given).reshape(normal.shape)
        return found

    def log_density(self, z: ArrayLike, S: ArrayLike) -> Array:
        """Logarithm of the posterior's density at z (n, p) for one person's trials (k, s), shape (n,)."""
        given = np.asarray(z, dtype=float)
        conditions = self.seen.pool(np.asarray(S, dtype=float)[None])
        repeated = np.repeat(conditions, len(given), axis=0)
        every = np.array([network.log_density(given, repeated) for network in self.networks])
        most = every.max(axis=0)
        return np.asarray(most + np.log(np.exp(every - most).mean(axis=0)))

    def misfit(self, S: ArrayLike) -> Misfit:
        """Whether a person's trials (k, s) lie where something was simulated."""
        return self.seen.misfit(S)

    def support(self, z: ArrayLike, S: ArrayLike) -> float:
        """How many of the simulated people the posterior of one person rests on, of those with the numbers z (n, p).

        It is their effective sample size, weighted by the posterior's density over the prior's: of those on whom it was
        trained, how many resemble this person. The posterior's own draws are independent of each other.
        """
        given = np.asarray(z, dtype=float)
        return effective(self.log_density(given, S) + 0.5 * np.sum(given**2, axis=1))

    def rescale(self, z: ArrayLike, S: ArrayLike, seed: int = 0) -> Posterior:
        """The posterior as wide as people ask for that it was not trained on: all temperatures times one factor.

        With it, central intervals of 90 % hold 90 % of their numbers, on average over the numbers. A mixture of flows
        that are each as wide as they should be is wider.

        Args:
            z: the people's numbers, shape (n, p).
            S: summaries of their trials, shape (n, K, s); one of them is shown of the first person, two of the second,
                … K, and so on.
            seed: of the draws.
        """
        from scipy.stats import norm

        truth, given = np.asarray(z, dtype=float), np.asarray(S, dtype=float)
        K, found, edge = given.shape[1], self, (1 + MASS) / 2
        for _ in range(3):  # were it normal, one would do
            ranks = []
            for k in range(1, K + 1):
                drawn = found.sample_all(given[k - 1 :: K, :k], 299, seed)
                ranks.append((drawn < truth[k - 1 :: K, None]).mean(axis=1))
            held = np.mean(np.abs(2 * np.concatenate(ranks) - 1) <= MASS)
            factor = norm.ppf(edge) / norm.ppf(np.clip((1 + held) / 2, 0.6, 0.9995))
            found = replace(found, networks=tuple(network.scaled(float(factor)) for network in found.networks))
        return found

    def save(self, path: Path | str, mark: str = "") -> None:
        """Write an npz file without pickles, with its digest beside it; ``mark`` says what it was trained on.

        Raises:
            FitError: if it cannot be written.
        """
        head = {"version": VERSION, "mark": mark, "names": self.names, "draws": self.draws}
        write_networks(Path(path), head, self.seen, self.networks)

    @classmethod
    def mixture(cls, members: Sequence[Posterior]) -> Posterior:
        """The mixture of posteriors that were trained on the same people."""
        first = members[0]
        return cls(first.names, first.seen, tuple(net for one in members for net in one.networks), first.draws)

    @classmethod
    def load(cls, path: Path | str, mark: str = "") -> Posterior:
        """The posterior of a file that :meth:`save` wrote.

        Raises:
            FitError: if it cannot be read as one, was changed, or was trained on something else than ``mark`` says.
        """
        head, seen, networks = read_networks(Path(path), "flow", mark)
        return cls(tuple(head["names"]), seen, networks, head["draws"])


def effective(log_weights: ArrayLike) -> float:
    """The effective sample size (Σw)²/Σw² of weights by their logarithms."""
    logs = np.asarray(log_weights, dtype=float)
    w = np.exp(logs - logs.max())
    return float(w.sum() ** 2 / (w @ w))


def train_posterior(
    z: ArrayLike,
    S: ArrayLike,
    names: Sequence[str],
    summary_names: Sequence[str],
    *,
    seed: int = 0,
    member: int = 0,
    epochs: int = EPOCHS,
    depth: int = 3,
    progress: Tell | None = None,
) -> Posterior:
    """Train one flow of the posterior of a family on simulated people; :meth:`Posterior.mixture` joins several.

    Args:
        z: their numbers as standard normal variables, shape (n, p).
        S: summaries of K trials of each, shape (n, K, s).
        names, summary_names: of the numbers and the summaries.
        seed: of everything random.
        member: which flow; each starts elsewhere and has other people held out.
        epochs: at most; it ends when a seventh of the people, held out, says that it learns no more.
        depth: layers of the flow.
        progress: called with what is under way and the fraction done.

    Raises:
        FitError: if bayesflow is missing, there are fewer than a hundred people, or shapes do not fit.
    """
    numbers, given = np.asarray(z, dtype=float), np.asarray(S, dtype=float)
    if numbers.ndim != 2 or numbers.shape[1] != len(names) or len(names) < 2:
        raise FitError(f"numbers of shape {numbers.shape}; expected (people, {len(names)}), two numbers at least")
    if len(numbers) != len(given) or len(numbers) < _LEAST:
        raise FitError(f"{len(numbers)} people, {len(given)} of them with summaries; expected at least {_LEAST}")
    seen = SeenSummaries.of(given, summary_names)
    out = max(int(_HELD_OUT * len(numbers)), 1)
    kept = len(numbers) - out
    numbers, given = (np.roll(each, member * out, axis=0) for each in (numbers, given))
    apart = np.random.default_rng((seed, 4))
    held = (
        np.concatenate([numbers[kept:]] * 2),
        np.concatenate([seen.draw_pooled(given[kept:], apart) for _ in range(2)]),
    )

    def rows(generator: np.random.Generator) -> tuple[Array, Array]:
        return numbers[:kept], seen.draw_pooled(given[:kept], generator)

    started = seed + 1_000_003 * member
    network = train("flow", rows, held, started, epochs=epochs, depth=depth, progress=progress)
    return Posterior(tuple(names), seen, (network.temper(*held),), len(numbers))


def write_networks(path: Path, head: dict[str, Any], seen: SeenSummaries, networks: Sequence[Network]) -> None:
    """Write networks, and what they have seen, as npz; ``head`` has ``version``, ``mark``, ``names`` and ``draws``.

    Raises:
        FitError: if it cannot be written.
    """
    text = json.dumps({**head, "summaries": seen.names, "networks": [network.head() for network in networks]})
    arrays = {f"seen.{name}": value for name, value in asdict(seen).items() if name != "names"}
    for i, network in enumerate(networks):
        arrays |= {f"network{i}.{name}": value for name, value in network.arrays().items()}
    with _folder(path).seal(path) as part, part.open("wb") as stream:
        np.savez(stream, head=np.array(text), **arrays)


def read_networks(path: Path, kind: str, mark: str) -> tuple[dict[str, Any], SeenSummaries, tuple[Network, ...]]:
    """Head, seen summaries and networks of such a file; the targets of each network are those that the head names.

    Raises:
        FitError: if it cannot be read, was changed, or holds networks of another kind or mark.
    """

    def parse(content: bytes) -> tuple[dict[str, Any], SeenSummaries, tuple[Network, ...]]:
        arrays = read_npz(BytesIO(content), _MOST_BYTES)
        head = parse_json(str(arrays.pop("head")))
        if head["version"] != VERSION or head["mark"] != mark or any(one["kind"] != kind for one in head["networks"]):
            raise ValueError(f"no {kind} of this version and of these simulations")
        names, summaries = (tuple(map(_word, head[key])) for key in ("names", "summaries"))
        if type(head["draws"]) is not int or head["draws"] < 1 or not head["networks"]:
            raise ValueError("trained on nothing")
        seen = SeenSummaries(summaries, *(arrays[f"seen.{field.name}"] for field in fields(SeenSummaries)[1:]))
        seen.refuse_unsound()
        networks = []
        for i, each in enumerate(head["networks"]):
            start = f"network{i}."
            inner = {name.removeprefix(start): value for name, value in arrays.items() if name.startswith(start)}
            networks.append(Network.of(each, inner, len(names), len(summaries) + 1))
        return head, seen, tuple(networks)

    return _folder(path).read(path, _MOST_BYTES, parse)


def _folder(path: Path) -> Folder:
    return Folder(path.parent, FitError, "trained")


def _word(text: object) -> str:
    if not isinstance(text, str):
        raise TypeError(f"{one_line(text, 40)} is not a name")
    return text


PREDICTION_CAVEAT = (
    "The 90 % prediction of a third trial covered 82 % (event), 78 % (clock), 84 % (switching) and 69 % (delayed-pd) "
    "of the values of eight people who had no part in setting up the families, and was no sharper than the mean of the "
    "other two trials"
)
"""What must be known beside a prediction (:data:`icmj.fits.choice.ORIGIN`)."""
