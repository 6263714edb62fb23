"""Whether data read from a log are of the types that their dataclasses declare."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from functools import lru_cache
from types import NoneType, UnionType
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

import numpy as np

from icmj.base.text import one_line
from icmj.errors import LogError
from icmj.runfile.schema import RunFile

_ARRAYS = {float: "fiu", complex: "cfiu"}


def conform(value: Any, where: str = "result") -> None:
    """Check every field of a dataclass, and of those within it, against its declared type.

    Raises:
        LogError: at the first that is not what it should be, by its dotted place.
    """
    cls: Any = type(value)
    for name, hint in _hints(cls).items():
        _check(getattr(value, name), hint, f"{where}.{name}".removeprefix("result."))


@lru_cache(maxsize=100)
def _hints(cls: Any) -> dict[str, Any]:
    hints = get_type_hints(cls)
    return {field.name: hints[field.name] for field in fields(cls)}


def _check(value: Any, hint: Any, where: str) -> None:
    if not _is(value, hint, where):
        raise LogError(f"{where} is {one_line(repr(value), 60)}; expected {_words(hint)}")


def _plain(hint: Any) -> Any:
    """The type behind an annotation that may be an alias, as ``NDArray[...]`` is from numpy 2.5 on."""
    while (aliased := getattr(get_origin(hint) or hint, "__value__", None)) is not None:
        hint = aliased[arguments] if (arguments := get_args(hint)) else aliased
    return hint


def _is(value: Any, hint: Any, where: str) -> bool:
    hint = _plain(hint)
    origin, arguments = get_origin(hint), get_args(hint)
    if origin in (Union, UnionType):
        return any(_is(value, member, where) for member in arguments)
    if origin is Literal:
        return any(type(value) is type(choice) and value == choice for choice in arguments)
    if origin is np.ndarray or hint is np.ndarray:
        return isinstance(value, np.ndarray) and value.dtype.kind in _kinds(arguments)
    if origin is tuple:
        items = enumerate(value) if isinstance(value, tuple) else ()
        return isinstance(value, tuple) and all(_each(item, arguments[0], f"{where}.{i}") for i, item in items)
    if origin in (Mapping, dict):
        return isinstance(value, dict) and all(
            isinstance(key, str) and _each(item, arguments[1], f"{where}.{key}") for key, item in value.items()
        )
    if hint in (float, complex, int):
        numbers = {float: (int, float), complex: (int, float, complex), int: (int,)}[hint]
        small = not isinstance(value, int) or abs(value) < 2**63
        return isinstance(value, numbers) and not isinstance(value, bool) and small
    if not isinstance(hint, type):
        return True
    if not isinstance(value, hint):
        return False
    if is_dataclass(value) and not isinstance(value, RunFile | NoneType):
        conform(value, where)
    return True


def _each(value: Any, hint: Any, where: str) -> bool:
    _check(value, hint, where)
    return True


def _kinds(arguments: tuple[Any, ...]) -> str:
    """Kinds of dtype that an annotation ``NDArray[...]`` stands for; floats may be stored as integers."""
    scalar = get_args(arguments[1])[0] if len(arguments) == 2 and get_args(arguments[1]) else None
    if scalar is None or not isinstance(scalar, type):
        return "fciub"
    return _ARRAYS[complex] if issubclass(scalar, np.complexfloating) else _ARRAYS[float]


def _words(hint: Any) -> str:
    hint = _plain(hint)
    if get_origin(hint) in (Union, UnionType):
        return " or ".join(_words(member) for member in get_args(hint))
    if get_origin(hint) is Literal:
        return " or ".join(repr(choice) for choice in get_args(hint))
    if get_origin(hint) is np.ndarray:
        return "an array"
    names = {float: "a number", int: "a whole number", str: "text", bool: "true or false", NoneType: "nothing"}
    return names.get(hint, getattr(hint, "__name__", str(hint)))
