"""Disturbances as sums of windowed sinusoids."""

from dataclasses import replace

import numpy as np
import pytest

from icmj.errors import SimulationError
from icmj.plant.linear_plant import Push
from icmj.simulation.disturbance import (
    LOW_PASS_END,
    bound_realisation,
    make_disturbance,
    make_no_disturbance,
    make_pushes,
    make_reading_error,
    measure_realisation,
)
from icmj.simulation.settings import Settings
from icmj.simulation.sources import NOISE_TERMS, Bias, Impulse, Noise, Step


def test_impulse_and_step_have_their_size_and_edges() -> None:
    d = make_disturbance(
        [
            Impulse(input="hip", size=0.3, start=1.0, duration=0.05, on="command"),
            Step(input="ankle", size=-2.0, start=0.5, on="command"),
            Step(input="ankle", size=1.0, on="command"),
        ],
        ("ankle", "hip"),
    )
    np.testing.assert_allclose(d.edges, [0.5, 1.0, 1.05])
    t = np.linspace(0, 2, 200001)
    values = d(t)
    assert values.shape == (200001, 2)
    np.testing.assert_allclose(values[:, 1].sum() * (t[1] - t[0]), 0.3, rtol=1e-3)
    np.testing.assert_array_equal(values[t < 0.5, 0], 1.0)
    np.testing.assert_array_equal(values[t > 0.5, 0], -1.0)
    np.testing.assert_allclose(d(1.0), [-1.0, 6.0])  # at an edge, the value from there on
    np.testing.assert_allclose(d(0.5), [-1.0, 0.0])


def test_noise_is_band_limited_with_the_size_asked_for_and_reproducible() -> None:
    noise = Noise(input="u", size=1.5, bandwidth=4.0, seed=7)
    d = make_disturbance([noise], ("u",))
    t = np.arange(0, 2000, 0.05)
    values = d(t)[:, 0]
    assert len(d) == NOISE_TERMS
    assert values.std() == pytest.approx(1.5, rel=0.01)
    assert abs(values.mean()) < 0.05
    # nearly normal: the fourth moment of M random phases is 3 − 3/(2M)
    assert (values**4).mean() / values.var() ** 2 == pytest.approx(3 - 1.5 / NOISE_TERMS, abs=0.15)
    power = np.abs(np.fft.rfft(values * np.hanning(len(t)))) ** 2
    frequency = np.fft.rfftfreq(len(t), 0.05)
    assert power[frequency > 4.05].sum() < 1e-6 * power.sum()
    low, high = power[frequency < 2].sum(), power[(frequency >= 2) & (frequency < 4.05)].sum()
    assert low == pytest.approx(high, rel=0.05)
    again = make_disturbance([noise], ("u",))
    np.testing.assert_array_equal(again(t), d(t))
    other = make_disturbance([replace(noise, seed=8)], ("u",))
    assert abs(np.corrcoef(other(t)[:, 0], values)[0, 1]) < 0.1


def test_noise_starts_when_told_and_is_the_same_function_of_time() -> None:
    late = make_disturbance([Noise(input="u", size=1.0, bandwidth=4.0, seed=7, start=2.0)], ("u",))
    early = make_disturbance([Noise(input="u", size=1.0, bandwidth=4.0, seed=7)], ("u",))
    np.testing.assert_array_equal(late([0.0, 1.999])[:, 0], [0.0, 0.0])
    np.testing.assert_array_equal(late([2.0, 3.3]), early([2.0, 3.3]))


def test_nothing_and_unknown_inputs() -> None:
    assert len(make_no_disturbance(3)) == 0
    assert len(make_no_disturbance(3).edges) == 0
    np.testing.assert_array_equal(make_no_disturbance(3)(1.0), np.zeros(3))
    with pytest.raises(SimulationError, match="'knee': the plant's inputs are ankle, hip"):
        make_disturbance([Step(input="knee", size=1.0, on="command")], ("ankle", "hip"))


def test_low_pass_noise_has_its_size_and_spectrum() -> None:
    corner = 0.5
    d = make_disturbance([Noise(input="u", size=1.5, corner=corner, seed=7, terms=2000)], ("u",))
    assert np.sum(d.amplitude**2 / 2) == pytest.approx(1.5**2, rel=1e-12)
    frequency = d.omega / (2 * np.pi)
    assert frequency.max() <= LOW_PASS_END * corner
    # the power up to f of 1/(1 + (f/corner)²), as a share of that up to the end
    for f in (0.1, 0.3, 0.5, 1.0, 3.0):
        share = np.arctan(f / corner) / np.arctan(LOW_PASS_END)
        assert np.mean(frequency < f) == pytest.approx(share, abs=2 / 2000)
    values = d(np.arange(0, 500, 0.02))[:, 0]
    assert values.std() == pytest.approx(1.5, rel=0.05)


def test_errors_of_outputs_are_apart_from_disturbances_of_inputs() -> None:
    sources = [
        Step(input="torque", size=2.0, on="command"),
        Bias(output="trunk", size=-0.5, start=1.0),
        Noise(output="shank", size=0.1, corner=1.0, seed=3),
        Noise(input="torque", size=0.1, bandwidth=1.0, seed=3),
    ]
    d, n = make_disturbance(sources, ("torque",)), make_reading_error(sources, ("shank", "trunk"))
    assert (len(d), len(n)) == (1 + NOISE_TERMS, 1 + NOISE_TERMS)
    assert (n.n_u, d.n_u) == (2, 1)
    np.testing.assert_array_equal(n(0.5)[1], 0.0)
    np.testing.assert_array_equal(n([1.0, 9.0])[:, 1], [-0.5, -0.5])
    np.testing.assert_array_equal(n.edges, [1.0])
    assert abs(n(0.5)[0]) > 0
    with pytest.raises(SimulationError, match="output 'knee': the plant's outputs are shank, trunk"):
        make_reading_error([Bias(output="knee", size=1.0)], ("shank", "trunk"))


