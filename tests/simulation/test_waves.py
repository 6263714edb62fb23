"""Sums of sinusoids by interpolation, against the sums themselves."""

import numpy as np
import pytest

from icmj.simulation.disturbance import make_disturbance
from icmj.simulation.sinusoids import Waves
from icmj.simulation.sources import Impulse, Noise


@pytest.mark.parametrize("stride", [0.0, 1e-3, 0.2])
def test_interpolated_sums_are_the_sums(stride):
    random = np.random.default_rng(3)
    signal = np.sort(random.integers(0, 3, 90))
    amplitude, omega, phase = random.standard_normal(90), random.uniform(0, 120, 90), random.uniform(0, 7, 90)
    t = np.sort(random.uniform(5.0, 7.0, 4000))
    waves = Waves(signal, amplitude, omega, phase, 3, stride)
    direct = (amplitude * np.cos(omega * t[:, None] + phase)) @ (signal[:, None] == np.arange(3))
    # an angle of a thousand radians is known to 2e-13
    np.testing.assert_allclose(waves(t), direct, atol=2e-13 * np.abs(amplitude).sum(), rtol=0)


def test_a_disturbance_at_many_instants_is_what_it_is_at_each():
    acts = (
        Noise(input="u", size=2.0, bandwidth=3.0, seed=1, terms=100),
        Noise(input="v", size=0.3, corner=0.2, seed=2, start=1.7),
        Impulse("v", 1.0, 0.5, 0.1, on="command"),
    )
    disturbance = make_disturbance(acts, ("u", "v"))
    t = np.linspace(0, 9, 2001)
    one_by_one = np.array([disturbance(instant) for instant in t])
    np.testing.assert_allclose(disturbance(t), one_by_one, atol=1e-12, rtol=0)
    np.testing.assert_allclose(disturbance(t[::-1]), one_by_one[::-1], atol=1e-12, rtol=0)
