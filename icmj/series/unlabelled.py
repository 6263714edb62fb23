"""Trials one below the other that no known column labels: times, words or numbers show them, and are asked about."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from icmj.base.text import one_line
from icmj.errors import DataError
from icmj.series.long_table import Rows

SHORTEST = 100  # rows of a trial, fewer than which a number may stand in that is none of a trial; ours
_NAMES = "'trial', 'condition' or 'person'"
_ASK = f"if it tells trials apart, call it {_NAMES}; else name the columns to read"
_NUMBER = re.compile(r"[-+−]?\d*[.,]?\d+([eE][-+]?\d+)?")


def refuse_second_trial(t: NDArray[np.float64]) -> None:
    """See that times do not begin again, as those of trials without labels do.

    Raises:
        DataError: if they do.
    """
    again = np.flatnonzero(np.diff(t) < 0)
    if len(again) and again[0] > 1 and t[again[0] + 1] <= t[1]:
        raise DataError(
            f"times begin again in row {again[0] + 2}, as of trials one below the other; call what tells these apart "
            f"{_NAMES}"
        )


def refuse_unknown_labels(texts: Sequence[tuple[str, Any]], trials: Sequence[Rows]) -> None:
    """See that no column of text changes within a trial as labels do, and that none has numbers.

    Marks, which most rows have none of, and what differs from row to row, such as the time of the day, are no labels.

    Args:
        texts: name and cells of each column of text that has no topic, pyarrow arrays of text.
        trials: the rows of each trial.

    Raises:
        DataError: if one does, as its trials would be taken for one.
    """
    for name, cells in texts:
        coded = cells.combine_chunks().dictionary_encode()
        words = [str(word).strip() for word in coded.dictionary.to_pylist()]
        if words and all(_NUMBER.fullmatch(word) for word in words[:100]) and len(words) > 1:
            raise DataError(f"{name}: {one_line(words[0], 40)!r} and others are numbers as text; save them as numbers")
        codes = coded.indices.fill_null(-1).to_numpy(zero_copy_only=False)
        for rows in trials:
            own = codes[rows]
            if len(found := np.unique(own)) > 1 and found[0] >= 0 and all(words) and 2 * len(found) <= len(own):
                first, second = (one_line(words[one], 40) for one in found[:2])
                raise DataError(f"{name} is {first!r} in some rows and {second!r} in others; {_ASK}")


def refuse_unknown_numbers(name: str, values: NDArray[np.float64]) -> None:
    """See that a column of numbers without a unit does not number trials.

    Raises:
        DataError: if its numbers are whole, and each stands in many rows one below the other.
    """
    steps = np.flatnonzero(np.diff(values))
    if len(steps) and len(steps) * SHORTEST < len(values) and (values == np.rint(values)).all():
        first, second = values[steps[0]], values[steps[0] + 1]
        raise DataError(f"{name} is {first:g} in some rows and then {second:g}; {_ASK}, or give it a unit")
