"""Plain data of a run file: values put where dotted keys lead, ``simulation.disturbance[0].size``; its TOML text."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from copy import deepcopy
from typing import Any

import numpy as np

from icmj.base.text import one_line
from icmj.errors import RunFileError

Place = tuple[str | int, ...]

_PART = re.compile(r"""(?:"([^"]*)"|'([^']*)'|([^."'\[\]]+))((?:\[\d{1,6}\])*)(\.|$)""")


def place_of(key: str) -> Place:
    """Tables, lists and the key that ``simulation.disturbance[0].size`` leads through; quotes hold dots together.

    Raises:
        RunFileError: if it is not a dotted key.
    """
    parts: list[str | int] = []
    at, end = 0, "."
    while end == ".":
        found = _PART.match(key, at)
        if found is None:
            raise RunFileError(f"{one_line(key, 80)!r} is no key; expected one such as actual.gain")
        *names, indices, end = found.groups()
        parts.append(next(name for name in names if name is not None).strip())
        parts += [int(index) for index in re.findall(r"\d+", indices)]
        at = found.end()
    return tuple(parts)


def put(data: dict[str, Any], key: str, value: object) -> None:
    """Put a value at its place into plain data, and tables where there are none on the way; ``None`` takes it out.

    Raises:
        RunFileError: if something on the way is no table, or a list has no such entry.
    """
    *way, last = place_of(key)
    inside: Any = data
    said = "the run file"
    for part in way:
        _check(key, said, inside, part)
        inside = inside[part] if isinstance(part, int) else inside.setdefault(part, {})
        said = f"{said}[{part}]" if isinstance(part, int) else part
    _check(key, said, inside, last)
    if value is None and isinstance(inside, dict):
        inside.pop(last, None)
    else:
        inside[last] = value


def plain(value: object) -> Any:
    """A copy in the types of TOML: of NumPy's numbers and arrays, and of tuples."""
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, Mapping):
        return {key: plain(each) for key, each in value.items()}
    return [plain(each) for each in value] if isinstance(value, list | tuple) else deepcopy(value)


def _check(key: str, said: str, inside: object, part: str | int) -> None:
    if isinstance(part, int) and not (isinstance(inside, list) and part < len(inside)):
        raise RunFileError(f"{key}: {said} has no entry [{part}]")
    if isinstance(part, str) and not isinstance(inside, dict):
        raise RunFileError(f"{key}: {said} is no table")


def to_toml(data: Mapping[str, Any]) -> str:
    """``data`` as TOML: tables of numbers, texts, lists and tables; what is ``None`` is left out."""
    return "\n".join(_table(data, ())).strip() + "\n"


def _table(data: Mapping[str, Any], at: tuple[str, ...]) -> Iterator[str]:
    below = {}
    for key, value in data.items():
        if isinstance(value, Mapping) or (isinstance(value, list) and value and isinstance(value[0], Mapping)):
            below[key] = value
        elif value is not None:
            yield f"{key_text(key)} = {value_text(value)}"
    for key, value in below.items():
        name = ".".join(map(key_text, (*at, key)))
        for entry in value if isinstance(value, list) else [value]:
            yield f"\n[[{name}]]" if isinstance(value, list) else f"\n[{name}]"
            yield from _table(entry, (*at, key))


def key_text(key: str) -> str:
    """A key as TOML writes it."""
    return key if key.replace("_", "").replace("-", "").isalnum() and key.isascii() else value_text(key)


def value_text(value: Any) -> str:
    """A value as TOML writes it, on one line."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        # JSON's escapes are TOML's, but for one that TOML wants and JSON does not
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(value_text, value))}]"
    return repr(value)