def test_noise_is_the_same_signal_wherever_it_is_put() -> None:
    n = make_reading_error([Noise(output="y", size=1.0, bandwidth=4.0, seed=7)], ("y",))
    d = make_disturbance([Noise(input="u", size=1.0, bandwidth=4.0, seed=7)], ("u",))
    np.testing.assert_array_equal(n([0.3, 2.0]), d([0.3, 2.0]))


@pytest.mark.parametrize("spectrum", [{"bandwidth": 0.01}, {"corner": 0.01}, {"bandwidth": 0.1}, {"corner": 2.0}])
def test_what_a_noise_has_over_a_run_is_the_integral_of_its_sinusoids(spectrum: dict[str, float]) -> None:
    """Mean and variance over a window by the antiderivatives of cos and cos·cos, not by samples."""
    noise, end = Noise(input="u", size=2.0, seed=1, start=3.0, **spectrum), 63.0
    d = make_disturbance([noise], ("u",))
    w, p, a = d.omega, d.phase, d.amplitude

    def average(omega: np.ndarray, phase: np.ndarray) -> np.ndarray:
        return (np.sin(omega * end + phase) - np.sin(omega * 3.0 + phase)) / (omega * 60.0)

    mean = np.sum(a * average(w, p))
    apart = w[:, None] - w + 1e-300 * np.eye(len(w))
    other = np.where(np.eye(len(w)) > 0, 1.0, average(np.where(np.eye(len(w)) > 0, 1.0, apart), p[:, None] - p))
    square = np.sum(a[:, None] * a * (average(w[:, None] + w, p[:, None] + p) + other) / 2)
    assert measure_realisation(noise, end) == pytest.approx((mean, np.sqrt(square - mean**2)), rel=2e-3, abs=2e-3)


@pytest.mark.slow
@pytest.mark.parametrize("spectrum", [{"bandwidth": 0.01}, {"corner": 0.02}, {"corner": 0.2, "terms": 100}])
def test_of_other_seeds_the_range_told_holds_ninety_five_in_a_hundred(spectrum: dict[str, float]) -> None:
    noise = Noise(input="u", size=2.0, **spectrum)
    low, high = bound_realisation(noise, 60.0)
    inside = [low <= measure_realisation(replace(noise, seed=seed), 60.0)[1] <= high for seed in range(10_000, 11_000)]
    assert 0.93 < np.mean(inside) < 0.97


def test_where_something_acts_is_apart_from_how_it_goes() -> None:
    """What pushes one place is one sum; commands and readings have nothing of it."""
    on_trunk = {"body": "trunk", "force": (3.0, 0.0, 4.0)}
    settings = Settings(
        disturbance=(
            Impulse(**on_trunk, size=2.0, start=1.0, duration=0.5),
            Step("ankle", 0.7, 0.5),
            Step(**on_trunk, size=0.5),
            Noise("ankle", 0.1, corner=1.0, seed=1),
            Noise("hip", 0.1, corner=1.0, seed=1, on="body"),
            Bias("y", 1.0),
        )
    )
    pushes = make_pushes(settings)
    assert pushes.places == settings.pushes == (Push(**on_trunk), Push("ankle"), Push("hip"))
    assert [place.magnitude for place in pushes.places] == [5.0, 1.0, 1.0]
    assert [place.unit("20 N m") for place in pushes.places] == ["N", "N m", "N m"]
    np.testing.assert_allclose(pushes.size([0.2, 0.7, 1.2])[:, :2], [[0.5, 0], [0.5, 0.7], [4.5, 0.7]])
    np.testing.assert_allclose(pushes.size.edges, [0.5, 1.0, 1.5])
    d = make_disturbance(settings.disturbance, ("ankle", "hip"))
    assert len(d) == NOISE_TERMS
    assert set(d.input) == {0}
    assert len(make_reading_error(settings.disturbance, ("y",))) == 1


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Step(), "step: give one of input, body and surface"),
        (lambda: Step("u", body="b", force=(1, 0, 0)), "step: give one of input, body and surface"),
        (lambda: Noise("u", output="y", corner=1.0), "noise: give one of input, output, body and surface"),
        (lambda: Step(body="b"), "push on body 'b': give it a force"),
        (lambda: Step(body="b", force=(1, 0)), r"push on 'b': force must be three finite numbers, not \[1.0, 0.0\]"),
        (lambda: Step(body="b", force=(1, 0, np.nan)), "must be three finite numbers"),
        (lambda: Step(body="b", torque=(1, 0, 0), on="command"), "a body has no command"),
        (lambda: Step("u", force=(1, 0, 0)), "force, torque and point are those of a body"),
        (lambda: Step("u", on="floor"), "on 'floor'; expected one of command, body"),
        (lambda: Noise(output="y", corner=1.0, point=(0, 0, 0)), "force, torque and point are those of a body"),
    ],
)
def test_what_is_no_place_is_refused(make, words) -> None:
    with pytest.raises(SimulationError, match=words):
        make()
