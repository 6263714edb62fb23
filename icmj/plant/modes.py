"""Neutral, uncontrollable and unobservable modes of a linear plant, by the names of their states."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from icmj.base.array import Array
from icmj.plant.linear_plant import LinearPlant

# of the plant's size: finite differences err by 1e-9, and a double integrator's eigenvalues by the root of that
_RANK, _NEUTRAL, _SHARE = 1e-7, 1e-4, 0.1


@dataclass(frozen=True)
class Mode:
    """An eigenvalue of A and the states that take part in it.

    Attributes:
        eigenvalue: [rad/s]; of a complex pair the upper one.
        states: those that take at least a tenth of the largest share.
    """

    eigenvalue: complex
    states: tuple[str, ...]

    @property
    def stable(self) -> bool:
        """Whether the mode decays."""
        return self.eigenvalue.real < -_NEUTRAL * max(1.0, abs(self.eigenvalue))


def neutral(plant: LinearPlant) -> tuple[Mode, ...]:
    """Modes with eigenvalue zero, such as integrators and positions without a preferred value."""
    values, vectors = np.linalg.eig(plant.A)
    size = max(1.0, float(np.abs(values).max(initial=0.0)))
    found = [Mode(0j, _names(plant, v)) for λ, v in zip(values, vectors.T, strict=True) if abs(λ) < _NEUTRAL * size]
    return tuple(dict.fromkeys(found))


def unobservable(plant: LinearPlant) -> tuple[Mode, ...]:
    """Modes that no output shows (Popov, Belevitch, Hautus): C v = 0 for a right eigenvector v."""
    return _hidden(plant, plant.A, plant.C)


def uncontrollable(plant: LinearPlant) -> tuple[Mode, ...]:
    """Modes that no input moves: wᵀB = 0 for a left eigenvector w."""
    return _hidden(plant, plant.A.T, plant.B.T)


def idle(plant: LinearPlant) -> tuple[str, ...]:
    """States on which no rate depends, such as a place on a level floor."""
    size = np.abs(plant.A).max(initial=0.0)
    return tuple(
        name for name, column in zip(plant.states, plant.A.T, strict=True) if np.abs(column).max() < 1e-8 * size
    )


def adrift(plant: LinearPlant) -> tuple[str, ...]:
    """States on which no rate depends and that no input brings back: where on a level floor a body stands.

    Without them the plant has no such mode.
    """
    size = max(1.0, float(np.abs(plant.A).max(initial=0.0)))
    columns = np.linalg.norm(plant.B, axis=0)
    whole = np.hstack([plant.A, size * plant.B / np.where(columns > 0, columns, 1.0)])
    U, values, _ = np.linalg.svd(whole)
    kept = U[:, values < _RANK * size].T  # wᵀ[A, B] = 0: what wᵀx is never changes
    found: list[str] = []
    for name in idle(plant):
        w = kept[:, plant.states.index(name)]
        if np.linalg.norm(w) < _RANK:
            continue
        found.append(name)
        # what else never changes, once this state is gone
        kept = np.linalg.svd(w[None, :])[2][1:] @ kept
    return tuple(found)


def _hidden(plant: LinearPlant, A: Array, C: Array) -> tuple[Mode, ...]:
    # rows and outputs brought to one size, so that neither units nor a weak input look like a missing rank
    size = max(1.0, float(np.abs(A).max(initial=0.0)))
    rows = np.linalg.norm(C, axis=1, keepdims=True)
    seen = size * C / np.where(rows > 0, rows, 1.0)
    modes: dict[Mode, None] = {}
    for λ in np.linalg.eigvals(A):
        if λ.imag < 0:
            continue
        _, values, V = np.linalg.svd(np.vstack([A - λ * np.eye(plant.n), seen]))
        for value, v in zip(values, V.conj(), strict=True):
            if value < _RANK * size:
                modes[Mode(complex(np.round(λ, 4)) + 0, _names(plant, v))] = None
    return tuple(modes)


def _names(plant: LinearPlant, vector: np.ndarray) -> tuple[str, ...]:
    share = np.abs(vector)
    return tuple(name for name, part in zip(plant.states, share, strict=True) if part > _SHARE * share.max())
