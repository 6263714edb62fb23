"""Stabilogram diffusion against its definition, and where it is known in closed form."""

from dataclasses import replace

import numpy as np
import pytest

from icmj.measurement.measures.stabilogram import Regime, diffusion

RATE = 100.0


def test_the_mean_square_is_that_of_all_pairs():
    values = np.random.default_rng(5).standard_normal((1001, 2)).cumsum(axis=0) + 1e3
    found = diffusion(values, RATE, long=(1.0, 5.0))
    assert len(found.lag) == 500
    for m in (1, 2, 17, 499, 500):
        direct = ((values[m:] - values[:-m]) ** 2).mean(axis=0).sum()
        assert found.displacement[m - 1] == pytest.approx(direct, rel=1e-9)
        assert found.lag[m - 1] == m / RATE


def test_a_ramp_is_as_persistent_as_can_be():
    found = diffusion(0.3 * np.arange(4000) / RATE, RATE)
    assert found.displacement == pytest.approx((0.3 * found.lag) ** 2, rel=1e-7)
    assert pytest.approx(1, abs=1e-6) == found.short.H
    assert pytest.approx(1, abs=1e-6) == found.long.H


def test_a_sinusoid_comes_back():
    t = np.arange(int(600 * RATE)) / RATE
    found = diffusion(2 * np.sin(2 * np.pi * 0.5 * t), RATE)
    # ⟨(sin(a + ωτ) − sin a)²⟩ = 1 − cos ωτ, over many periods
    assert found.displacement == pytest.approx(4 * (1 - np.cos(np.pi * found.lag)), abs=0.05)


def test_a_random_walk_has_h_one_half_and_its_own_diffusion():
    deviation = 0.02
    steps = deviation * np.random.default_rng(6).standard_normal(400_000)
    found = diffusion(steps.cumsum(), RATE)
    D = deviation**2 * RATE / 2
    assert pytest.approx(0.5, abs=0.01) == found.short.H
    assert pytest.approx(D, rel=0.03) == found.short.D
    assert pytest.approx(0.5, abs=0.05) == found.long.H
    assert pytest.approx(D, rel=0.15) == found.long.D


def test_a_bounded_walk_is_a_walk_at_first_and_stays_where_it_is_later():
    # Ornstein and Uhlenbeck: ⟨Δx²⟩ = 2 s² (1 − e^{−τ/T})
    T, N = 1.0, 400_000
    a = np.exp(-1 / (T * RATE))
    from scipy.signal import lfilter

    values = lfilter([np.sqrt(1 - a * a)], [1, -a], np.random.default_rng(7).standard_normal(N))
    found = diffusion(values, RATE, short=(0.01, 0.1))
    assert found.displacement == pytest.approx(2 * (1 - np.exp(-found.lag / T)), rel=0.07)
    assert pytest.approx(1 / T, rel=0.1) == found.short.D
    assert pytest.approx(0, abs=0.05) == found.long.H
    lag, displacement = found.critical
    assert lag == pytest.approx(T, rel=0.15)
    assert displacement == pytest.approx(2, rel=0.1)


def test_the_critical_point_is_where_the_lines_meet():
    found = diffusion(np.sin(np.arange(4000.0)), RATE)
    meeting = replace(found, short=Regime(0, 1, 0.8, 3.0, 1.0), long=Regime(2, 10, 0.2, 0.5, 6.0))
    assert meeting.critical == pytest.approx((1.0, 7.0))
    assert replace(meeting, long=None).critical is None
    assert replace(meeting, long=Regime(2, 10, 0.9, 4.0, 6.0)).critical is None
    assert replace(meeting, long=Regime(2, 10, 0.2, 0.5, 0.0)).critical is None


def test_a_record_too_short_or_too_coarse_or_too_still_has_no_stretch():
    walk = np.random.default_rng(8).standard_normal(1999).cumsum()
    assert diffusion(walk, RATE).long is None
    assert diffusion(walk, RATE).short is not None
    assert diffusion(walk, 5.0).short is None
    still = diffusion(np.ones(4000), RATE)
    assert (still.short, still.long, still.critical) == (None, None, None)
