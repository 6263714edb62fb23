"""Dotted keys of a run file, and values put where they lead: ``simulation.disturbance[0].size``."""

from __future__ import annotations

import re
from typing import Any

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


def _check(key: str, said: str, inside: object, part: str | int) -> None:
    if isinstance(part, int) and not (isinstance(inside, list) and part < len(inside)):
        raise RunFileError(f"{key}: {said} has no entry [{part}]")
    if isinstance(part, str) and not isinstance(inside, dict):
        raise RunFileError(f"{key}: {said} is no table")
