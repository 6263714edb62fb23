"""The verdict in words, against what is known of each case."""

from dataclasses import replace

import numpy as np
import pytest
from report_cases import PENDULUM, result

from icmj import Controller, EventTrigger, Settings, design_lq, error_system, measure, predict, system_matched
from icmj.case.comparison import compare, verdict_in_words
from icmj.linear.run import simulate
from icmj.simulation.ending import Outcome


@pytest.mark.parametrize(("name", "period"), [("b0.8", "one interval"), ("b1.2", "twice the interval, mirrored")])
def test_a_run_on_the_predicted_cycle(name, period):
    words = verdict_in_words(result(name), True)
    assert words.startswith("Settles on the predicted cycle")
    assert period in words


@pytest.mark.parametrize(("name", "said"), [
    ("b0.8", ("settles on another cycle",)),
    # the other eigenvalue at this interval (notes, section 4)
    ("b1.7", ("No cycle at Δ_crit, as predicted, because ", "repelling", "|λ| = 1.20")),
    ("exact", ("No cycle predicted", "grow without bound")),
])  # fmt: skip
def test_what_is_not_on_a_predicted_cycle_says_why(name, said):
    words = verdict_in_words(result(name), False)
    assert name != "b1.7" or words.startswith(said[0])
    for part in said:
        assert part in words


@pytest.mark.parametrize("size", ["1.19", "1.002"])
def test_a_repelling_predicted_cycle_says_so(size):
    """Of 1.002 it said 1.00."""
    found = result("b0.8")
    prediction = replace(found.prediction, cycle=False, verdict="repelling", multipliers=np.array([complex(size)]))
    lost = replace(found.measurement, kind="irregular", p=None, period=None)
    words = verdict_in_words(replace(found, prediction=prediction, measurement=lost), False)
    assert f"repelling (largest multiplier {size})" in words
    assert "irregular" in words


def test_a_fall_is_named_with_its_time():
    found = result("b0.8")
    fallen = replace(found.simulation, outcome=Outcome("fell", 3.21, "fell"))
    lost = replace(found.measurement, kind="growth", p=None, period=None)
    assert "fell at 3.21 s" in verdict_in_words(replace(found, simulation=fallen, measurement=lost), False)


def test_no_crossing_is_said_of_the_range_searched_only():
    found = result("b0.8")
    nothing = {"delta_crit": None, "eigenvalue": None, "cycle": False, "crossings": (), "delta_max": 1.5}
    short = replace(found.prediction, **nothing, beyond=found.prediction.crossings[0])
    words = verdict_in_words(replace(found, prediction=short), False)
    assert "no eigenvalue reaches the unit circle up to Δ = 1.5 s (the range searched)" in words
    assert "one does beyond it, at 1.81 s; raise analysis.delta_max" in words
    growing = replace(found.prediction, **nothing, growing=True)
    assert "the largest |λ| still grows" in verdict_in_words(replace(found, prediction=growing), False)


def test_a_run_on_an_orbit_that_the_paper_s_condition_excludes_is_on_a_predicted_cycle():
    """And where several orbits are predicted, the words say which it is."""
    design = design_lq(PENDULUM, R_c=10.0, R_o=0.01)
    actual, rule = PENDULUM.scaled(3.7), EventTrigger(np.eye(2), 0.01, 1e-3)
    system = error_system(actual, design)
    prediction, controller = predict(system, rule), Controller(design, system_matched(design), rule)
    x, x_o, _ = system.start(1.001 * prediction.orbit.x_bar)
    run = simulate(actual, controller, Settings(duration=60.0, limit=1e3), x0=x, x_o0=x_o)
    motion = measure(run, T_hat=system.T_hat)
    told = {"actual": actual, "controller": controller, "prediction": prediction, "simulation": run}
    found = replace(result("b1.7"), **told, measurement=motion)
    compared = compare(found)
    assert (
        compared.words == "Settles on the predicted cycle of 1.148 s (period is twice the interval, mirrored halves)."
    )
    assert (compared.predicted.cycle, compared.predicted.by_paper, compared.measured.converged) == (True, False, True)
    assert abs(compared.relative_error.interval) < 1e-6
    (one,) = prediction.orbits
    beyond = replace(one, crossing=replace(one.crossing, delta=2.5), orbit=replace(one.orbit, delta=2.5))
    several = replace(prediction, others=(beyond,)).about(beyond)
    assert several.delta_crit == 2.5
    compared = compare(replace(found, prediction=several))
    assert "cycle of 1.148 s, the first of 2 predicted orbits" in compared.words
    assert compared.predicted.delta_crit == prediction.delta_crit
    fallen = replace(found, prediction=several, simulation=replace(run, outcome=Outcome("fell", 3.21, "fell")))
    lost = replace(motion, kind="growth", p=None, period=None)
    words = verdict_in_words(replace(fallen, measurement=lost), False)
    assert (
        "predicted cycle of 2.5 s, the second of 2 predicted orbits, which attracts only what starts near it" in words
    )
    family = replace(found, prediction=replace(prediction, verdict="family"), measurement=lost)
    assert "one of a family of cycles" in verdict_in_words(family, False)
