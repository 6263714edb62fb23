"""The hold, which generates the control between events (paper, section 2.2)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from icmj.base.array import Array, real
from icmj.controller.design import Design
from icmj.errors import AnalysisError

_ALIKE = 1e4  # condition of eigenvectors beyond which they cost digits


@dataclass(frozen=True, eq=False)
class Hold:
    """The motion of the hold state between events: ẋ_h = A_h x_h (eq. hold).

    Attributes:
        name: name for tables and figures.
        A_h: hold matrix, shape (n̂, n̂).

    Raises:
        AnalysisError: on construction, if A_h is not square, or complex.
    """

    name: str
    A_h: Array

    def __post_init__(self) -> None:
        A_h = np.atleast_2d(real(self.A_h, "A_h", AnalysisError))
        if A_h.ndim != 2 or A_h.shape[0] != A_h.shape[1]:
            raise AnalysisError(f"A_h must be a square matrix, got shape {A_h.shape}")
        object.__setattr__(self, "A_h", A_h)

    def expect_fit(self, design: Design) -> None:
        """Check that the hold fits ``design``.

        Raises:
            AnalysisError: if it has another number of states.
        """
        n = design.plant.n
        if self.A_h.shape != (n, n):
            raise AnalysisError(f"the hold's A_h has shape {self.A_h.shape}; the controller's model has {n} states")

    def free(self, x_h: Array, t: Array) -> Array:
        """The hold state at times ``t`` [s] after ``x_h``, exp(A_h t) x_h; shapes (n̂,), (K,) → (K, n̂)."""
        rates, modes = self._modes
        if modes is None:
            from scipy.linalg import expm

            return np.asarray(expm(self.A_h * t[:, None, None]) @ x_h)
        parts = np.linalg.solve(modes, x_h.astype(complex))
        return np.asarray((np.exp(np.multiply.outer(t, rates)) * parts) @ modes.T).real

    @cached_property
    def _modes(self) -> tuple[Array, Array | None]:
        """Eigenvalues and eigenvectors of A_h; no eigenvectors (``None``) if they are nearly linearly dependent."""
        rates, modes = np.linalg.eig(self.A_h)
        return rates, modes if np.linalg.cond(modes) < _ALIKE else None


def system_matched(design: Design) -> Hold:
    """The system-matched hold, A_h = Â_c = Â − B̂k̂ (eq. holde)."""
    return Hold("system-matched", design.A_c)


def zero_order(design: Design) -> Hold:
    """The zero-order hold, A_h = 0: the control signal keeps the value that it has at the event."""
    return Hold("zero-order", np.zeros_like(design.A_c))


HOLDS = {"system-matched": system_matched, "zero-order": zero_order}
