"""Notation in HTML: subscripts where the paper has them, nowhere else, and nothing unescaped."""

from __future__ import annotations

import pytest

from icmj.report.notation import notation, symbol


@pytest.mark.parametrize(
    ("text", "html"),
    [
        ("Δ_crit = 1.8 s", "Δ<sub>crit</sub> = 1.8 s"),
        ("2Δ_crit, q_t", "2Δ<sub>crit</sub>, q<sub>t</sub>"),
        ("hinge_rate", "hinge_rate"),
        ("a < b & c", "a &lt; b &amp; c"),
        ("<script>x_1</script>", "&lt;script&gt;x<sub>1</sub>&lt;/script&gt;"),
    ],
)
def test_notation(text, html):
    assert str(notation(text)) == html


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("q_t", "q_t"),
        ("Q_t", "Q_t"),
        ("delta_min", "Δ_min"),
        ("gamma", "γ"),
        ("clock", "clock"),
        ("dead_zone", "dead zone"),
    ],
)
def test_a_name_in_code_as_the_paper_writes_it(name, text):
    assert symbol(name) == text
