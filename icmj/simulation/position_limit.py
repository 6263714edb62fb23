"""How far positions may depart before a run counts as a fall: one number, one by name, or what fits their units."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from icmj.base.array import Array, Positive
from icmj.errors import SimulationError

Limit = Positive | Mapping[str, Positive] | None
"""How far positions may depart: one number for all, or by name, or what fits their units."""
UNITS: Mapping[str, float] = {
    "rad": 1.0, "mrad": 1e3, "deg": 180 / np.pi, "°": 180 / np.pi, "rev": 0.5 / np.pi,
    "m": 1.0, "cm": 1e2, "mm": 1e3, "um": 1e6, "µm": 1e6, "km": 1e-3, "in": 1 / 0.0254, "ft": 1 / 0.3048,
}  # fmt: skip
"""One radian, or one metre, in units of angle and length."""


def get_limits(limit: Limit, positions: Sequence[str], units: Sequence[str]) -> Array:
    """The deviation that each position may have [its own unit]; infinite if there is no limit.

    Args:
        limit: one number is of all [rad or m], and stands for as much in another unit of angle or length; of any other
            unit, or none, it is the number itself. By name it is in the position's own unit, and the others have 1 rad
            or 1 m, as all have for ``None``: what is neither an angle nor a length has no limit then.
        positions: names, P of them.
        units: of each; "" where it is not known.

    Returns:
        shape (P,).

    Raises:
        SimulationError: if a name is none of the positions.
    """
    sizes = [UNITS.get(unit, np.inf) for unit in units]
    if isinstance(limit, Mapping):
        for name in limit:
            if name not in positions:
                raise SimulationError(
                    f"limit: no position {name!r} in the plant; expected one of {', '.join(positions)}"
                )
        sizes = [limit.get(name, size) for name, size in zip(positions, sizes, strict=True)]
    elif limit is not None:
        sizes = [limit * (size if np.isfinite(size) else 1.0) for size in sizes]
    return np.array(sizes, dtype=float)
