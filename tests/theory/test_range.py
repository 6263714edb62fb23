"""What is said of Δ beyond the range searched: it is a range, and a quick look further tells whether to enlarge it."""

import numpy as np
import pytest
from theory_cases import random_systems, shipped

from icmj import EventTrigger, predict
from icmj.theory.crossings import search


def prediction(case, end):
    system = shipped(case)
    return predict(system, EventTrigger(np.eye(system.n_hat), 0.01), delta_max=end)


@pytest.mark.parametrize(
    ("case", "end"), [("b=0.8", 1.5), ("b=1.2", 0.5), ("b=0.9 three-link", 0.7), ("zeta=0.1", 3.0)]
)
def test_a_crossing_just_beyond_the_range_is_found_by_a_quick_look(case, end):
    found, whole = prediction(case, end), search(shipped(case), 4.0).crossings[0]
    assert (found.crossings, found.delta_crit, found.delta_max) == ((), None, end)
    assert found.beyond is not None
    assert found.beyond.delta == pytest.approx(whole.delta, rel=1e-10)
    assert found.beyond.kind == whole.kind
    largest = [np.abs(np.linalg.eigvals(shipped(case).phi(delta))).max() for delta in (end * 15 / 16, end)]
    assert found.growing == (largest[1] > largest[0])


def test_where_only_a_pair_crosses_the_look_is_for_plus_or_minus_one():
    found = prediction("b=1.7", 0.6)
    assert [c.kind for c in found.crossings] == ["complex"]
    assert found.beyond.kind == "-1"
    assert found.beyond.delta == pytest.approx(1.1124, abs=1e-4)


def test_nothing_lies_beyond_the_exact_model_and_nothing_is_looked_for_where_a_crossing_is_known():
    exact = prediction("exact", 3.0)
    assert (exact.beyond, exact.growing) == (None, False)
    known = prediction("b=0.8", 3.0)
    assert (known.beyond, known.growing) == (None, False)


def test_the_look_agrees_with_a_search_of_the_longer_range():
    agreed = 0
    for system in random_systems(71, 60):
        whole = search(system, 1.2).crossings
        if not whole or whole[0].delta < 0.31:
            continue
        found = predict(system, EventTrigger(np.eye(system.n_hat), 0.01), delta_max=0.3)
        assert found.crossings == ()
        # the look may miss a pair of crossings within one of its steps, never a change that lasts
        assert any(abs(found.beyond.delta - c.delta) < 1e-8 for c in whole)
        agreed += abs(found.beyond.delta - whole[0].delta) < 1e-8
    assert agreed >= 15
