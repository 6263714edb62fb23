"""Systems out of all proportion end soon, with a result or with an error that says what is wrong; nothing else."""

import numpy as np
import pytest
from theory_cases import NAMES, neglected, pendulum, pendulum_design, shipped

from icmj import Design, EventTrigger, LinearPlant, error_system, predict
from icmj.errors import AnalysisError
from icmj.theory import crossings as search_module
from icmj.theory.crossings import search


def damped(rate):
    return LinearPlant([[-rate, 1], [1, 0]], [[0.8], [0]], [[0, 1]], NAMES)


def high_gain(factor):
    plain = pendulum_design()
    return Design(pendulum(), factor * plain.k, factor * plain.L)


ABSURD = {
    "gain": lambda g: (pendulum(g), pendulum_design()),
    "feedback": lambda g: (pendulum(0.8), high_gain(g)),
    "damping": lambda g: (damped(g), pendulum_design()),
    "fast pole": lambda g: (LinearPlant([[0, 1], [g, 0]], [[0.8], [0]], [[0, 1]], NAMES), pendulum_design()),
    "stiff mode": lambda g: (neglected(0.01, omega=g), pendulum_design()),
}


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("size", [1e4, 1e6, 1e9, 1e12, 1e20, 1e50, 1e150, 1e300])
@pytest.mark.parametrize("kind", ABSURD)
def test_absurd_systems_end_in_a_result_or_in_an_analysis_error(kind, size):
    try:
        plant, design = ABSURD[kind](size)
    except OverflowError:
        return  # not even the test can write it down
    words = ""
    try:
        found = predict(error_system(plant, design), EventTrigger(np.eye(2), 0.01))
        assert 0 < found.delta_max <= 3
    except AnalysisError as refused:
        words = str(refused)
    assert not words or words.startswith("not analysable: ")


@pytest.mark.parametrize("size", [1e-3, 1e-6, 1e-9, 1e-12])
def test_a_very_slow_pole_is_as_good_as_none(size):
    """v' = 0.8 u, y' = εv: the slow eigenvalue stays just inside the circle and is no part of the crossing."""
    system = error_system(LinearPlant([[0, 1], [size, 0]], [[0.8], [0]], [[0, 1]], NAMES), pendulum_design())
    rising = [c for c in search(system, 3.0).crossings if c.direction == "rising"]
    assert [c.delta for c in rising] == [pytest.approx(1.7597, abs=1e-4)]
    assert rising[0].multiplicity == 1


def test_the_search_gives_up_after_its_share_of_panels(monkeypatch):
    monkeypatch.setattr(search_module, "_MOST_PANELS", 7)  # fewer than it starts with
    with pytest.raises(AnalysisError, match=r"not analysable: .* too wildly"):
        search(shipped("b=0.8"), 2.0)


def test_progress_rises_to_one():
    told = []
    search(shipped("b=1.7"), 4.0, progress=told.append)
    assert told == sorted(told)
    assert told[-1] == 1.0
    told.clear()
    system = shipped("b=0.8")
    predict(system, EventTrigger(np.eye(2), 0.01), progress=told.append)
    assert told == sorted(told)
    assert told[-1] == 1.0
