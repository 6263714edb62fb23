"""Notation in HTML: subscripts where the paper has them, nowhere else, and nothing unescaped."""

import pytest
from markupsafe import Markup

from icmj.report.notation import SYMBOLS, notation, symbol, unbroken


def explained(letter: str, index: str) -> str:
    """A symbol that the page knows, with its meaning where a pointer rests on it."""
    return f'<abbr title="{SYMBOLS[f"{letter}_{index}"]}">{letter}<sub>{index}</sub></abbr>'


def alone(letter: str) -> str:
    return f'<abbr title="{SYMBOLS[letter]}">{letter}</abbr>'


@pytest.mark.parametrize(("text", "html"), [
    ("Δ_crit = 1.8 s", f"{explained('Δ', 'crit')} = 1.8 s"),
    ("2Δ_crit, q_t", f"2{explained('Δ', 'crit')}, {explained('q', 't')}"),
    ("R_o", "R<sub>o</sub>"),
    ("±γ of φ(Δ)", f"±{alone('γ')} of {alone('φ')}(Δ)"),
    ("b = 0.9, bb = 1, a.b = 2, b, ‖χ̂‖", f"{alone('b')} = 0.9, bb = 1, a.b = 2, b, ‖χ̂‖"),
    ("hinge_rate", "hinge_rate"),
    ("a < b & c", "a &lt; b &amp; c"),
    ("closes to 1.7e-12, at -1, not b-2", "closes to 1.7 × 10<sup>−12</sup>, at −1, not b-2"),
    ("0x1e5 and x1.5e3", "0x1e5 and x1.5e3"),
    ("<script>x_1</script>", "&lt;script&gt;x<sub>1</sub>&lt;/script&gt;"),
])  # fmt: skip
def test_notation(text, html):
    assert str(notation(text)) == html


@pytest.mark.parametrize(("name", "text"), [
    ("q_t", "q_t"), ("Q_t", "Q_t"), ("delta_min", "Δ_min"), ("gamma", "γ"), ("clock", "clock"),
    ("dead_zone", "dead zone"),
])  # fmt: skip
def test_a_name_in_code_as_the_paper_writes_it(name, text):
    assert symbol(name) == text


@pytest.mark.parametrize(("text", "joined"), [
    ("Three-link standing, b = 0.9", "Three-link standing, b~=~0.9"),
    ("in 0.759 s it settles", "in 0.759~s it settles"),
    ("(|λ| = 1.20)", "(|^λ|^~=~1.20)"),
    ("a <b> of A − Bk", "a <b> of A~−~Bk"),
    ("no more than words", "no more than words"),
])  # fmt: skip
def test_what_belongs_together_stays_on_one_line(text, joined):
    expected = joined.replace("~", "\N{NO-BREAK SPACE}").replace("^", "\N{WORD JOINER}")
    assert unbroken(text) == expected
    assert isinstance(unbroken(Markup(text)), Markup)
    assert not isinstance(unbroken(text), Markup)


def test_what_is_no_text_is_left_alone():
    for value in (3, None, 0.5, "data:" + "a = b" * 5000):
        assert unbroken(value) is value
