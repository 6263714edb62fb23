"""Calibration against posteriors that are exact, and against some that are not."""

import numpy as np
import pytest
from scipy.stats import norm

from icmj.errors import FitError
from icmj.fits.calibration import calibrate

NOISE = np.array([0.3, 0.8, 1e6])  # of one measurement of each number
NAMES = ("sharp", "blurred", "untold")


def posteriors(n: int, seed: int, wide: float = 1.0, aside: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Numbers of n people, and draws of their exact posteriors, stretched or moved."""
    generator = np.random.default_rng(seed)
    z = generator.normal(size=(n, 3))
    measured = z + NOISE * generator.normal(size=(n, 3))
    variance = NOISE**2 / (1 + NOISE**2)
    mean, deviation = measured / (1 + NOISE**2), np.sqrt(variance)
    return z, mean[:, None] + deviation * (aside + wide * generator.normal(size=(n, 299, 3)))


def test_exact_posteriors_are_calibrated() -> None:
    found = calibrate(*posteriors(400, 0), NAMES)
    assert found.verdicts == ("identified", "identified", "not identified")
    assert found.identified == ("sharp", "blurred")
    assert np.abs(found.contraction - 1 / (1 + NOISE**2)).max() < 0.02
    assert ((found.coverage_low < 0.9) & (found.coverage_high > 0.9)).all()
    masses = np.array([0.5, 0.8, 0.95])
    assert np.abs(found.expected(masses) - masses[:, None]).max() < 4 * 0.5 / np.sqrt(400)
    assert np.abs(found.bias).max() < 4 / np.sqrt(400)
    assert found.correlation[0] == pytest.approx(1 / np.sqrt(1 + NOISE[0] ** 2), abs=0.02)


def test_p_values_of_exact_posteriors_are_honest() -> None:
    p_values = np.concatenate([calibrate(*posteriors(60, seed), NAMES).p_values for seed in range(60)])
    assert np.mean(p_values < 0.05) < 0.05 + 3 * np.sqrt(0.05 * 0.95 / 180)


@pytest.mark.parametrize(("wide", "aside"), [(0.7, 0.0), (1.6, 0.0), (1.0, 0.5)])
def test_wrong_posteriors_are_found_out(wide: float, aside: float) -> None:
    found = calibrate(*posteriors(200, 1, wide, aside), NAMES)
    assert found.verdicts[0] == "not calibrated"
    assert found.p_values.max() < 1e-3
    assert "sharp" not in found.identified


@pytest.mark.parametrize(("held", "verdict"), [(190, "identified"), (191, "not calibrated")])
def test_an_identified_number_has_a_coverage_of_85_to_95_percent(held: int, verdict: str) -> None:
    drawn = np.broadcast_to(0.3 * norm.ppf((np.arange(999) + 0.5) / 999)[None, :, None], (200, 999, 1))
    ranks = 0.5 + 0.45 * np.linspace(-1, 1, held + 1)[:held] + 0.45 / held
    outside = np.linspace(0.005, 0.045, 200 - held)
    z = 0.3 * norm.ppf(np.concatenate([ranks, np.where(np.arange(200 - held) % 2, outside, 1 - outside)]))
    found = calibrate(z[:, None], drawn, ("sharp",))
    assert found.coverage[0] == held / 200
    assert found.p_values[0] > 0.01
    assert found.verdicts == (verdict,)


def test_too_few_people_or_draws_are_refused() -> None:
    z, drawn = posteriors(30, 2)
    with pytest.raises(FitError, match="19 people"):
        calibrate(z[:19], drawn[:19], NAMES)
    with pytest.raises(FitError, match="at least 19"):
        calibrate(z, drawn[:, :5], NAMES)
