"""Names that are nearly right: the one that was probably meant, among those that are known."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches

LONGEST = 80  # characters of what was given that are looked at


def find_nearest(given: str, known: Iterable[str]) -> str | None:
    """The most similar name among ``known`` to ``given``; ``None`` if none is similar.

    Capitals and separators do not count, because names are often written with others, or without them.
    """
    names = list(known)
    by_lower = {name.lower(): name for name in names}
    bare = {_bare(name): name for name in names}
    plain = given[:LONGEST].lower()
    if _bare(plain) in bare:
        return bare[_bare(plain)]
    found = get_close_matches(plain, list(by_lower), 1, 0.6)
    return by_lower[found[0]] if found else None


def suggest(given: str, known: Iterable[str]) -> str:
    """``; did you mean gain?``, or nothing if no name is near."""
    near = find_nearest(given, known)
    return f"; did you mean {near}?" if near is not None else ""


def _bare(name: str) -> str:
    return name.lower().replace("_", "").replace("-", "")
