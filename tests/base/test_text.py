"""One line of anything: what a terminal would obey is not in it."""

import codecs

import pytest

from icmj.base.text import one_line, spell, strip_controls


@pytest.mark.parametrize(("text", "line"), [
    ("a\nb\t c", "a b c"),
    ("\x1b[31mred\x1b[0m and \x1b]0;title\x07plain", "red and plain"),
    ("bell\x07 back\x08 \x9b31m", "bell back 31m"),
    ("right\u202eleft", "right left"),
    ("marks\u200e \u200f\u061c of\u2066 direction\u2069", "marks of direction"),
    ("tag\U000e0041ged", "tag ged"),
    ("ζ → ½", "ζ → ½"),
    ("\ud800", ""),
])  # fmt: skip
def test_what_a_terminal_would_obey_is_taken_out(text: str, line: str) -> None:
    assert one_line(text) == line


def test_one_line_is_cut_and_lines_of_printable_text_stay() -> None:
    assert one_line("abc" * 10, 5) == "abca…"
    assert strip_controls("a\n\tb\x1b[31m\x9b\u202ec\u2067 [/] ζ 重り\ud800") == "a\n\tb[31mc [/] ζ 重り"


def test_what_a_stream_cannot_encode_is_spelt() -> None:
    codecs.register_error("icmj test", spell)
    assert "Δ_crit = 1 ± 0.1 – 重\udce9 ½".encode("ascii", "icmj test") == rb"Delta_crit = 1 +- 0.1 - \u91cd\udce9 \xbd"
    assert "λ\udce9".encode("utf-8", "icmj test") == "λ\\udce9".encode()
