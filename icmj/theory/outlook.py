"""A quick look beyond the interval searched: does a crossing come later, or does the largest |λ| at least grow?

Not a search: eigenvalues are counted on a coarse grid, and only a step over which the number outside the circle changes
is searched.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from icmj.errors import AnalysisError
from icmj.theory.crossing import Crossing
from icmj.theory.crossings import DROWNED, search
from icmj.theory.error_system import ErrorSystem
from icmj.theory.reduction import Reduction

REACH = 4
"""How far the look goes, in intervals searched."""

_POINTS = 64


@dataclass(frozen=True)
class Outlook:
    """Crossings beyond the interval searched.

    Attributes:
        crossing: the first found up to :data:`REACH` times the interval searched, or ``None``.
        growing: whether the largest |λ| grows at the end of the interval searched.
    """

    crossing: Crossing | None
    growing: bool


def look_beyond(system: ErrorSystem, reduced: Reduction, end: float, *, any_kind: bool) -> Outlook:
    """Look from ``end`` [s] on, for a crossing of any kind or for one at ±1."""
    if not reduced.left.size:
        return Outlook(None, False)
    t, phi = reduced.sample(REACH * end, _POINTS)
    seen = int((np.abs(phi).max(axis=(1, 2)) < DROWNED).argmin()) or len(t)
    first = max(int(np.searchsorted(t, end * (1 - 1e-12))), 1)  # t[first] is the end, or the first grid point after it
    t, phi = t[first - 1 : seen], phi[first - 1 : seen]
    if len(t) < 2:
        return Outlook(None, False)
    size = np.abs(np.linalg.eigvals(phi))
    largest, outside = size.max(axis=1), (size > 1).sum(axis=1)
    growing = bool(largest[1] > largest[0] * (1 + 1e-9))
    for i in 1 + np.flatnonzero(np.diff(outside[1:])):
        try:
            found = search(system, float(t[i + 1]), delta_start=float(t[i]), reduced=reduced).crossings
        except AnalysisError:
            break
        for crossing in found:
            if any_kind or crossing.kind != "complex":
                return Outlook(crossing, growing)
    return Outlook(None, growing)
