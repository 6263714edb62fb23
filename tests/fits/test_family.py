"""A member of a linear family sways as the closed form says."""

from dataclasses import replace

import numpy as np
import pytest

import icmj
from icmj import Noise, load_family

TRIALS, BAND = 24, 20.0  # Hz


@pytest.mark.slow
def test_the_predictor_sways_as_lyapunov_says():
    """Noise that is flat far beyond the loop is white with half its power per hertz; the model is exact."""
    family = load_family("predictor")
    theta = family.prior.from_normal(np.zeros((1, len(family.prior))))[0]
    theta[family.prior.names.index("gain")] = 1.0
    member = family.member(theta, 30.0)
    noise = Noise(input="ankle_torque", size=3.0, bandwidth=BAND, seed=1, terms=150)
    member = replace(member, settings=replace(member.settings, disturbance=(noise,)))
    X, _ = icmj.theory.predictor_covariance(member.law, 3.0**2 / (2 * BAND))
    expected = float(member.weights @ X @ member.weights)
    found = np.array([np.mean(member.trial(seed) ** 2) for seed in range(TRIALS)])
    error = found.std(ddof=1) / np.sqrt(TRIALS)
    assert error < 0.15 * expected  # so that it tells something
    assert abs(found.mean() - expected) < 4 * error
