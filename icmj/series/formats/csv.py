"""Tables of text as instruments and spreadsheets write them, with the form that :mod:`icmj.series.csv_table` finds.

They are written with a row of names such as ``ankle [rad]`` between commas, and numbers that are restored bit for bit.
"""

from __future__ import annotations

import codecs
import io
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

import numpy as np

from icmj.base.array import Array
from icmj.base.text import one_line
from icmj.errors import DataError
from icmj.series.columns import bracket_units, choose_columns, name_and_unit
from icmj.series.csv_table import HEAD, LONGEST_LINE, TableForm, find_form, list_missing_words
from icmj.series.long_table import find_labels
from icmj.series.series import Series
from icmj.series.time_of_day import count_from_first, read_times
from icmj.series.units import canonicalise

if TYPE_CHECKING:
    import pyarrow as pa

SUFFIXES = (".csv",)
MOST_COLUMNS = 2000
MOST_LINE = 1_000_000  # bytes
PART = 8_000_000  # bytes of a file that are looked at together


def read(path: Path, file: BinaryIO, columns: Sequence[str], rate: float | None) -> tuple[Series, ...]:
    import pyarrow as pa

    if (mark := file.read(2)) in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE):
        file = io.BytesIO((mark + file.read()).decode("utf-16", errors="replace").encode())
    file.seek(0)
    form = find_form(b"".join(islice(iter(lambda: file.readline(LONGEST_LINE + 1), b""), HEAD)))
    if len(form.headers) > MOST_COLUMNS:
        raise DataError(f"{len(form.headers)} columns; expected at most {MOST_COLUMNS}")
    headers = [header or f"column {i + 1}" for i, header in enumerate(bracket_units(form.headers))]
    labels = find_labels(headers, columns)
    numeric = [*form.stamps, *(i for i, number in enumerate(form.numeric) if number and i not in labels)]
    left = [f"{headers[i]}, which is text" for i in form.texts if i not in labels]
    for i, words in form.faults.items():
        if i in form.texts and i not in labels and not columns:
            raise DataError(f"{headers[i]}: {words!r} is no number; write the unit in the name")
    units = [_one_unit(*of) for of in zip(headers, form.units, form.cell_units, strict=True)]
    units = ["s" if i in form.stamps else unit for i, unit in enumerate(units)]
    choice = choose_columns(
        [headers[i] for i in numeric], [units[i] for i in numeric], columns, rate, left,
        {numeric.index(i): words for i, words in form.faults.items() if i in numeric},
    )  # fmt: skip
    chosen = [numeric[i] for i in choice.at]
    texts = [*labels, *(i for i in form.texts if i not in labels and not columns)]
    file.seek(form.offset)
    ends = [(text.count(b"\n"), text.count(b"\r")) for text in iter(lambda: file.read(PART), b"")]
    # a blank line ends, too; rows may be fewer, not more
    data = choice.room(max(map(sum, zip(*ends, strict=True)), default=0) + 1)
    file.seek(form.offset)
    count, cut, named = 0, "", [list[pa.Array]() for _ in texts]
    for text in _parts(file):
        if text.strip() and not text.endswith((b"\n", b"\r")) and form.ends_midway(text):
            cut = "left out: the last line, which ends midway"
            break
        form.refuse_thousands(text)
        rows, found = _read_rows(text, form, chosen, texts)
        if count + len(rows) > len(data):  # lines ended in both ways
            raise DataError("mixed line endings; save the file with one kind of line ending")
        data[count : count + len(rows)] = rows
        count += len(rows)
        for known, more in zip(named, found, strict=True):
            known += more.chunks
    for i in (i for i, at in enumerate(chosen) if at in form.stamps):
        data[:count, i] = count_from_first(data[:count, i])
    cells = [pa.chunked_array(known, pa.string()) for known in named]
    *before, last = choice.to_trials(data[:count], list(zip((headers[i] for i in texts), cells, strict=True)))
    return (*before, replace(last, facts={**last.facts, "cut": cut}) if cut else last)


