"""One line of anything: what a terminal would obey is not in it."""

from __future__ import annotations

import pytest

from icmj.base.text import one_line


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("a\nb\t c", "a b c"),
        ("\x1b[31mred\x1b[0m and \x1b]0;title\x07plain", "red and plain"),
        ("bell\x07 back\x08 \x9b31m", "bell back 31m"),
        ("right\u202eleft", "right left"),
        ("ζ → ½", "ζ → ½"),
        ("\ud800", ""),
    ],
)
def test_what_a_terminal_would_obey_is_taken_out(text: str, line: str) -> None:
    assert one_line(text) == line


def test_it_is_cut() -> None:
    assert one_line("abc" * 10, 5) == "abca…"
