"""A tilt of the support surface as what it does: it turns gravity, accelerates every mass, and is read."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from icmj.base.array import Array
from icmj.errors import SimulationError
from icmj.plant.linear_plant import Vector
from icmj.simulation.disturbance import list_terms
from icmj.simulation.sources import Noise, Sinusoids, Source


def make_tilt_sources(
    source: Source, vertical: Mapping[str, float], rate: Mapping[str, float], point: Vector | None = None
) -> Iterator[Source]:
    """The effects of a tilt φ(t) on a body in the frame of the surface, to first order.

    Args:
        source: φ(t) with its axis, a sum of sinusoids that acts from the beginning.
        vertical, rate: shares of φ and of its rate that are added to the observer's readings of outputs, by name.
        point: on the axis, in the world [m]; the origin if ``None``.

    Raises:
        SimulationError: if it is of another kind, whose angular acceleration is not finite.
    """
    if not isinstance(source, Noise | Sinusoids):
        kind = type(source).__name__.lower()
        raise SimulationError(f"a tilt of kind {kind!r} has no finite acceleration; give sines, ternary or noise")
    terms = np.array([term[:5] for term in list_terms(source)])
    if (terms[:, 3] > 0).any() or np.isfinite(terms[:, 4]).any():
        raise SimulationError("a tilt that begins or ends at an instant has no finite acceleration; let it last")
    angle = terms[:, :3]

    def sinusoids(factor: Array | float, turned: float = 0.0, **where: object) -> Sinusoids:
        of = angle.copy()
        of[:, 0] *= factor
        of[:, 2] += turned
        return Sinusoids(terms=tuple(map(tuple, of.tolist())), **where)  # type: ignore[arg-type]

    yield sinusoids(1.0, surface="gravity", axis=source.axis, on="body")
    yield sinusoids(-(angle[:, 1] ** 2), surface="turning", axis=source.axis, point=point, on="body")
    for output, share in vertical.items():
        if share:
            yield sinusoids(share, output=output)
    for output, share in rate.items():
        if share:
            yield sinusoids(share * angle[:, 1], np.pi / 2, output=output)
