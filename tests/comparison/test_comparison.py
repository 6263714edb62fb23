"""A run against its prediction: the numbers by hand."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from report_cases import result

from icmj.comparison.comparison import compare, to_json
from icmj.comparison.facts import INTERVAL_TOLERANCE, on_predicted_cycle
from icmj.comparison.verdict import verdict_in_words


@pytest.mark.parametrize(("name", "period_in_intervals"), [("b0.8", 1), ("b1.2", 2), ("neglected", 1)])
def test_a_run_on_the_predicted_cycle(name, period_in_intervals):
    comparison = compare(result(name))
    assert comparison.measured.converged
    assert comparison.measured.period == pytest.approx(period_in_intervals * comparison.predicted.delta_crit, rel=1e-9)
    error = comparison.relative_error
    for value in (error.interval, error.period, error.gamma, error.largest_amplitude):
        assert abs(value) < 1e-9
    assert comparison.words == verdict_in_words(result(name), True)


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
    assert not on_predicted_cycle(found.prediction, other)
    assert not compare(replace(found, measurement=other)).measured.converged


def test_unequal_intervals_with_the_right_mean_are_not_the_predicted_cycle():
    found = result("b1.2")
    delta = found.prediction.delta_crit
    uneven = replace(found.measurement, intervals=np.array([0.8, 1.2]) * delta)
    assert not on_predicted_cycle(found.prediction, uneven)


@pytest.mark.parametrize("change", [{"mirrored": True}, {"p": 2}, {"kind": "quasi-periodic"}, {"interval": None}])
def test_the_cycle_must_have_the_predicted_form(change):
    found = result("b0.8")
    assert on_predicted_cycle(found.prediction, found.measurement)
    assert not on_predicted_cycle(found.prediction, replace(found.measurement, **change))


def test_without_a_predicted_cycle_there_is_no_error():
    for name in ("b1.7", "exact"):
        comparison = compare(result(name))
        assert not comparison.predicted.cycle
        assert not comparison.measured.converged
        assert comparison.relative_error.interval is None
    assert compare(result("b1.7")).predicted.delta_crit == pytest.approx(1.112, abs=5e-4)
    assert compare(result("exact")).predicted.delta_crit is None


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
