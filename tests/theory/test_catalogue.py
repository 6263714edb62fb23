"""The catalogue of orbits: one for each crossing at ±1, each judged by what the exact simulator does beside it."""

from collections import Counter
from collections.abc import Iterator

import numpy as np
import pytest
from catalogue import check_orbits
from theory_cases import pendulum, started_beside

from icmj import EventTrigger, LinearPlant, Prediction, design_lq, measure, predict
from icmj.case.laid_orbit import beside, settled_on
from icmj.errors import DesignError
from icmj.theory.error_system import ErrorSystem, error_system
from icmj.theory.prediction import scale_prediction


def strong() -> tuple[ErrorSystem, EventTrigger, Prediction]:
    """A weak design on a plant 3.7 times as strong: continuous feedback is unstable, and an orbit attracts."""
    system = error_system(pendulum(3.7), design_lq(pendulum(), R_c=10.0, R_o=0.01))
    rule = EventTrigger(np.eye(2), 0.01, 1e-3)
    return system, rule, predict(system, rule)


def loops(seed: int, count: int) -> Iterator[ErrorSystem]:
    """Random unstable plants under LQ designs of any weight, with inputs of half to four times the strength."""
    rng, made = np.random.default_rng(seed), 0
    while made < count:
        n, n_u, n_y = rng.integers(2, 4), rng.integers(1, 3), rng.integers(1, 3)
        A = rng.normal(size=(n, n))
        A += (rng.uniform(0.2, 1.5) - np.linalg.eigvals(A).real.max()) * np.eye(n)
        assumed = LinearPlant(A, rng.normal(size=(n, n_u)), rng.normal(size=(n_y, n)))
        try:
            design = design_lq(assumed, R_c=10 ** rng.uniform(-3, 1.5), R_o=10 ** rng.uniform(-3, 1.5))
        except DesignError:
            continue
        made += 1
        yield error_system(assumed.scaled(10 ** rng.uniform(np.log10(0.5), np.log10(4))), design)


def test_an_orbit_that_attracts_is_a_predicted_cycle_whatever_the_other_eigenvalues_are():
    system, rule, found = strong()
    assert found.delta_crit == pytest.approx(1.1477, abs=5e-5)
    (crossing,) = (c for c in found.crossings if c.kind != "complex")
    assert crossing.largest_other > 1
    assert (found.cycle, found.by_paper, found.verdict) == (True, False, "attracting")
    assert found.period == pytest.approx(2 * found.delta_crit)
    assert np.abs(found.multipliers).max() == pytest.approx(0.6969, abs=5e-5)
    assert not found.observer_feedback_stable
    assert any("most small starts fall" in words for words in found.remarks)
    assert "most small starts fall" in found.card().words
    run, returns = started_beside(system, rule, found, 3)
    assert returns
    assert settled_on(found, measure(run, T_hat=system.T_hat)).orbit is found.orbit


@pytest.mark.slow
def test_every_orbit_of_the_catalogue_is_judged_as_runs_beside_it_go():
    seen = {"attracting": 0, "repelling": 0, "several": 0}
    for seed, system in enumerate(loops(21, 20)):
        rule = EventTrigger(np.eye(system.n_hat), 0.01, 1e-4)
        found = predict(system, rule, delta_max=4.0)
        real = [c for c in found.crossings if c.kind != "complex"]
        assert [one.crossing for one in found.orbits] == real
        assert found.cycle == any(one.settles for one in found.orbits)
        seen["several"] += len(real) > 1
        for one in found.orbits:
            sign, x_bar = one.orbit.sign, one.orbit.x_bar
            moved = system.phi(one.crossing.delta) @ x_bar
            np.testing.assert_allclose(moved, sign * x_bar, atol=1e-6 * np.abs(x_bar).max())
            if one.verdict not in seen or 0.9 < one.multiplier < 1.1:
                continue
            seen[one.verdict] += 1
            about = found.about(one)
            assert (about.delta_crit, about.verdict) == (one.orbit.delta, one.verdict)
            assert [again.orbit for again in about.orbits] == [again.orbit for again in found.orbits]
            run, returns = started_beside(system, rule, about, seed)
            assert returns == one.settles, (seed, one.words)
            if returns and measure(run, T_hat=system.T_hat).kind == "cycle":
                assert beside(found, measure(run, T_hat=system.T_hat)).orbit is one.orbit
    assert min(seen.values()) >= 2, seen


@pytest.mark.slow
def test_orbits_of_loops_of_every_kind_are_judged_as_runs_beside_them_go():
    """With any hold, delay and rule; ``python -m tests.catalogue`` looks at a thousand."""
    rows = [row for number in range(40) for row in check_orbits(700, number)]
    told = Counter((str(row["verdict"]), str(row["judged"])) for row in rows)
    assert not [row for row in rows if row["judged"] == "differs"]
    assert min(told[verdict, "agrees"] for verdict in ("attracting", "repelling", "family")) >= 3, told
    assert sum(row["judged"] == "unclear" for row in rows) <= len(rows) / 10, told


def test_the_threshold_scales_every_orbit():
    several = next(
        found
        for system in loops(21, 36)
        if len((found := predict(system, EventTrigger(np.eye(system.n_hat), 0.01, 1e-4), delta_max=4.0)).orbits) > 1
    )
    for one, large in zip(several.orbits, scale_prediction(several, 3.0).orbits, strict=True):
        assert (large.verdict, large.crossing) == (one.verdict, one.crossing)
        np.testing.assert_allclose(large.orbit.x_bar, 3 * one.orbit.x_bar)
