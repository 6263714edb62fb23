"""Cards: one line at a prompt, a table in a notebook, numbers with units, nothing that breaks a page."""

from __future__ import annotations

from dataclasses import dataclass
from html.parser import HTMLParser

import numpy as np
import pytest

from icmj.base.card import Card, Shown, amount, amounts, count, number, relative


@dataclass(frozen=True, repr=False)
class Thing(Shown):
    words: str

    def card(self):
        return Card("a thing", (("Δ_crit", "1 s"), ("x_o.ankle", "<b>")), self.words)


class Page(HTMLParser):
    """Which tags are open, and the text."""

    def __init__(self, html):
        super().__init__()
        self.open, self.text = [], ""
        self.feed(html)

    def handle_starttag(self, tag, attrs):
        self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text += data


def test_a_dataclass_shows_its_card():
    thing = Thing("It is <script>alert(1)</script> & so on.")
    assert repr(thing) == "<Thing: a thing>"
    html = thing._repr_html_()
    page = Page(html)
    assert page.open == []
    assert "<script>" not in html
    assert "Δ<sub>crit</sub>" in html
    assert "x_o.ankle" in html  # the name of a signal is not a symbol
    assert page.text == "ThingΔcrit1 sx_o.ankle<b>It is <script>alert(1)</script> & so on."
    assert "<div style" not in Thing("")._repr_html_()


@pytest.mark.parametrize(
    ("value", "unit", "words"),
    [
        (0.1, "rad", "0.1 rad (5.73°)"),
        (-2.5, "N m", "−2.5 N m"),
        (3.0, "", "3"),
        (None, "s", "–"),
        (float("nan"), "s", "–"),
        (float("inf"), "m", "inf m"),
    ],
)
def test_amounts_have_their_unit(value, unit, words):
    assert amount(value, unit) == words


def test_several_amounts_have_their_names_and_do_not_break():
    values = np.array([1.0, 2.0])
    found = amounts(values, ("shank", "cart"), ("rad", "m"))
    assert found == "shank\xa01\xa0rad\xa0(57.3°), cart\xa02\xa0m"
    assert amounts(values, (), ()) == "1, 2"
    assert amounts(None, (), ()) == "–"


def test_eigenvalues_errors_and_counts():
    assert [number(v) for v in (1 + 0j, -1 + 0j, 0.5 - 0.25j, None)] == ["+1", "−1", "0.5 − 0.25j", "–"]
    assert [relative(v) for v in (-2.3e-4, None, float("nan"))] == ["−2.3e−04", "–", "–"]
    assert [count(1, "state"), count(2, "state")] == ["1 state", "2 states"]
