"""Cards: one line at a prompt, a table in a notebook, numbers with units, nothing that breaks a page."""

from dataclasses import dataclass
from html.parser import HTMLParser

from icmj.base.card import Card, WithCard


@dataclass(frozen=True, repr=False)
class Thing(WithCard):
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
