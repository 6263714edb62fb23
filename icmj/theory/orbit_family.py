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
from icmj.theory.invariant_subspaces import complete_basis

_MOST_MEMBERS = 16


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


def list_mixtures(k: int) -> Array:
    """Coefficients of the members to look at, the evenly mixed one first, shape (members, k)."""
    if k == 1:
        return np.ones((1, 1))
    flipped = np.ones((k - 1, k)) - 2 * np.eye(k)[1:]
    return np.vstack([np.ones((1, k)), flipped, np.eye(k)])[:_MOST_MEMBERS]


def divide_by_family(J: Array, basis: Array, sign: int) -> Array:
    """J without the family: on the quotient by its tangent space, where J is ±1; shape (m − k + 1, m − k + 1).

    Args:
        J: Jacobian of the return map at one member, shape (m, m).
        basis: of the eigenspace, shape (m, k).
        sign: the eigenvalue of φ there.
    """
    k = basis.shape[1]
    if k == 1:
        return J
    # on the eigenspace J differs from ±1 by a matrix of rank one, which moves the event
    along = np.linalg.svd(J @ basis - sign * basis)[2][1:].T
    Q = complete_basis(basis @ along)
    return np.asarray(Q.T @ J @ Q)
