"""A run against its prediction: the numbers by hand, the verdict by what is known of each case."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from report_cases import result

from icmj.comparison.comparison import INTERVAL_TOLERANCE, compare, settled_on_prediction, to_json
from icmj.simulation.ending import Outcome


@pytest.mark.parametrize(("name", "period_in_intervals"), [("b0.8", 1), ("b1.2", 2), ("neglected", 1)])
def test_a_run_on_the_predicted_cycle(name, period_in_intervals):
    comparison = compare(result(name))
    assert comparison.measured.converged
    assert comparison.measured.period == pytest.approx(period_in_intervals * comparison.predicted.delta_crit, rel=1e-9)
    error = comparison.relative_error
    for value in (error.interval, error.period, error.gamma, error.largest_amplitude):
        assert abs(value) < 1e-9
    assert comparison.words.startswith("Settles on the predicted cycle")


def test_errors_are_relative_to_the_prediction():
    found = result("b0.8")
    measurement = replace(
        found.measurement,
        interval=found.prediction.delta_crit * 1.01,
        period=found.prediction.delta_crit * 0.98,
        amplitude=found.prediction.amplitude * 1.5,
    )
    error = compare(replace(found, measurement=measurement)).relative_error
    assert error.interval == pytest.approx(0.01)
    assert error.period == pytest.approx(-0.02)
    assert error.amplitude == pytest.approx([0.5])


def test_largest_amplitude_error_keeps_its_sign():
    found = result("three-link")
    measurement = replace(found.measurement, amplitude=found.prediction.amplitude * [1.001, 0.99, 1.002])
    assert compare(replace(found, measurement=measurement)).relative_error.largest_amplitude == pytest.approx(-0.01)


@pytest.mark.parametrize("factor", [1 - 1.01 * INTERVAL_TOLERANCE, 1 + 1.01 * INTERVAL_TOLERANCE])
def test_a_cycle_with_another_interval_is_not_the_predicted_one(factor):
    found = result("b0.8")
    other = replace(found.measurement, interval=found.prediction.delta_crit * factor)
    assert not settled_on_prediction(found.prediction, other)
    assert "settles on another cycle" in compare(replace(found, measurement=other)).words


def test_unequal_intervals_with_the_right_mean_are_not_the_predicted_cycle():
    found = result("b1.2")
    delta = found.prediction.delta_crit
    uneven = replace(found.measurement, intervals=np.array([0.8, 1.2]) * delta)
    assert not settled_on_prediction(found.prediction, uneven)


@pytest.mark.parametrize("change", [{"mirrored": True}, {"p": 2}, {"kind": "quasi-periodic"}, {"interval": None}])
def test_the_cycle_must_have_the_predicted_form(change):
    found = result("b0.8")
    assert settled_on_prediction(found.prediction, found.measurement)
    assert not settled_on_prediction(found.prediction, replace(found.measurement, **change))


def test_large_gain_does_not_settle_and_says_why():
    comparison = compare(result("b1.7"))
    assert not comparison.predicted.cycle
    assert not comparison.measured.converged
    assert comparison.predicted.delta_crit == pytest.approx(1.112, abs=5e-4)
    assert comparison.relative_error.interval is None
    assert "none is predicted" in comparison.words
    assert "repelling" in comparison.words
    assert "|λ| = 1.20" in comparison.words  # the other eigenvalue at this interval (notes, section 4)


def test_exact_model_has_no_cycle():
    comparison = compare(result("exact"))
    assert comparison.predicted.delta_crit is None
    assert not comparison.measured.converged
    assert "No cycle predicted" in comparison.words
    assert "grow without bound" in comparison.words


def test_no_crossing_is_said_of_the_range_searched_only():
    found = result("b0.8")
    nothing = {"delta_crit": None, "eigenvalue": None, "cycle": False, "crossings": (), "delta_max": 1.5}
    short = replace(found.prediction, **nothing, beyond=found.prediction.crossings[0])
    words = compare(replace(found, prediction=short)).words
    assert "no eigenvalue reaches the unit circle up to Δ = 1.5 s (the range searched)" in words
    assert "one does at 1.81 s: raise analysis.delta_max" in words
    growing = replace(found.prediction, **nothing, growing=True)
    assert "the largest |λ| still grows" in compare(replace(found, prediction=growing)).words


def test_a_repelling_predicted_cycle_says_so():
    found = result("b0.8")
    prediction = replace(found.prediction, verdict="repelling", multipliers=np.array([1.19 + 0j]))
    lost = replace(found.measurement, kind="irregular", p=None, period=None)
    words = compare(replace(found, prediction=prediction, measurement=lost)).words
    assert "repelling (largest multiplier 1.19)" in words
    assert "irregular" in words


def test_a_fall_is_named_with_its_time():
    found = result("b0.8")
    fallen = replace(found.simulation, outcome=Outcome("fell", 3.21, "fell"))
    lost = replace(found.measurement, kind="growth", p=None, period=None)
    assert "fell at 3.21 s" in compare(replace(found, simulation=fallen, measurement=lost)).words


@pytest.mark.parametrize("name", ["b0.8", "b1.7", "exact", "three-link"])
def test_record_is_plain_json(name):
    record = to_json(compare(result(name)))
    text = json.dumps(record, allow_nan=False)
    assert json.loads(text) == record
    assert {"case", "plant", "predicted", "measured", "relative_error"} <= record.keys()
    assert {"interval", "period", "amplitude", "converged"} <= record["measured"].keys()
    assert {"period", "amplitude"} <= record["relative_error"].keys()
    assert isinstance(record["measured"]["converged"], bool)
    assert isinstance(record["measured"]["amplitude"], list)


def test_eigenvalue_is_written_as_real_and_imaginary_part():
    assert to_json(compare(result("b1.2")))["predicted"]["eigenvalue"] == [-1.0, 0.0]


def test_record_has_null_for_what_is_not_a_number():
    found = result("exact")
    record = to_json(compare(replace(found, measurement=replace(found.measurement, interval=float("nan")))))
    assert record["measured"]["interval"] is None
