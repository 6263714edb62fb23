"""What results, and what they are made of, show of themselves: short, with units, whatever there is or is not."""

import re
from dataclasses import fields, replace

import pytest
from report_cases import CASES, result

import icmj
from icmj.case.comparison import compare


def things(name):
    found = result(name)
    return (found.prediction, found.measurement, found.simulation, compare(found), found, found.to_series())


@pytest.mark.parametrize("name", CASES)
def test_all_show_themselves_in_a_line_and_a_table(name):
    for thing in things(name):
        line = repr(thing)
        assert line.startswith(f"<{type(thing).__name__}: ")
        assert "\n" not in line
        assert len(line) < 300
        assert "array" not in line
        html = thing._repr_html_()
        assert html.count("<tr") == html.count("</tr>") >= 5
        assert len(html) < 12_000
        assert not re.search(r"nan|None|array\(", html)


def test_numbers_have_their_units():
    prediction, measurement, simulation, comparison, whole, series = things("three-link")
    assert "Δ_crit = 0.759379 s, λ_crit = +1" in repr(prediction)
    assert "period-1 cycle, open-loop interval 0.759379 s" in repr(measurement)
    assert re.search(r"linear plant under event control, \d+ events, ran to 20 s", repr(simulation))
    for thing in (prediction, measurement, comparison):
        assert re.search(r"shank\xa00\.00\d+\xa0rad\xa0\(0\.\d+°\), thigh", thing._repr_html_()), type(thing)
    assert "three-link on the linear plant, on the predicted cycle" in repr(comparison)
    assert "Three-link standing, b = 0.9" in whole._repr_html_()
    assert "N m to " in series._repr_html_()


def test_what_is_not_there_is_a_dash_or_said():
    prediction, _, simulation, comparison, *_ = things("exact")
    assert "no Δ_crit up to 3 s" in repr(prediction)
    assert "none up to 3 s" in prediction._repr_html_().replace("<sub>", "_").replace("</sub>", "")
    assert "–" in comparison._repr_html_()
    assert "not known" in replace(simulation, precision={})._repr_html_()


def test_a_case_shows_its_prediction(root):
    case = icmj.prepare(icmj.load_run(root / "runs" / "simple-0.8.toml"))
    assert repr(case).startswith("<Case: simple-0.8, Δ_crit = 1.80654 s")
    assert "2 states, 1 input, 1 output" in case._repr_html_()


def test_the_line_is_the_card_and_no_field_is_lost():
    prediction = result("b0.8").prediction
    assert "card" not in {field.name for field in fields(prediction)}
    assert prediction.outputs == ("angle",)
    assert prediction.output_units == ("rad",)