def _one_unit(header: str, below: str, behind: str) -> str:
    """The unit of a column: of those in brackets in its name, in a row of units, or behind its numbers."""
    said = {"in its name": name_and_unit(header)[1], "below it": below, "behind its numbers": behind}
    stated = {where: unit for where, unit in said.items() if unit}
    if len({canonicalise(unit) for unit in stated.values()}) > 1:
        words = " and ".join(f"{unit} {where}" for where, unit in stated.items())
        raise DataError(f"{header}: {words}; correct one")
    return below or behind


def _parts(file: BinaryIO) -> Iterator[bytes]:
    """The rest of a file, in parts that end with complete lines."""
    rest = b""
    while text := file.read(PART):
        text = rest + text
        end = max(text.rfind(b"\n"), text.rfind(b"\r", 0, -1)) + 1
        if len(text) - end > MOST_LINE:
            raise DataError(f"a line of more than {MOST_LINE} characters; expected a table")
        rest = text[end:]
        yield text[:end]
    yield rest


def _read_rows(
    text: bytes, form: TableForm, chosen: Sequence[int], labels: Sequence[int]
) -> tuple[Array, list[pa.ChunkedArray]]:
    """The numbers of the chosen columns, shape (N, chosen), and the cells of labels, as text."""
    import pyarrow as pa
    import pyarrow.csv as pc

    words = {i for i in (*chosen, *labels) if form.cell_units[i] or i in form.stamps or i in labels}
    types = {str(i): pa.string() if i in words else pa.float64() for i in (*chosen, *labels)}
    if not text.strip():
        return np.empty((0, len(chosen))), [pa.chunked_array([], pa.string()) for _ in labels]
    text = form.clean(text)
    try:
        table = pc.read_csv(
            pa.BufferReader(text),
            # by one thread: one that is still at work when the interpreter is taken down may abort it
            pc.ReadOptions(
                column_names=[str(i) for i in range(len(form.headers))], use_threads=False, block_size=len(text) + 1
            ),
            pc.ParseOptions(delimiter=form.delimiter),
            pc.ConvertOptions(
                column_types=types,
                include_columns=list(types),
                null_values=list_missing_words(),
                strings_can_be_null=True,
                decimal_point=form.decimal,
            ),
        )
        numbers = [
            read_times(table[str(i)]) if i in form.stamps
            else _without_unit(table[str(i)], form.cell_units[i], form.decimal)
            for i in chosen
        ]  # fmt: skip
        return np.column_stack(numbers), [table[str(i)] for i in labels]
    except pa.ArrowInvalid as error:
        raise DataError(f"not a table of numbers after line {form.first} ({one_line(error, 160)})") from error


def _without_unit(column: pa.ChunkedArray, unit: str, decimal: str) -> Array:
    """The numbers of a column; "" is that of one whose cells are nothing else."""
    import pyarrow as pa
    import pyarrow.compute as pc

    if unit:
        cells = pc.utf8_trim_whitespace(column)
        others = pc.filter(cells, pc.invert(pc.ends_with(cells, unit)))
        if len(others):
            raise DataError(f"{others[0].as_py()!r} is not in {unit}, as the cells above it are; correct it")
        numbers = pc.utf8_trim_whitespace(pc.utf8_slice_codeunits(cells, 0, -len(unit)))
        column = pc.cast(pc.replace_substring(numbers, decimal, "."), pa.float64())
    values: Array = column.to_numpy()
    return values


def write(series: Series, part: Path) -> None:
    import pyarrow as pa
    import pyarrow.csv as pc

    columns = (series.t, *series.values.T)
    table = pa.table([pa.array(column) for column in columns], names=[str(i) for i in range(len(columns))])
    with open(part, "wb") as file:
        file.write((",".join(_quote(name) for name in series.headers) + "\n").encode())
        pc.write_csv(table, file, pc.WriteOptions(include_header=False, quoting_style="none"))


def _quote(name: str) -> str:
    name = " ".join(name.split())
    return '"' + name.replace('"', '""') + '"' if "," in name or '"' in name else name
