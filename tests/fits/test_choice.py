"""The choice among families against Bayes factors that are known."""

import numpy as np
import pytest

from icmj.errors import FitError
from icmj.fits.choice import Choice, confusion, say_probability, train_choice

NAMES = ("a", "b")
MEANS = {"left": -0.7, "right": 0.7, "twin": 0.7}


def people(family: str, n: int, seed: int) -> np.ndarray:
    """Two trials of n people: two Gaussian summaries with the family's mean."""
    generator = np.random.default_rng((seed, *family.encode()))
    return MEANS[family] + generator.normal(size=(n, 2, 2))


@pytest.fixture(scope="module")
def choice() -> Choice:
    return train_choice({name: people(name, 6000, 1) for name in MEANS}, NAMES, seed=3, epochs=15)


@pytest.mark.slow
@pytest.mark.parametrize("k", [1, 2])
def test_probabilities_are_bayes(choice: Choice, k: int) -> None:
    S = np.concatenate([people(name, 100, 2) for name in MEANS])[:, :k]
    log = np.array([-0.5 * ((S - mean) ** 2).sum(axis=(1, 2)) for mean in MEANS.values()])
    exact = np.exp(log) / np.exp(log).sum(axis=0)
    found = choice.probabilities(S).T
    assert np.abs(found - exact).mean() < 0.04
    assert np.corrcoef(found[0], exact[0])[0, 1] > 0.99


@pytest.mark.slow
def test_confusion_and_twins(choice: Choice, tmp_path) -> None:
    found = confusion(choice, {name: people(name, 300, 4) for name in MEANS})
    assert found.alike == (("right", "twin"),)
    assert "do not distinguish right from twin" in found.words
    assert found.counts.sum() == 900
    assert found.counts[0, 0] > 250
    assert abs(found.confidence - found.accuracy) < 3 * found.error  # calibrated
    assert np.allclose(found.mean.sum(axis=1), 1)
    choice.save(tmp_path / "choice.npz")
    S = people("left", 1, 5)[0]
    assert np.array_equal(Choice.load(tmp_path / "choice.npz").probabilities(S), choice.probabilities(S))


def test_one_family_is_no_choice() -> None:
    with pytest.raises(FitError, match="at least two families"):
        train_choice({"left": people("left", 100, 1)}, NAMES)
    with pytest.raises(FitError, match="49 people"):
        train_choice({name: people(name, 49, 1) for name in MEANS}, NAMES)


def test_no_probability_is_said_to_be_certain_or_impossible():
    said = {p: say_probability(p) for p in (0.0, 1e-9, 0.004, 0.01, 0.5, 0.99, 0.996, 0.9999, 1.0)}
    assert not {"0.00", "1.00"} & set(said.values())
    assert said[0.9999] == "> 0.99"
    assert said[1e-9] == "< 0.01"
    assert said[0.5] == "0.50"
