"""The unit that several quantities on one axis have in common."""

from __future__ import annotations

from collections.abc import Iterable


def shared_unit(units: Iterable[str], per: str = "") -> str:
    """`` [rad]``, or `` [rad/s]`` for ``per`` "/s", of quantities that all have it; nothing where they differ."""
    found = set(units)
    unit = found.pop() if len(found) == 1 else ""
    return f" [{unit}{per}]" if unit else ""
