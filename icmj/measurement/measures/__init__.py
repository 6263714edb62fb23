"""The shelf of measures of sway: each in a file of its own, and their list.

To add one, write a file here and enter its name below. The file defines ``MEASURE``, which
:func:`icmj.measurement.measure.define_measure` makes of a function of a :class:`icmj.measurement.measure.Signal`: it
says key, words, unit, definition and source, and the options are the function's parameters. One that is not standard is
computed where its name is asked for. Tables, records, experiments, the options of the command and the documentation
take all from this list.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import cache
from typing import Any

from icmj.base.catalogue import Catalogue
from icmj.base.similar_names import suggest
from icmj.base.text import one_line
from icmj.errors import DataError, RunFileError
from icmj.measurement.measure import Measure, Number, Of, Option
from icmj.work.own_code import Code

MEASURES = Catalogue(
    __name__,
    (
        "mean_value",
        "root_mean_square",
        "mean_distance",
        "peak_to_peak",
        "prediction_range",
        "mean_speed",
        "rotation_frequency",
        "prediction_ellipse",
        "power_distribution",
        "stabilogram",
    ),
)
"""The measures, by the names of their files, in the order of tables."""


@cache
def standard_measures() -> tuple[Measure, ...]:
    """Those that are computed where nobody asks for others."""
    return tuple(one for one in MEASURES.collect("MEASURE") if one.standard)


def list_options() -> Mapping[str, Option]:
    """The options of all measures, by name."""
    return {name: option for one in MEASURES.collect("MEASURE") for name, option in one.options.items()}


def numbers_of(of: Of = "coordinate", further: Iterable[Measure] = ()) -> tuple[Number, ...]:
    """The numbers that the standard measures and ``further`` ones have of a coordinate, or of a plane."""
    every = dict.fromkeys((*standard_measures(), *further))
    return tuple(number for one in every if of in one.of for number in one.numbers)


def tabulate_definitions() -> list[str]:
    """The lines of a table, in Markdown, of what all measures are."""
    rows = [one for measure in MEASURES.collect("MEASURE") for one in measure.definitions]
    head = ["| measure | definition | source |", "| --- | --- | --- |"]
    return [*head, *(f"| {one.title} | {one.text} | {one.source} |" for one in rows)]


def find_measure(name: str, code: Code | None = None) -> Measure:
    """The measure of this name in the list, or of the user's own (``module:name``).

    Raises:
        DataError: if there is none.
        RunFileError: if its code may not be run or fails, or it is none.
    """
    if code is not None and ":" in name:
        found = code.find(name)
        if not isinstance(found, Measure):
            raise RunFileError(f"{name}: expected a measure, which icmj.measurement.define_measure makes of a function")
        return found
    if name not in (known := MEASURES.names):
        hint = suggest(name, known) or f"; there are {', '.join(known)}"
        raise DataError(f"no measure {one_line(name, 80)!r}{hint}")
    measure: Measure = MEASURES[name].MEASURE
    return measure


def choose_measures(further: Iterable[Measure | str], options: Mapping[str, Any]) -> tuple[Measure, ...]:
    """The standard measures and further ones, each with those of the options that are its own.

    Raises:
        DataError: if a measure or an option is unknown, or two measures have one name.
    """
    found = list(standard_measures())
    for each in further:
        one = find_measure(each) if isinstance(each, str) else each
        if not isinstance(one, Measure):
            raise DataError(f"{one!r}: expected a measure, or the name of one")
        if one not in found:
            found.append(one)
    for what in ("name", "key", "words"):
        names = [getattr(x, what) for one in found for x in ([one] if what == "name" else one.numbers)]
        if twice := [name for i, name in enumerate(names) if name in names[:i]]:
            raise DataError(f"two measures have the {what} {twice[0]!r}; call one otherwise")
    for name in options:
        if not any(name in one.options for one in found):
            known = [each for one in found for each in one.options]
            raise DataError(f"no measure has an option {name!r}{suggest(name, known)}")
    own = ({name: value for name, value in options.items() if name in one.options} for one in found)
    return tuple(one.with_options(**some) if some else one for one, some in zip(found, own, strict=True))
