"""Extremes between samples, against the signal itself."""

import numpy as np
import pytest
from numpy.polynomial import Polynomial

from icmj import load_run, prepare
from icmj.case.case import simulate as run_case
from icmj.engine.extremes import ExtremesTracker, find_extremes


def signal(t: np.ndarray) -> np.ndarray:
    return np.column_stack([np.sin(7 * t) * np.exp(-0.3 * t), np.cos(20 * t + 1) + t, np.exp(t)])


def extremes(t: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    high, low = find_extremes(t, y, np.array([[0, len(t) - 1]]))
    return high[0], low[0]


def test_extremes_converge_at_sixth_order() -> None:
    fine = signal(np.linspace(0, 1.3, 2_000_001))
    errors = []
    for steps in (65, 130, 260):
        t = np.append(np.arange(0, 1.3, 1.3 / steps), 1.3)
        high, low = extremes(t, signal(t))
        errors.append(max(np.abs(high - fine.max(axis=0)).max(), np.abs(low - fine.min(axis=0)).max()))
    assert errors[0] < 3e-5
    assert np.all(np.log2(np.array(errors[:-1]) / errors[1:]) > 5.5)
    assert errors[2] < 3e-9


def test_extremes_of_polynomials_of_the_degree_are_exact_at_any_samples() -> None:
    random = np.random.default_rng(0)
    for _ in range(300):
        m = int(random.integers(6, 12))
        t = np.cumsum(random.uniform(0.02, 0.03, size=m))
        curve = Polynomial.fromroots(random.uniform(t[0], t[-1], size=2)) * float(random.choice([-1.0, 1.0]))
        curve = curve * Polynomial([3.0, 0.4, 0.2, 0.1])  # a quintic that turns once within
        turns = [float(root.real) for root in curve.deriv().roots() if root.imag == 0 and t[0] < root.real < t[-1]]
        values = curve(np.array([t[0], t[-1], *turns]))
        high, low = extremes(t, curve(t)[:, None])
        np.testing.assert_allclose([high[0], low[0]], [values.max(), values.min()], atol=1e-12 * np.abs(values).max())


def test_few_samples_and_samples_on_top_of_each_other_are_taken_as_they_are() -> None:
    random = np.random.default_rng(0)
    for _ in range(300):
        m = int(random.integers(1, 40))
        t = np.cumsum(random.choice([1e-13, 1e-3, 0.03, 0.03, 0.03], size=m))
        y = np.column_stack([np.sin(9 * t + random.normal()), np.cos(5 * t) * t])
        high, low = extremes(t, y)
        assert (high >= y.max(axis=0)).all()
        assert (low <= y.min(axis=0)).all()
        assert (np.maximum(high - y.max(axis=0), y.min(axis=0) - low) < 0.05).all()


def test_a_jump_at_an_event_cuts_nothing_whatever_its_last_bit() -> None:
    """Cut an ulp behind its begin, an interval would lose what its first samples show together."""
    t = 3.6 + np.linspace(0, 0.3, 61)
    y = np.column_stack([np.cos(4 * (t - 3.605))])  # highest between the first two samples and the third
    for jump in (np.nextafter(3.6, 4), np.nextafter(3.6, 3), 3.6):
        tracker = ExtremesTracker(t[0], y[0], lambda start, end, at=jump: np.array([at]))
        tracker.add(t[1:], y[1:], np.array([59]))
        assert tracker.result()[0][0, 0] == pytest.approx(1.0, abs=1e-10)


def test_tracker_splits_at_events_and_edges_whatever_the_chunks(monkeypatch) -> None:
    """And whether it looks at all of them in the end, or at what is complete on the way."""
    t = np.linspace(0, 4, 401)
    y = np.column_stack([np.sin(3 * t), np.abs(t - 1.0)])  # a kink at 1 s, which an edge announces
    results = []
    for size, many in ((7, 20_000), (100, 20_000), (400, 20_000), (7, 30), (100, 30)):
        monkeypatch.setattr("icmj.engine.extremes.MANY", many)
        tracker = ExtremesTracker(t[0], y[0], lambda start, end: np.array([1.0])[[start < 1.0 < end]])
        for start in range(1, 401, size):
            part = slice(start, start + size)
            at = np.flatnonzero(np.isin(np.round(t[part], 6), [2.0, 3.5]))
            tracker.add(t[part], y[part], at)
        results.append(tracker.result())
    for high, low in results:
        np.testing.assert_allclose(high[:, 0], [1.0, np.sin(3 * t[200:351]).max()], atol=1e-4)
        np.testing.assert_allclose(low[:, 0], [-1.0, np.sin(3 * t[200:351]).min()], atol=1e-4)
        np.testing.assert_allclose(high[:, 1], [1.0, 2.5], atol=1e-12)
        np.testing.assert_allclose(low[:, 1], [0.0, 1.0], atol=1e-12)
        np.testing.assert_array_equal(high, results[0][0])


def test_an_extreme_in_a_step_that_an_event_cuts_short_is_as_sharp_as_in_any(root) -> None:
    """A minimum 4.5 ms after an action and 30 ms before an event was 5.1e-7 rad off without rows: it had one sample.

    Samples were a share of the step that was tried, not of what the event left of it.
    """
    moves = [{"kind": "ramp", "output": "lean", "size": 0.0113, "start": 0.8125, "duration": 0.125}]
    given = load_run(root / "runs" / "rivals" / "one-link-event.toml").with_(**{
        "simulation.duration": 1.2, "simulation.initial": {"ankle": 0.005}, "assumed.delay": 0.091, "actual.gain": 1.1,
        "controller.delta_min": 0.125, "controller.hold": "zero-order", "controller.q_t": 0.0006, "setpoint": moves,
    })  # fmt: skip
    sparse, dense = (
        run_case(prepare(given.with_(**{"simulation.record_interval": every})), "mujoco").events
        for every in (1.2, 5e-4)
    )
    assert sparse.t == pytest.approx(dense.t, abs=1e-11)
    assert np.abs(sparse.y_min - dense.y_min).max() < 1e-9
    assert np.abs(sparse.y_max - dense.y_max).max() < 1e-9
