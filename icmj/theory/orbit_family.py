"""Orbits where several equal eigenvalues reach ±1 together: not one orbit but a family of them.

Every vector of the k-dimensional eigenspace starts an orbit with the same interval, scaled until its event error
reaches the threshold. Along the family the return map is ±1 to first order, exactly: it takes each member to itself
(or its mirror image). So k − 1 multipliers say nothing, and the family attracts if the others are inside the circle.
They, and whether an earlier event comes, may differ from member to member; so several members are looked at.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from icmj.base.array import Array


@dataclass(frozen=True, eq=False)
class OrbitFamily:
    """The orbits of a repeated critical eigenvalue.

    Attributes:
        dimension: k, of the eigenspace; the family has k − 1 dimensions besides its size.
        basis: x̄ of k members that span it, shape (n + n̂, k), columns of unit norm.
        tried: how many members were looked at: the basis and mixtures of it.
        admissible: how many of these have no earlier event.
        attracting: how many of these are admissible and attract modulo the family.
        words: one sentence for people.
    """

    dimension: int
    basis: Array
    tried: int
    admissible: int
    attracting: int
    words: str


def describe_family(basis: Array, tried: int, admissible: int, attracting: int, sign: int) -> OrbitFamily:
    """The record with its sentence; ``basis`` in x̄, columns of any size."""
    k = basis.shape[1]
    members = f"of {tried} members looked at {admissible} are admissible and {attracting} attract"
    words = (
        f"{k} equal eigenvalues reach {sign:+d} together and have a family of orbits with one interval and any mixture "
        f"of {k} shapes; within it the motion is neutral ({k - 1} multiplier{'s' if k > 2 else ''} exactly {sign:+d}), "
        f"and attraction is to the family: {members}"
    )
    return OrbitFamily(k, basis / np.linalg.norm(basis, axis=0), tried, admissible, attracting, words)
