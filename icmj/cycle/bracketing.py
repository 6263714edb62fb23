"""The point of a branch at which a function is zero, between two points where it has different signs (Brent 1973)."""

from __future__ import annotations

from collections.abc import Callable

from icmj.cycle.point import Point


def locate(
    left: Point, right: Point, f: Callable[[Point], float], between: Callable[[float], Point | None], close: float
) -> Point | None:
    """The point where f is zero, between two of different sign, by Brent's method.

    Args:
        left, right: points at the parts 0 and 1 of the way.
        f: the test function.
        between: the point at a part of the way; ``None`` if there is none.
        close: distance in the parameter that is near enough.

    Returns:
        the point, or ``None`` where the curve cannot be reached in between.
    """
    from scipy.optimize import brentq

    known = {0.0: left, 1.0: right}

    def at(part: float) -> float:
        if part not in known:
            found = between(part)
            if found is None:
                raise _Unreached
            known[part] = found
        return f(known[part])

    gap = max(abs(right.value - left.value), 1e-300)
    try:
        root = float(brentq(at, 0.0, 1.0, xtol=min(max(0.2 * close / gap, 1e-10), 1e-2), rtol=1e-14))
        at(root)
    except _Unreached:
        return None
    return known[root]


class _Unreached(Exception):
    pass
