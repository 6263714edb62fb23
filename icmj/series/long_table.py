"""A long table: trials one below the other, told apart by columns that name person, condition and trial."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from icmj.base.text import one_line
from icmj.errors import DataError

if TYPE_CHECKING:
    from icmj.series.series import Series

TOPICS = {
    "person": ("person", "subject", "participant", "patient", "proband", "sujet"),
    "condition": ("condition", "task", "bedingung"),
    "trial": ("trial", "trials", "repetition", "versuch", "essai"),
}
"""What a column of labels names, and its first words; the facts of a series have its labels by these topics."""
MOST = 10_000  # trials in a table
Rows = NDArray[np.intp] | slice
_ENDS = {"", "id", "no", "nr", "name", "number", "code", "label"}  # words that may follow


def find_labels(headers: Sequence[str], asked: Sequence[str] = ()) -> dict[int, str]:
    """The topics of the columns that label rows, by their places; a column that is asked for by name is a signal."""
    found = {}
    for place, header in enumerate(headers):
        first, *more = re.split(r"[\W_]+", re.sub("(?<=[a-z])(?=[A-Z])", "_", header).lower().strip())
        topic = next((topic for topic, words in TOPICS.items() if first in words), None)
        if topic is not None and set(more) <= _ENDS and header not in asked:
            found[place] = topic
    return found


def split_rows(labels: Sequence[tuple[str, Any]], rows: int) -> list[tuple[dict[str, str], Rows]]:
    """The labels and the rows of each trial, in the order in which trials begin; their rows may alternate.

    Without labels there is one, of all rows.

    Args:
        labels: the topic and the cells of each column of labels, pyarrow arrays of text.
        rows: how many of their rows are used.

    Raises:
        DataError: if a row has no label, or there are more than :data:`MOST` trials.
    """
    if not labels:
        return [({}, slice(rows))]
    codes = np.zeros(rows, dtype=np.intp)
    for topic, cells in labels:
        coded = cells.slice(0, rows).combine_chunks().dictionary_encode()
        if coded.null_count:
            raise DataError(f"row {coded.is_null().index(True).as_py() + 1} has no {topic}; write it into every row")
        together = codes * max(len(coded.dictionary), 1) + coded.indices.to_numpy()
        _, codes = np.unique(together, return_inverse=True)  # small again, whatever the number of columns
    if rows and codes.max() >= MOST:
        raise DataError(f"more than {MOST} trials one below the other; cut it into parts")
    order = np.argsort(codes, kind="stable")
    parts = np.split(order, np.flatnonzero(np.diff(codes[order])) + 1)
    found: list[tuple[dict[str, str], Rows]] = []
    for part in sorted(parts, key=lambda part: int(part[0]) if len(part) else 0):
        named: dict[str, str] = {}
        for topic, cells in labels if len(part) else ():
            word = one_line(str(cells[int(part[0])].as_py()).strip(), 60)
            named[topic] = f"{named[topic]}, {word}" if topic in named else word
        found.append((named, part))
    return found


def label_of(series: Series, topics: Sequence[str] = tuple(TOPICS)) -> str:
    """What tells a trial from the others of its table, such as ``person P1, condition eyes open, trial 2``."""
    return ", ".join(_name(topic, series.facts[topic]) for topic in topics if topic in series.facts)


def labels_of(facts: Mapping[str, str]) -> dict[str, str]:
    """The labels among the facts of a series, by topic."""
    return {topic: facts[topic] for topic in TOPICS if topic in facts}


def _name(topic: str, label: str) -> str:
    return label if topic in label.lower() else f"{topic} {label}"
