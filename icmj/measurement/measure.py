"""What a measure of sway is: a function of a signal that gives a number, or several that are computed together.

The frame (:mod:`icmj.measurement.sway`) prepares the signals, and takes names, units and options from the measures.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from importlib import import_module
from inspect import Parameter, isfunction, signature
from pathlib import Path
from typing import Annotated, Any, Literal, SupportsIndex, get_args, get_origin, get_type_hints

import numpy as np
from annotated_types import Ge, Le

from icmj.base.array import Array
from icmj.base.docstrings import read_meanings
from icmj.base.similar_names import suggest
from icmj.base.text import one_line
from icmj.errors import DataError
from icmj.work.own_code import Code, folder_of, guard, reference_of

Of = Literal["coordinate", "plane"]
KEY = re.compile(r"[A-Za-z]\w*(\.[A-Za-z]\w*)*")


@dataclass(frozen=True, eq=False)
class Signal:
    """What a measure is of: a coordinate, or two of one unit, which are the place of a point in a plane.

    Attributes:
        values: evenly sampled, shape (N,) of a coordinate, (N, 2) of a plane.
        step: time between samples [s].
        frequency: lines of the spectrum [Hz], shape (F,).
        power: its density, of a plane the sum of both, shape (F,).
    """

    values: Array
    step: float
    frequency: Array
    power: Array

    @property
    def planar(self) -> bool:
        """Whether it is a plane."""
        return self.values.ndim > 1

    @property
    def duration(self) -> float:
        """N times the step [s]."""
        return len(self.values) * self.step

    @cached_property
    def mean(self) -> Array:
        """Mean value, shape () or (2,)."""
        return np.asarray(self.values[0] + self._from_first.mean(axis=0))

    @cached_property
    def about(self) -> Array:
        """Values relative to their mean, shape of the values."""
        return self._from_first - self._from_first.mean(axis=0)

    @cached_property
    def distance(self) -> Array:
        """Distance from the mean, shape (N,)."""
        return np.hypot(*self.about.T) if self.planar else np.abs(self.about)

    @cached_property
    def path(self) -> float:
        """Length of the path."""
        if self.planar:
            return float(np.hypot(*np.diff(self.about, axis=0).T).sum())
        return float(np.abs(np.diff(self.values)).sum())

    @cached_property
    def _from_first(self) -> Array:
        return self.values - self.values[0]  # mean and what is about it are exact where nothing moves


@dataclass(frozen=True)
class Number:
    """One number of a measure.

    Attributes:
        key: its name in tables of runs, such as ``frequency.median``.
        words: what it is called.
        unit: its unit, with ``U`` for that of the coordinate.
        of: attribute of the value that has it, by its way from there, such as ``axes.0``; "" of a value that is it.
    """

    key: str
    words: str
    unit: str = ""
    of: str = ""

    def read(self, value: Any) -> float:
        """The number in a value; NaN if the record was too short for it."""
        for name in filter(None, self.of.split(".")):
            value = value[int(name)] if name.isdecimal() else getattr(value, name)
            if value is None:
                return float("nan")
        return float(value)

    def unit_of(self, unit: str) -> str:
        """Its unit where that of the coordinate is ``unit``."""
        return self.unit.replace("U", unit)


@dataclass(frozen=True)
class Definition:
    """A row of the table of definitions (docs/measures.md), in Markdown.

    Attributes:
        title: what is defined.
        text: how.
        source: by whom.
    """

    title: str
    text: str
    source: str = ""


@dataclass(frozen=True)
class Option:
    """An option of a measure.

    Attributes:
        name: its name.
        hint: type, with bounds as notes.
        default: value where none is given.
        meaning: what it is, in one sentence.
    """

    name: str
    hint: Any
    default: Any
    meaning: str

    @property
    def kind(self) -> Any:
        """The type, without bounds."""
        if get_origin(self.hint) is tuple:
            return tuple[tuple(replace(self, hint=hint).kind for hint in get_args(self.hint))]  # type: ignore[misc]
        return get_args(self.hint)[0] if get_origin(self.hint) is Annotated else self.hint

    def check(self, value: Any) -> Any:
        """The value, if it is of the type and within the bounds.

        Raises:
            DataError: if it is not.
        """
        if get_origin(self.hint) is tuple:
            each = get_args(self.hint)
            if not isinstance(value, Sequence) or isinstance(value, str) or len(value) != len(each):
                raise DataError(f"{self.name}: expected {len(each)} values, got {one_line(repr(value), 80)}")
            return tuple(replace(self, hint=hint).check(one) for hint, one in zip(each, value, strict=True))
        kind, notes = self.kind, getattr(self.hint, "__metadata__", ())
        number = kind in (int, float)
        if not isinstance(value, int | float if kind is float else kind) or (number and isinstance(value, bool)):
            raise DataError(f"{self.name}: expected {kind.__name__}, got {one_line(repr(value), 80)}")
        for note in notes:
            if (isinstance(note, Ge) and not value >= note.ge) or (isinstance(note, Le) and not value <= note.le):  # type: ignore[operator]
                bound = f"at least {note.ge}" if isinstance(note, Ge) else f"at most {note.le}"
                raise DataError(f"{self.name}: {value}; expected {bound}")
        return value


@dataclass(frozen=True, eq=False)
class Measure:
    """A measure of sway; made by :func:`icmj.measurement.define_measure`.

    Attributes:
        name: attribute of the measured coordinate or plane that has its value.
        compute: the function, of a signal and of the options.
        numbers: the numbers in what it returns.
        of: whether it is of coordinates, of planes, or of both.
        standard: whether it is computed where nobody asks for it.
        definitions: what the documentation says of it.
        settings: values of its options that are not the defaults.
    """

    name: str
    compute: Callable[..., Any]
    numbers: tuple[Number, ...]
    of: tuple[Of, ...] = ("coordinate", "plane")
    standard: bool = False
    definitions: tuple[Definition, ...] = ()
    settings: Mapping[str, Any] = field(default_factory=dict)

    @cached_property
    def options(self) -> Mapping[str, Option]:
        """The parameters of its function that are given by name."""
        hints, meanings = get_type_hints(self.compute, include_extras=True), read_meanings(self.compute)
        given = [each for each in signature(self.compute).parameters.values() if each.kind is Parameter.KEYWORD_ONLY]
        return {
            each.name: Option(each.name, hints[each.name], each.default, meanings.get(each.name, "")) for each in given
        }

    def with_options(self, **options: Any) -> Measure:
        """The measure with these values of its options.

        Raises:
            DataError: if it has no such option, or a value is not allowed.
        """
        for name in options:
            if name not in self.options:
                raise DataError(f"{self.name} has no option {name!r}{suggest(name, self.options)}")
        return replace(self, settings={**self.settings, **{k: self.options[k].check(v) for k, v in options.items()}})

    def measure(self, signal: Signal) -> Any:
        """Its value for a signal.

        Raises:
            DataError: if the signal cannot be measured.
            RunFileError: if it is of the user's own and fails.
        """
        if self.compute.__module__.startswith("icmj."):
            return self.compute(signal, **self.settings)
        with guard(reference_of(self.compute)):
            value = self.compute(signal, **self.settings)
            for number in self.numbers:
                number.read(value)
            return value

    def __reduce_ex__(self, protocol: SupportsIndex) -> Any:
        if self.compute.__module__ == "__main__":  # which another process does not have; cloudpickle takes it along
            return super().__reduce_ex__(protocol)
        # its function has the name of this object, and in another process a module from a folder has another name
        home = folder_of(self.compute)
        return _find_again, (home, reference_of(self.compute), dict(self.settings))


def define_measure(
    name: str,
    words: str = "",
    unit: str = "",
    *,
    numbers: Sequence[Number] = (),
    of: Sequence[Of] = ("coordinate", "plane"),
    standard: bool = False,
    definitions: Sequence[Definition] = (),
) -> Callable[[Callable[..., Any]], Measure]:
    """Decorator: makes a measure of sway of a function.

    Its first parameter is the :class:`icmj.measurement.Signal`; parameters that are given by name are options, with
    type, bounds and default, and described under ``Args`` of its docstring. It returns a number, or an object that has
    the ``numbers``.

    Args:
        name: attribute of the measured coordinate or plane that has what the function returns, and the key of its
            number, if it is one.
        words: what the number is called, such as "mean speed".
        unit: unit of the number, with ``U`` for that of the coordinate: "U/s".
        numbers: of a function that returns an object, the numbers in it.
        of: whether it is a measure of coordinates, of planes, or of both.
        standard: whether it is computed where nobody asks for it; a measure that takes long is asked for.
        definitions: rows of the documentation.

    Raises:
        DataError: if a name, a number or the function is malformed.
    """
    every = tuple(numbers) or (Number(name, words, unit),)
    if not name.isidentifier() or name.startswith("_"):
        raise DataError(f"a measure called {one_line(repr(name), 80)}; expected a name such as 'mean_speed'")
    for number in every:
        if not KEY.fullmatch(number.key) or not number.words.strip():
            raise DataError(f"measure {name}: its number needs a key such as 'frequency.mean', and words")
    if not of or not set(of) <= {"coordinate", "plane"}:
        raise DataError(f"measure {name}: of {one_line(repr(of), 80)}; expected some of 'coordinate', 'plane'")

    def decorate(compute: Callable[..., Any]) -> Measure:
        if not isfunction(compute):
            raise DataError(f"measure {name}: expected a function of a signal, got {one_line(repr(compute), 80)}")
        parameters = [*signature(compute).parameters.values()]
        if not parameters or parameters[0].kind not in (Parameter.POSITIONAL_ONLY, Parameter.POSITIONAL_OR_KEYWORD):
            raise DataError(f"measure {name}: its function takes the signal first")
        for each in parameters[1:]:
            if each.kind is not Parameter.KEYWORD_ONLY or Parameter.empty in (each.default, each.annotation):
                raise DataError(
                    f"measure {name}: {each.name} must be an option: after *, with a type and a default value"
                )
        return Measure(name, compute, every, tuple(of), standard, tuple(definitions))

    return decorate


def _find_again(folder: Path | None, reference: str, settings: Mapping[str, Any]) -> Measure:
    if folder is not None:
        found = Code(folder, allowed=True).find(reference)
    else:
        module, _, name = reference.partition(":")
        found = getattr(import_module(module), name)
    assert isinstance(found, Measure)
    return found.with_options(**settings)
