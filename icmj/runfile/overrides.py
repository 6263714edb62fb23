"""Values of a run file changed from outside: ``controller.q_t=0.02``, its key dotted, its value as TOML writes it."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterable

from icmj.base.text import one_line
from icmj.errors import RunFileError
from icmj.runfile.schema import RunFile

_WORD = re.compile(r"[A-Za-z][\w .-]*")


def overridden(run: RunFile, changes: Iterable[str]) -> RunFile:
    """The run file with values changed as ``KEY=VALUE`` says, all at once; the same one if there are none.

    A value is TOML; a plain word that is none, such as zero-order, is text, for the quotes that a shell takes away;
    ``KEY=`` takes the key out, so that its default holds.

    Raises:
        RunFileError: if a change is not written so, a key is unknown, or a value not allowed.
    """
    changes = tuple(changes)
    if not changes:
        return run
    try:
        return run.with_(**dict(_read(change) for change in changes))
    except RunFileError as error:
        given = one_line(" ".join(f"--set {change}" for change in changes), 200)
        raise RunFileError(f"{given}: {error}") from error


def _read(change: str) -> tuple[str, object]:
    key, equals, value = change.partition("=")
    if not equals or not key.strip():
        raise RunFileError("expected KEY=VALUE, such as actual.gain=0.85")
    return key.strip(), _value(value.strip()) if value.strip() else None


def _value(text: str) -> object:
    try:
        data = tomllib.loads(f"value = {text}")
    except (ValueError, RecursionError) as error:
        if _WORD.fullmatch(text):
            return text
        raise RunFileError(f"{one_line(text, 60)} is not a value as TOML writes it") from error
    if len(data) > 1:
        raise RunFileError(f"{one_line(text, 60)} is more than one value")
    return data["value"]
