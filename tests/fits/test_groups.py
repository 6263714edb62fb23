"""Comparing groups against closed forms, and by how often it is wrong."""

import numpy as np
import pytest

from icmj.errors import FitError
from icmj.fits.groups import compare


def posteriors(truth: np.ndarray, noise: float, generator: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Posterior means and variances of numbers with a standard normal prior, measured with noise."""
    measured = truth + noise * generator.normal(size=truth.shape)
    return measured / (1 + noise**2), np.full(truth.shape, noise**2 / (1 + noise**2))


def compared(apart: float, seed: int, n: int = 12, noise: float = 0.6) -> tuple:
    generator = np.random.default_rng(seed)
    truth = np.concatenate([generator.normal(0, 0.5, (n, 1)), generator.normal(apart, 0.5, (n, 1))])
    m, v = posteriors(truth, noise, generator)
    return compare(["gain"], m, v, ["old"] * n + ["young"] * n, [str(i) for i in range(2 * n)], ["gain"])


def test_without_shrinkage_and_with_the_right_error_rates() -> None:
    values = [compared(1.0, seed)[0].value for seed in range(200)]
    assert np.mean(values) == pytest.approx(1.0, abs=4 * np.std(values) / np.sqrt(200))
    false = np.mean([compared(0.0, seed)[0].verdict == "differs" for seed in range(300)])
    assert false < 0.05 + 3 * np.sqrt(0.05 * 0.95 / 300)
    assert np.mean([compared(2.0, seed)[0].verdict == "differs" for seed in range(50)]) > 0.9


def test_the_same_people_twice_are_paired() -> None:
    generator = np.random.default_rng(3)
    truth = generator.normal(0, 1.0, (10, 1))
    first, second = posteriors(truth, 0.1, generator), posteriors(truth + 0.3, 0.1, generator)
    m, v = (np.concatenate(pair) for pair in zip(first, second, strict=True))
    who = [str(i) for i in range(10)] * 2
    one = compare(["gain"], m, v, ["closed"] * 10 + ["open"] * 10, who, ["gain"])[0]
    assert one.paired
    assert one.verdict == "differs"
    assert one.low < 0.3 < one.high
    assert one.high - one.low < 0.4  # of two samples it would be about 1.9


def test_what_is_not_identified_cannot_be_told() -> None:
    generator = np.random.default_rng(4)
    m, v = posteriors(generator.normal(size=(12, 2)), 0.3, generator)
    v[:, 1] = 0.99
    groups, who = ["a"] * 6 + ["b"] * 6, [str(i) for i in range(12)]
    first, second = compare(["x", "y"], m, v, groups, who, ["y"])
    assert first.verdict == second.verdict == "no conclusion"
    assert "not identified" in first.words
    assert "fewer than 3 people" in second.words
    with pytest.raises(FitError, match="twice"):
        compare(["x", "y"], m, v, ["a"] * 12, ["1"] * 12, ["x"])
