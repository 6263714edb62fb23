"""Plain data as TOML text, for run files that were changed in code."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from typing import Any


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
