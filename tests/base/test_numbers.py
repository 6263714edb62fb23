"""Numbers in words: against what a reader would write by hand."""

import numpy as np
import pytest

from icmj.base import numbers

NB = "\N{NO-BREAK SPACE}"


@pytest.mark.parametrize(("value", "figures", "text"), [
    (1.80654, 5, "1.8065"), (0.75937857, 4, "0.7594"), (-2.9382, 3, "−2.94"), (0.0, 4, "0"), (9.99996, 5, "10.000"),
    (1234.5, 4, "1234" if f"{1234.5:.3e}" == "1.234e+03" else "1235"),
    (2.3e-7, 2, f"2.3{NB}×{NB}10⁻⁷"), (-1.5e12, 2, f"−1.5{NB}×{NB}10¹²"),
    (None, 4, "–"), (np.nan, 4, "–"), (np.inf, 4, "∞"), (-np.inf, 4, "−∞"),
])  # fmt: skip
def test_number(value, figures, text):
    assert numbers.number(value, figures) == text


@pytest.mark.parametrize("value", np.concatenate([np.geomspace(1e-12, 1e12, 97), -np.geomspace(1e-12, 1e12, 97)]))
def test_number_reads_back_to_its_figures(value):
    text = numbers.number(value, 6).replace("−", "-").replace(NB, "")
    head, _, power = text.partition("×10")
    exponent = int(power.translate(str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")) or 0)
    assert float(head) * 10.0**exponent == pytest.approx(value, rel=5.1e-6)


@pytest.mark.parametrize(("value", "text"), [
    (0.01, "0.01"), (30.0, "30"), (1.0, "1"), (1e-4, f"1{NB}×{NB}10⁻⁴"), (-0.5, "−0.5"), (100.0, "100"),
])  # fmt: skip
def test_short_has_no_closing_zeros(value, text):
    assert numbers.short(value) == text


@pytest.mark.parametrize(("value", "text"), [
    (2.34e-4, f"+2.3{NB}×{NB}10⁻⁴"), (-0.011, f"−1.1{NB}×{NB}10⁻²"), (3e-16, "< 10⁻¹⁴"), (None, "–"), (np.nan, "–"),
])  # fmt: skip
def test_error(value, text):
    assert numbers.error(value) == text
    assert numbers.error(value, signed=False) == text.lstrip("+−")


@pytest.mark.parametrize(
    ("value", "text"), [(1 + 0j, "+1"), (-1 + 0j, "−1"), (None, "–"), (0.6 + 0.8j, "0.6000 + 0.8000j")]
)
def test_eigenvalue(value, text):
    assert numbers.eigenvalue(value) == text


@pytest.mark.parametrize(("value", "text"), [
    (True, "yes"), (0.1, "0.1"), ([1.0, 2.0], "[1, 2]"), ({"hinge": 0.02}, "hinge = 0.02"), ({}, "–"),
])  # fmt: skip
def test_setting(value, text):
    assert numbers.setting(value) == text


@pytest.mark.parametrize(("value", "unit", "words"), [
    (0.1, "rad", "0.1 rad (5.73°)"), (-2.5, "N m", "−2.5 N m"), (3.0, "", "3"), (-0.0, "", "0"),
    (None, "s", "–"), (float("nan"), "s", "–"), (float("inf"), "m", "–"),
])  # fmt: skip
def test_amounts_have_their_unit(value, unit, words):
    assert numbers.amount(value, unit) == words


def test_several_amounts_have_their_names_and_do_not_break():
    values = np.array([1.0, 2.0])
    found = numbers.amounts(values, ("shank", "cart"), ("rad", "m"))
    assert found == "shank\xa01\xa0rad\xa0(57.3°), cart\xa02\xa0m"
    assert numbers.amounts(values, (), ()) == "1, 2"
    assert numbers.amounts(None, (), ()) == "–"


def test_poles_marks_roots_errors_and_counts():
    assert numbers.poles([2 + 0j, -5.198 + 28.288j, -5.198 - 28.288j]) == "2.000, −5.198 ± 28.29j"
    assert [numbers.mark(value) for value in (True, False, None)] == ["✓", "✗", "–"]
    assert [numbers.root(v) for v in (1 + 0j, -1 + 1e-15j, 0.5 - 0.25j)] == ["1", "−1", "0.5 − 0.25j"]
    assert numbers.pairs([-1.5 + 2j, -1.5 - 2j, -3.0 + 0j]) == "−1.5 ± 2j, −3"
    assert [numbers.relative(v) for v in (-2.3e-4, None, float("nan"))] == ["−2.3e−04", "–", "–"]
    assert [numbers.count(1, "state"), numbers.count(2, "state")] == ["1 state", "2 states"]


def test_lengths_of_time_are_said_for_people() -> None:
    """115 s were 1.2e+02 s."""
    times = (0.5, 3.21, 37.6, 90.0, 115.0, 600.0, 7200.0, 1e6, 1e9)
    words = ("0.5 s", "3.2 s", "38 s", "90 s", "115 s", "10 min", "2 hours", "11.6 days", "31.7 years")
    assert [numbers.format_duration(seconds) for seconds in times] == list(words)
    assert numbers.format_duration(12345.0, 2) == "3.4 hours"
