"""Named segments of a state vector, declared once and shared by all who write or read it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from icmj.base.array import Array


@dataclass(frozen=True)
class Layout:
    """The division of a vector into named segments, in this order.

    Attributes:
        names: of the segments.
        sizes: of each.
    """

    names: tuple[str, ...]
    sizes: tuple[int, ...]

    @classmethod
    def of(cls, **sizes: int) -> Layout:
        """The layout with segments ``name=size`` in this order."""
        return cls(tuple(sizes), tuple(sizes.values()))

    @property
    def size(self) -> int:
        """Length of the whole vector."""
        return sum(self.sizes)

    def __getitem__(self, name: str) -> slice:
        """The place of the segment ``name``."""
        at = self.names.index(name)
        start = sum(self.sizes[:at])
        return slice(start, start + self.sizes[at])

    def split(self, vectors: Array) -> dict[str, Array]:
        """The segments of vectors in the last axis, by name, as views; shape (..., size) → (..., size of each)."""
        return {name: vectors[..., self[name]] for name in self.names}

    def join(self, **segments: Array) -> Array:
        """The vector of these segments; those not given are zero."""
        some = next(iter(segments.values()))
        missing = {name: np.zeros((*some.shape[:-1], size)) for name, size in zip(self.names, self.sizes, strict=True)}
        return np.concatenate([(missing | segments)[name] for name in self.names], axis=-1)
