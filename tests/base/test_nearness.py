"""What was probably meant: other separators and capitals, one slip, and nothing where nothing is near."""

import pytest

from icmj.base.similar_names import find_nearest, suggest

NAMES = ("delta_min", "q_t", "Q_t", "threshold", "system-matched")


@pytest.mark.parametrize(("given", "meant"), [
    ("delta-min", "delta_min"), ("DeltaMin", "delta_min"), ("treshold", "threshold"),
    ("system_matched", "system-matched"), ("nothing like it", None), ("", None), ("threshold" * 10**5, None),
])  # fmt: skip
def test_the_nearest_name(given, meant):
    assert find_nearest(given, NAMES) == meant


def test_words_only_where_there_is_something_to_say():
    assert suggest("treshold", NAMES) == "; did you mean threshold?"
    assert suggest("x", NAMES) == ""
    assert suggest("x", ()) == ""
