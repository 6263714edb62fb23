"""The shape of a CSV file: where its numbers begin, what separates them, and the names of its columns."""

from __future__ import annotations

import csv
import re
from dataclasses import dataclass
from itertools import islice

from icmj.base.text import one_line
from icmj.errors import DataError

HEAD = 200  # lines in which the numbers must begin
LONGEST = 200_000  # bytes of one line

_LINE = re.compile(rb"[^\r\n]*(?:\r\n?|\n)|[^\r\n]+")
_NUMBER = re.compile(r"[-+]?(\d+([.,]\d*)?|[.,]\d+)([eE][-+]?\d+)?")
_MISSING = ("", "-", "na", "n/a", "nan", "inf", "-inf", "null", "none")


@dataclass(frozen=True)
class CsvShape:
    """The format of a CSV file.

    Attributes:
        headers: of all columns; "" where there is none.
        numeric: which columns hold numbers in their first row.
        delimiter: between fields; a blank stands for any number of them.
        decimal: "." or ",".
        first: the line where numbers begin, counted from 1.
        offset: where that is in the file [bytes].
    """

    headers: tuple[str, ...]
    numeric: tuple[bool, ...]
    delimiter: str
    decimal: str
    first: int
    offset: int

    def table(self, rows: bytes) -> bytes:
        """Some rows of numbers, with one ``delimiter`` between their fields."""
        if self.delimiter != " ":
            return rows
        return re.sub(rb" +", b" ", re.sub(rb"(?m)^ +| +(?=\r?$)", b"", rows))


def csv_shape(text: bytes) -> CsvShape:
    """The shape of a CSV file from its first ``HEAD`` lines: numbers begin with two lines of the same form.

    Raises:
        DataError: if it is no text, or no row of numbers is among them.
    """
    if not text.strip():
        raise DataError("the file is empty")
    if b"\0" in text[:LONGEST]:
        raise DataError("not text; expected CSV, Parquet (.parquet) or npz (.npz)")
    lines, before = _lines(text), ""
    for number, line in enumerate(lines, 1):
        words = line.words
        if not words or words.startswith(("#", "%")):
            before = words.lstrip("#% ") or before
            continue
        row = _Row.of(words)
        following = next((other.words for other in lines[number:] if other.words), None)
        if row.numbers and (following is None or row.alike(_Row.of(following))):
            headers = _fields(before, row.delimiter) if before else []
            if len(headers) != len(row.fields):
                headers = [""] * len(row.fields)
            decimal = "," if row.delimiter != "," and any("," in field for field in row.numbers) else "."
            return CsvShape(tuple(headers), row.numeric, row.delimiter, decimal, number, line.offset)
        before = words
    raise DataError(f"no rows of numbers in its first {len(lines)} lines (the last is {one_line(before, 60)!r})")


@dataclass(frozen=True)
class _Line:
    """A line of the file: its text without surrounding white space, and its offset [bytes]."""

    words: str
    offset: int


@dataclass(frozen=True)
class _Row:
    """The fields of a line."""

    fields: tuple[str, ...]
    delimiter: str

    @classmethod
    def of(cls, words: str) -> _Row:
        delimiter = next((candidate for candidate in ";\t," if candidate in words), " ")
        return cls(tuple(_fields(words, delimiter)), delimiter)

    @property
    def numbers(self) -> list[str]:
        return [field for field in self.fields if _NUMBER.fullmatch(field)]

    @property
    def numeric(self) -> tuple[bool, ...]:
        """Whether each field is a number, or stands for a missing one."""
        return tuple(bool(_NUMBER.fullmatch(field)) or field.lower() in _MISSING for field in self.fields)

    def alike(self, other: _Row) -> bool:
        return (self.delimiter, self.numeric) == (other.delimiter, other.numeric)


def _lines(text: bytes) -> list[_Line]:
    found: list[_Line] = []
    offset = 0
    for number, raw in enumerate(islice((line.group() for line in _LINE.finditer(text)), HEAD), 1):
        if len(raw) > LONGEST:
            raise DataError(f"line {number} has more than {LONGEST} characters; expected a table")
        try:
            words = raw.decode("utf-8-sig").strip()
        except UnicodeDecodeError as error:
            raise DataError(f"line {number} is not UTF-8 text; save the file as UTF-8") from error
        found.append(_Line(words, offset))
        offset += len(raw)
    return found


def _fields(words: str, delimiter: str) -> list[str]:
    if delimiter == " ":
        return words.split()
    try:
        return [field.strip() for field in next(csv.reader([words], delimiter=delimiter), [])]
    except csv.Error as error:
        raise DataError(f"a line that is not a row of a table ({error})") from error
