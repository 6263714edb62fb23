"""Coexisting attractors of the paper's cases."""

import numpy as np
import pytest
from linear_cases import PENDULUM, event_controller, neglected, pendulum_design, settings

from icmj.errors import SimulationError
from icmj.experiments.coexisting_motions import attractors
from icmj.linear.run import simulate
from icmj.measurement.measurement import measure


def sweep(plant, Q_t="output", duration=60.0, **more):
    controller = event_controller(pendulum_design(), Q_t=Q_t)
    return attractors(plant, controller, settings(duration, initial={"hinge": 0.02}), **more)


@pytest.mark.parametrize(("b", "p", "interval"), [(0.8, 1, 1.807), (1.2, 2, 1.528)])
def test_one_attractor_where_the_paper_shows_a_cycle(b, p, interval):
    (found,) = sweep(PENDULUM.scaled(b), starts=16)
    assert (found.measurement.p, found.share, found.count) == (p, 1.0, 16)
    assert found.measurement.interval == pytest.approx(interval, abs=5e-4)


def test_neglected_dynamics_have_one_and_the_exact_model_none_but_the_homoclinic():
    (found,) = sweep(neglected(0.1), starts=8, duration=80.0)
    assert found.measurement.interval == pytest.approx(3.593, abs=5e-4)
    found = sweep(PENDULUM, starts=12)
    assert [a.measurement.kind for a in found] == ["homoclinic"]


def test_two_attractors_coexist_where_the_predicted_cycle_repels():
    found = sweep(PENDULUM.scaled(1.7), starts=24)
    assert [(a.measurement.kind, a.measurement.p, a.measurement.mirrored) for a in found] == [
        ("cycle", 2, False),
        ("cycle", 4, True),
    ]
    assert sum(a.count for a in found) == 24
    assert sorted(found[0].measurement.intervals) == pytest.approx([0.776, 1.788], abs=1e-3)
    # neither is the predicted cycle of interval 1.112 s
    assert all(np.abs(a.measurement.intervals - 1.112).min() > 0.1 for a in found)
    for a in found:  # the start that is reported leads there
        controller = event_controller(pendulum_design())
        run = simulate(PENDULUM.scaled(1.7), controller, settings(120.0), x0=a.x0, x_o0=a.x_o0)
        again = measure(run, T_hat=np.eye(2))
        assert sorted(again.intervals) == pytest.approx(sorted(a.measurement.intervals), abs=1e-5)


def test_reproducible_from_the_seed():
    first, second = (sweep(PENDULUM.scaled(1.7), starts=6, seed=4) for _ in range(2))
    assert [a.count for a in first] == [a.count for a in second]
    assert all(np.array_equal(a.x0, b.x0) for a, b in zip(first, second, strict=True))


def test_a_scale_of_zero_is_refused():
    with pytest.raises(SimulationError, match="stays at zero"):
        attractors(PENDULUM, event_controller(pendulum_design()), settings(5.0))
