"""The form of a table of text: where its rows begin, what separates their fields, and what its columns are called.

Most single lines can be read in several ways: ``1,234`` is a number with a decimal comma, one with separated thousands,
or two numbers. The form is therefore that in which most cells of the longest run of alike lines are numbers. Where two
forms explain a table equally well, it is refused with what would tell them apart.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import islice, pairwise

from icmj.base.text import one_line
from icmj.errors import DataError
from icmj.series.time_of_day import are_times
from icmj.series.units import is_unit

HEAD = 200  # lines that are looked at
LONGEST_LINE = 200_000  # bytes of one line
MISSING = (
    *("", "-", "--", ".", "..", "...", "…", "*", "?", "na", "n/a", "nan", "-nan", "null", "none", "missing"),
    *("#n/a", "#na", "#nv", "#value!", "#wert!", "#div/0!", "#num!", "#ref!"),
)
"""What stands for a missing number, in small letters."""
_CELLS = 100_000  # of a run that are looked at
_LINE = re.compile(rb"[^\r\n]*(?:\r\n?|\n)|[^\r\n]+")
_SIGN, _POWER = "[-+−]?", r"([eEdD][-+]?\d+)?"
_PLAIN = {  # a number by its decimal sign
    ".": re.compile(rf"{_SIGN}(\d+\.?\d*|\.\d+){_POWER}|[-+]?inf", re.IGNORECASE),
    ",": re.compile(rf"{_SIGN}(\d+(,\d+)?|,\d+){_POWER}|[-+]?inf", re.IGNORECASE),
}
_THIN = "\u00a0\u2009\u202f'’"  # what separates thousands and nothing else: blanks that hold together, apostrophes
_GROUPED = {  # one whose thousands are separated, by the other sign or by one of these
    ".": re.compile(rf"{_SIGN}[1-9]\d{{0,2}}(?P<by>[,{_THIN}])\d{{3}}((?P=by)\d{{3}})*(\.\d*)?"),
    ",": re.compile(rf"{_SIGN}[1-9]\d{{0,2}}(?P<by>[.{_THIN}])\d{{3}}((?P=by)\d{{3}})*(,\d*)?"),
}
_BETWEEN = re.compile(rf"(?<=\d)[{_THIN}](?=\d{{3}})")
_QUOTED = re.compile(rb'"[-+]?[\d,.]+"')
_SMALL = re.compile(rf"{_SIGN}\d{{1,3}}")
_WITH_WORDS = re.compile(rf"{_SIGN}\d+([.,]\d+)?\s*[^\W\d]+[^\d]*")
_WITH_UNIT = re.compile(rf"(?P<number>{_SIGN}[\d.,]+{_POWER})\s*(?P<unit>[^\W\d_].*|[°%])")
_BEGUN = re.compile(rf"{_SIGN}[\d.,]*([eEdD][-+]?\d*)?")  # as much of a number as there may be where a line ends early
_SPLIT = re.compile(r"[^\s\[(]+(?:\s*(?:\[[^\]]*\]|\([^)]*\)))?")  # names between blanks, each with its unit
_FORTRAN = re.compile(rb"(?<=[\d.])[dD](?=[-+]?\d)")
_POINTED, _THOUSANDS = re.compile(rb"\d[\d.]*\.\d+"), re.compile(rb"[1-9]\d{0,2}(\.\d{3})+")
_SIGNS = ";\t,|"  # between fields, beside blanks
_RULE = re.compile(r"[\s|+:=-]*---[\s|+:=-]*")  # a line that is drawn
_MINUS = "−".encode()


@dataclass(frozen=True)
class TableForm:
    """The form of a table of text.

    Attributes:
        headers: of all columns; "" where there is none.
        units: of all columns, from a row of units below the names; "" where there is none.
        cell_units: of all columns, that which each number has behind it; "" where they have none.
        numeric: which columns hold numbers; a column without a name and a number is none, nor are numbers of rows.
        texts: places of the columns of text.
        stamps: those of times of the day (:mod:`icmj.series.time_of_day`).
        faults: what is no number in a column of numbers, or has a word in each cell, by the place of the column.
        delimiter: between fields; a blank stands for any number of them.
        decimal: "." or ",".
        grouped: whether the other of these signs separates thousands.
        fortran: whether powers of ten are written with D.
        undecided: whether no number in these lines has a sign, so that a later point may separate thousands.
        decimals: the fewest digits behind the decimal sign in each column, those of a power of ten among them.
        first: the line where numbers begin, counted from 1.
        offset: where that is in the file [bytes].
    """

    headers: tuple[str, ...]
    units: tuple[str, ...]
    cell_units: tuple[str, ...]
    numeric: tuple[bool, ...]
    texts: tuple[int, ...]
    stamps: tuple[int, ...]
    faults: dict[int, str]
    delimiter: str
    decimal: str
    grouped: bool
    fortran: bool
    undecided: bool
    decimals: tuple[int, ...]
    first: int
    offset: int

    def ends_midway(self, line: bytes) -> bool:
        """Whether a line without an end lacks fields, or digits that every number in its column has.

        A line that is something else, such as a remark below the table, does not.
        """
        cells, width = _fields(_Line(0, line.decode(errors="replace").strip(), 0), self.delimiter), len(self.headers)
        known = [cells[i] for i in range(min(len(cells), width) - 1) if self.numeric[i]]
        if not all(_is_number(_split(cell)[0], self.decimal) or cell.lower() in MISSING for cell in known):
            return False
        at, cell = len(cells) - 1, cells[-1]
        if at >= width or not self.numeric[at]:
            return len(cells) < width
        begun, unit = _BEGUN.match(cell), self.cell_units[at]
        assert begun is not None  # it takes nothing, too
        if not unit.startswith(rest := cell[begun.end() :].strip()):
            return False
        ended = rest == unit and (_is_number(begun.group(), self.decimal) or not cell)
        return len(cells) < width or not ended or (cell != "" and _decimals(cell, self.decimal) < self.decimals[at])

    def refuse_thousands(self, rows: bytes) -> None:
        """See that a point in some later rows is that of decimals, where no line before has told what it is.

        Raises:
            DataError: if each of them may separate thousands.
        """
        found = _POINTED.findall(rows) if self.undecided and b"." in rows else []
        if found and all(_THOUSANDS.fullmatch(cell) for cell in found):
            raise DataError(
                f"{found[0].decode()!r} has decimals or separated thousands, and no other number tells; save numbers "
                "without separators of thousands"
            )

    def clean(self, rows: bytes) -> bytes:
        """Some rows with one ``delimiter`` between their fields, and numbers as computers write them."""
        if self.delimiter == " ":
            rows = re.sub(rb"[ \t]+", b" ", re.sub(rb"(?m)^[ \t]+|[ \t]+(?=\r?$)", b"", rows))
        words = _decode(rows)
        rows = (_BETWEEN.sub("", words) if self.grouped else words).encode()
        if self.grouped:
            sign = b"." if self.decimal == "," else b","
            if sign != self.delimiter.encode():
                rows = rows.replace(sign, b"")
            else:  # thousands stand between quotation marks then
                rows = _QUOTED.sub(lambda cell: cell.group().replace(sign, b""), rows)
        rows = _FORTRAN.sub(b"e", rows) if self.fortran else rows
        return rows.replace(_MINUS, b"-")


@dataclass(frozen=True)
class _Line:
    """A line of the file: its number from 1, its text without surrounding white space, and its offset [bytes]."""

    number: int
    words: str
    offset: int

    @property
    def remark(self) -> bool:
        return self.words.startswith(("#", "%")) and not self.words.lower().startswith(MISSING[-8:])


@dataclass(frozen=True)
class _Run:
    """Successive lines with as many fields each, and a number in each; one unit all along a column is taken out."""

    lines: tuple[_Line, ...]
    rows: tuple[tuple[str, ...], ...]
    units: tuple[str, ...]
    delimiter: str
    decimal: str

    def column(self, i: int) -> list[str]:
        return [row[i] for row in self.rows]

    @property
    def width(self) -> int:
        return len(self.rows[0])

    @property
    def worth(self) -> tuple[int, float, int]:
        """How well it explains the file: cells that are numbers, their share, and how few have separated thousands."""
        cells = [cell for row in self.rows for cell in row]
        numbers = sum(_is_number(cell, self.decimal) for cell in cells)
        known = numbers + sum(cell.lower() in MISSING for cell in cells)
        return numbers, known / len(cells), -sum(bool(_GROUPED[self.decimal].fullmatch(cell)) for cell in cells)

    def kinds(self) -> tuple[bool, ...]:
        return tuple(any(_is_number(cell, self.decimal) for cell in self.column(i)) for i in range(self.width))


def find_form(text: bytes) -> TableForm:
    """The form of a table from its first :data:`HEAD` lines.

    Raises:
        DataError: if it is no text, no row of numbers is among them, two forms are as good, or names do not fit.
    """
    if not text.strip():
        raise DataError("the file is empty")
    if b"\0" in text[:LONGEST_LINE]:
        raise DataError("not text; expected CSV, Parquet (.parquet) or npz (.npz)")
    lines = [line for line in _lines(text) if line.words and not _RULE.fullmatch(line.words)]
    if not lines:  # what Python counts as blanks and bytes do not
        raise DataError("the file is empty")
    found: list[_Run] = []
    for told in [lines] if text.endswith((b"\n", b"\r")) else [lines[:-1], lines]:  # the last line may end midway
        found = found or [run for sign in f"{_SIGNS} " for decimal in ".," if (run := _longest(told, sign, decimal))]
    if not found:
        last = one_line(lines[-1].words, 60)
        raise DataError(f"no rows of numbers in its first {lines[-1].number} lines (the last is {last!r})")
    best = _decide(max(found, key=lambda run: run.worth), found, lines)
    above = [line for line in lines if line.number < best.lines[0].number]
    _refuse_earlier_table(best, above)
    headers, units, numbers_rows = _name(best, above)
    numeric, texts, faults = _sort_columns(best, headers, numbers_rows)
    stamps = tuple(i for i in texts if are_times(best.column(i)))
    texts = tuple(i for i in texts if i not in stamps)
    first, cells = best.lines[0], [cell for row in best.rows for cell in row]
    grouped = any(_GROUPED[best.decimal].fullmatch(cell) for cell in cells)
    fortran = any(_FORTRAN.search(cell.encode()) for cell in cells if _is_number(cell, best.decimal))
    undecided = best.delimiter != "," and not any("." in cell or "," in cell for cell in cells)
    signs = best.delimiter, best.decimal, grouped, fortran, undecided
    decimals = tuple(min(_decimals(cell, best.decimal) for cell in best.column(i)) for i in range(best.width))
    return TableForm(
        headers, units, best.units, numeric, texts, stamps, faults, *signs, decimals, first.number, first.offset
    )  # fmt: skip


def _lines(text: bytes) -> list[_Line]:
    found: list[_Line] = []
    offset = 0
    for number, raw in enumerate(islice((line.group() for line in _LINE.finditer(text)), HEAD), 1):
        if len(raw) > LONGEST_LINE:
            raise DataError(f"line {number} has more than {LONGEST_LINE} characters; expected a table")
        words = _decode(raw)
        # a tab at either end is beside an empty cell
        found.append(_Line(number, words.strip(" \r\n\v\f") if words.strip() else "", offset))
        offset += len(raw)
    return found


def _decode(raw: bytes) -> str:
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError:  # what Western European spreadsheets wrote before
        return raw.decode("cp1252", errors="replace")


def _longest(lines: Sequence[_Line], delimiter: str, decimal: str) -> _Run | None:
    """The longest run of a form, the first of several."""
    if (delimiter, decimal) == (",", ","):
        return None
    best: list[tuple[_Line, tuple[str, ...]]] = []
    run: list[tuple[_Line, tuple[str, ...]]] = []
    for line in lines:
        row = () if line.remark or (delimiter not in line.words and delimiter != " ") else _fields(line, delimiter)
        if run and (len(row) != len(run[0][1]) or len(run) * len(row) > _CELLS):
            best, run = max(best, run, key=len), []
        if row and any(_is_number(_split(cell)[0], decimal) for cell in row):
            run.append((line, row))
        else:
            best, run = max(best, run, key=len), []
    best = max(best, run, key=len)
    if not best:
        return None
    while len(best) > 1 and best[0][1][0].endswith(("=", ":")):  # a key of several values, above the first row
        del best[0]
    columns, units = zip(*(_take_unit(cells) for cells in zip(*(row for _, row in best), strict=True)), strict=True)
    return _Run(tuple(line for line, _ in best), tuple(zip(*columns, strict=True)), units, delimiter, decimal)


def _take_unit(cells: tuple[str, ...]) -> tuple[tuple[str, ...], str]:
    """The cells of a column without the one unit that all its numbers have behind them, and this unit; else ""."""
    split = [_split(cell) for cell in cells]
    units = {unit for cell, (_, unit) in zip(cells, split, strict=True) if cell.lower() not in MISSING}
    return (tuple(number for number, _ in split), units.pop()) if len(units) == 1 and "" not in units else (cells, "")


def _split(cell: str) -> tuple[str, str]:
    """A number and the unit behind it; the cell as it is and "" where it has none."""
    found = _WITH_UNIT.fullmatch(cell)
    return (found["number"], found["unit"]) if found and is_unit(found["unit"]) else (cell, "")


def _decimals(cell: str, decimal: str) -> int:
    """Digits behind the decimal sign, those of a power of ten among them."""
    return sum(sign.isdigit() for sign in cell.partition(decimal)[2])


def _fields(line: _Line, delimiter: str) -> tuple[str, ...]:
    words = re.sub("[ \t]+", " ", line.words).strip() if delimiter == " " else line.words
    try:
        return tuple(field.strip() for field in next(csv.reader([words], delimiter=delimiter), []))
    except csv.Error as error:
        raise DataError(f"line {line.number} is not a row of a table ({error})") from error


def _is_number(cell: str, decimal: str) -> bool:
    return bool(_PLAIN[decimal].fullmatch(cell) or _GROUPED[decimal].fullmatch(cell))


def _decide(best: _Run, found: Sequence[_Run], lines: Sequence[_Line]) -> _Run:
    """Which of two forms it is that are as good: by a column, or by the names above.

    Raises:
        DataError: if neither tells.
    """
    cells = one_line(" ".join(best.rows[0]), 40)
    other = "," if best.decimal == "." else "."
    tells = any(
        best.decimal in cell and _is_number(cell, best.decimal) and not _GROUPED[other].fullmatch(cell)
        for row in best.rows
        for cell in row
    )
    for i in range(best.width) if best.delimiter != "," and not tells else ():
        # numbers with three digits behind a sign, and shorter ones without: 4.720 and 987
        column = best.column(i)
        long = [cell for cell in column if best.decimal in cell and _GROUPED[other].fullmatch(cell)]
        if long and len(long) < len(column) and all(cell in long or _SMALL.fullmatch(cell) for cell in column):
            raise DataError(
                f"{long[0]!r} has decimals or separated thousands, and no other column tells; save numbers without "
                "separators of thousands"
            )
    if best.delimiter != "," or best.width % 2 or any(not cell.lstrip("-+").isdecimal() for cell in best.rows[0]):
        return best
    names = next((line for line in reversed(lines) if line.number < best.lines[0].number), None)
    count = 0 if names is None else len(_fields(names, ","))
    whole = all(cell.isdecimal() for i in range(1, best.width, 2) for cell in best.column(i))
    even = {len(cell) for i in range(1, best.width, 2) for cell in best.column(i)}
    if count == best.width or not whole:
        return best
    single = next((run for run in found if run.width == 1 and run.decimal == ","), None)
    if best.width == 2 and single is not None and count == 1:
        return single
    if count == best.width // 2 or (len(even) == 1 and even != {1}):
        raise DataError(
            f"{cells!r}: commas separate columns, or whole numbers from decimals; separate columns by semicolons, or "
            "write a name above each"
        )
    return best


def _refuse_earlier_table(run: _Run, above: Sequence[_Line]) -> None:
    """Rows before the table that look like its own belong to another, or are lost by a line between them; one is a key.

    Raises:
        DataError: if there are several.
    """
    kinds, alike = run.kinds(), []
    for line in above:
        row = _fields(line, run.delimiter) if run.delimiter in line.words or run.delimiter == " " else ()
        if len(row) == run.width > 1 and tuple(_is_number(cell, run.decimal) for cell in row) == kinds:
            alike.append(line.number)
    if len(alike) > 1:
        raise DataError(
            f"lines {alike[0]} to {alike[-1]} are rows, and a table begins in line {run.lines[0].number}; save one"
        )


def _name(run: _Run, above: Sequence[_Line]) -> tuple[tuple[str, ...], tuple[str, ...], bool]:
    """Names and units of the columns from the lines above them, and whether the first column numbers the rows.

    Raises:
        DataError: if there is a row of names that does not fit.
    """
    nothing = ("",) * run.width
    if not above:
        return nothing, nothing, False
    keyed = {cells[0]: cells[1:] for line in above if (cells := _fields(line, run.delimiter))}
    if 3 * len(markers := keyed.get("MARKER_NAMES", ())) == run.width:  # Qualisys
        return tuple(f"{name}.{axis}" for name in markers for axis in "xyz"), nothing, False
    if (titles := keyed.get("ChannelTitle=")) and 1 + len(titles) == run.width:  # LabChart, whose times have no title
        return ("time", *titles), ("", *keyed.get("UnitName=", nothing))[: run.width], False
    names, units = _split_names(above[-1], run), nothing
    if len(above) > 1 and len(names) <= run.width and any(names) and all(is_unit(name) for name in names):
        higher = _split_names(above[-2], run)
        if len(higher) >= len(names) and not any(_is_number(name, run.decimal) for name in higher):
            names, units = higher, tuple(name.strip("[]() ") for name in (*names, *nothing))[: run.width]
    if any(_is_number(name, run.decimal) for name in names):
        return nothing, nothing, False
    if len(names) > run.width and not any(names[run.width :]):
        names = names[: run.width]
    counts = _counts_rows(run.column(0))
    if len(names) == run.width - 1 and not any(run.kinds()[-1:]) and all(c.lower() in MISSING for c in run.column(-1)):
        names = (*names, "")
    elif len(names) == run.width - 1 and len(names) > 0 and counts:
        return ("", *names), ("", *units)[: run.width] if any(units) else nothing, True
    elif len(names) == run.width + 1 and names[-1] == "Comment":  # LabVIEW: where there is none, its column neither
        names = names[:-1]
    if len(names) == run.width:
        whole = _tell_apart(names, above[:-1] if any(units) else above, run)
        return whole, units, counts and any(names) and not names[0]
    # a single word, or a sentence between blanks, is a title
    if len(names) > 1 and run.delimiter != " ":
        raise DataError(
            f"line {above[-1].number} has {len(names)} names, the rows below it have {run.width} columns; name each"
        )
    return nothing, nothing, False


def _tell_apart(names: tuple[str, ...], above: Sequence[_Line], run: _Run) -> tuple[str, ...]:
    """Names that stand several times, with what stands right above them as far as it tells them apart: ``C7.X``.

    Marker systems write the name of a marker over its first column or over each, and so do tables of several levels.

    Args:
        above: the lines down to that of the names.
    """
    layers: list[list[str]] = []
    for lower, upper in pairwise(reversed(above)):
        cells = _fields(upper, run.delimiter) if upper.number == lower.number - 1 else ()
        if not 1 < len(cells) <= run.width:
            break
        if any(_is_number(cell, run.decimal) for cell in cells):
            continue
        layers.append([])
        for cell in (*cells, *[""] * (run.width - len(cells))):
            layers[-1].append(cell or "".join(layers[-1][-1:]))  # that over the column before
    ways: list[tuple[str, ...]] = [(name,) for name in names]
    for layer in reversed(layers):
        longer = [(*way[:-1], cell, way[-1]) for way, cell in zip(ways, layer, strict=True)]
        ways = longer if len(set(longer)) > len(set(ways)) else ways
    return tuple(".".join(way) if names.count(way[-1]) > 1 and way[-1] else way[-1] for way in ways)


def _split_names(line: _Line, run: _Run) -> tuple[str, ...]:
    words = line.words.lstrip("#% ") if line.remark else line.words
    plain = _Line(line.number, words, line.offset)
    for delimiter in (run.delimiter, *_SIGNS):
        if delimiter in words and len(fields := _fields(plain, delimiter)) == run.width:
            return fields
    if run.delimiter == " ":
        joined = tuple(" ".join(part.split()) for part in _SPLIT.findall(words))
        if '"' in words:  # as of R, which leaves out the name of the numbers of rows
            joined = _fields(plain, " ")
        fits = len(joined) == run.width or (len(joined) == run.width - 1 and _counts_rows(run.column(0)))
        return joined if fits else tuple(re.split(r"\s{2,}|\t", words))
    blanks = tuple(words.split()) if not set(words) & set(_SIGNS) else ()
    return blanks if len(blanks) == run.width else _fields(plain, run.delimiter)


def _counts_rows(cells: Sequence[str]) -> bool:
    """Whether they are 0, 1, 2, …, from whichever number on, as of rows that are a part of others."""
    numbers = [int(cell) if cell.isdecimal() and len(cell) < 10 else -1 for cell in cells]
    return len(cells) > 1 and numbers[0] >= 0 and numbers == list(range(numbers[0], numbers[0] + len(cells)))


def _sort_columns(
    run: _Run, headers: Sequence[str], numbers_rows: bool
) -> tuple[tuple[bool, ...], tuple[int, ...], dict[int, str]]:
    """Which columns hold numbers, which hold text, and what is no number in those that are to hold numbers."""
    numeric, texts, faults = [], [], {}
    # without names, a column of nothing but missing numbers is one, but for what a separator at each end makes
    named = [bool(header) if any(headers) else i < run.width - 1 for i, header in enumerate(headers)]
    for i in range(run.width):
        cells = run.column(i)
        numbers = sum(_is_number(cell, run.decimal) for cell in cells)
        odd = [cell for cell in cells if not _is_number(cell, run.decimal) and cell.lower() not in MISSING]
        numeric.append(bool(numbers or (named[i] and not odd)) and not (numbers_rows and i == 0))
        if odd and not numbers:
            texts.append(i)
        if odd and (numbers or all(_WITH_WORDS.fullmatch(cell) for cell in odd)):
            faults[i] = one_line(odd[0], 40)
    return tuple(numeric), tuple(texts), faults


def list_missing_words() -> list[str]:
    """What stands for a missing number, in each way of writing it."""
    return sorted({way for word in (*MISSING, "NaN", "-NaN") for way in (word, word.upper(), word.title())})
