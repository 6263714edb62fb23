"""Whether summaries lie where something was simulated."""

import numpy as np
import pytest

from icmj.errors import FitError
from icmj.fits.misfit import SeenSummaries

NAMES = ("size", "speed", "share 1", "share 2")


def simulated(n: int, seed: int) -> np.ndarray:
    """Two trials each of n people; the shares sum up to one, size and speed go together."""
    generator = np.random.default_rng(seed)
    size = generator.normal(size=(n, 2))
    share = generator.uniform(0.2, 0.4, (n, 2))
    return np.stack([size, 3 * size + 0.1 * generator.normal(size=(n, 2)), share, 1 - share], axis=2)


SEEN = SeenSummaries.of(simulated(2000, 0), NAMES)


def test_what_was_simulated_is_nowhere_outside_but_by_chance() -> None:
    told = [bool(SEEN.misfit(S)) for S in simulated(1000, 1)]
    assert np.mean(told) < 0.03  # 1 % by the distance, and 2 × 4 of 2000 as far out as the farthest


def test_one_summary_outside_is_named() -> None:
    S = simulated(1, 2)[0]
    S[:, 2] = 0.5
    found = SEEN.misfit(S)
    assert found.outside == ("share 1",)
    assert found.excess["share 1"] == pytest.approx((0.5 - SEEN.high[1, 2]) / SEEN.spread[1, 2])
    assert "outside of everything simulated are share 1 0.5 (simulated 0.2" in found.words
    assert "\n" not in found.words


def test_a_pair_that_never_goes_together_is_told() -> None:
    found = SEEN.misfit([[1.0, -3.0, 0.3, 0.7]])
    assert not found.outside
    assert found.share == 0
    assert "none of the simulated people are as unusual" in found.words


def test_pooled_over_trials() -> None:
    S = simulated(5, 3)
    pooled = SEEN.pool(S)
    assert pooled.shape == (5, 5)
    assert np.allclose(pooled[:, :4], ((S - SEEN.centre) / SEEN.scale).mean(axis=1))
    assert SEEN.pool(S[:, :1])[0, -1] < pooled[0, -1]
    drawn = SEEN.draw_pooled(np.repeat(S[:1], 3000, axis=0), np.random.default_rng(0))
    one, both = np.isclose(drawn[:, -1], -0.8), np.isclose(drawn[:, -1], pooled[0, -1])
    assert (one | both).all()
    assert 0.45 < one.mean() < 0.55
    assert np.allclose(drawn[both], pooled[0])


def test_a_constant_summary_and_bad_ones() -> None:
    S = simulated(50, 4)
    S[..., 3] = 2.0
    seen = SeenSummaries.of(S, NAMES)
    assert np.isfinite(seen.pool(S)).all()
    assert seen.misfit(S[0] + [0, 0, 0, 1]).outside == ("share 2",)
    S[0, 0, 0] = np.nan
    with pytest.raises(FitError, match="not finite"):
        SeenSummaries.of(S, NAMES)
    with pytest.raises(FitError, match="expected"):
        seen.pool(S[:, :, :2])
