"""The test of one mode: how often it errs on one, and how often it sees two."""

import numpy as np
import pytest

from icmj.errors import DataError
from icmj.measurement.statistics import modality


def slow(random: np.random.Generator, N: int = 1000, a: float = 0.98) -> np.ndarray:
    """A slow Gaussian signal."""
    from scipy.signal import lfilter

    return lfilter([1.0], [1.0, -a], random.standard_normal(N + 500))[500:]


def test_a_heap_is_rarely_called_several_and_two_heaps_are():
    random = np.random.default_rng(1)
    one = [modality(random.standard_normal(200), resamples=49, seed=i).p for i in range(40)]
    assert np.mean(np.array(one) <= 0.05) <= 0.05 + 3 * np.sqrt(0.05 * 0.95 / 40)
    for seed in range(5):
        two = np.append(random.normal(-2, 0.7, 100), random.normal(2, 0.7, 100))
        assert modality(two, resamples=49, seed=seed).p == pytest.approx(1 / 50)  # the least there is


def test_a_slow_signal_that_lingers_is_of_one_mode_and_one_that_jumps_of_two():
    random = np.random.default_rng(2)
    one = np.array([modality(slow(random), signal=True, resamples=39, seed=i).p for i in range(12)])
    assert np.mean(one <= 0.05) <= 0.05 + 3 * np.sqrt(0.05 * 0.95 / 12)
    between = np.sign(np.sin(np.arange(1000) / 30)) + 0.06 * slow(random)
    assert modality(between, signal=True, resamples=39).p == pytest.approx(1 / 40)


def test_a_tail_is_no_mode():
    random = np.random.default_rng(3)
    assert modality(random.standard_t(2, 400), resamples=49).p > 0.05
    bursts = slow(random) * (1 + 5 * (np.arange(1000) % 100 < 5))
    assert modality(bursts, signal=True, resamples=39).p > 1 / 40


def test_the_critical_bandwidth_of_two_points_is_half_their_distance():
    # two Gaussians of deviation h and equal weight have one mode from a distance of 2h on
    found = modality(np.repeat([-1.0, 1.0], 50), resamples=1)
    assert found.bandwidth == pytest.approx(1.0, rel=0.01)


@pytest.mark.parametrize("rest", [0.3, 0.3 * (1 + 2e-16 * np.arange(97))], ids=["equal", "but for rounding"])
def test_what_rests_at_one_value_but_for_its_tails_has_one_mode(rest):
    values = np.append(np.ones(97) * rest, [1.0, 2.0, 3.0])
    for signal in (False, True):
        found = modality(values, signal=signal, resamples=19)
        assert (found.p, found.bandwidth) == (1.0, 0.0)


def test_what_has_no_distribution_is_refused():
    for wrong, words in ((np.zeros(5), "expected at least 20"), (np.full(50, 3.0), "all values are the same")):
        with pytest.raises(DataError, match=words):
            modality(wrong)
    with pytest.raises(DataError, match="all finite"):
        modality(np.full(50, np.nan))
