"""The linear plant ẋ = A x + B u, y = C x (paper, eq. sys) with names for its states, inputs and outputs."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from icmj.base.array import Array
from icmj.errors import AnalysisError

if TYPE_CHECKING:
    from control import StateSpace


@dataclass(frozen=True, eq=False)
class LinearPlant:
    """A linear time-invariant plant.

    Attributes:
        A: state matrix, shape (n, n).
        B: input matrix, shape (n, n_u).
        C: output matrix, shape (n_y, n).
        states, inputs, outputs: names, lengths n, n_u and n_y.
        state_units, input_units, output_units: their units, such as rad or N m; "" where it is not known.

    Raises:
        AnalysisError: on construction, if shapes disagree or an entry is not finite.
    """

    A: Array
    B: Array
    C: Array
    states: tuple[str, ...] = ()
    inputs: tuple[str, ...] = ()
    outputs: tuple[str, ...] = ()
    state_units: tuple[str, ...] = ()
    input_units: tuple[str, ...] = ()
    output_units: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        A, B, C = (np.atleast_2d(np.array(M, dtype=float)) for M in (self.A, self.B, self.C))
        n = A.shape[0]
        if A.shape != (n, n) or B.shape[0] != n or C.shape[1] != n:
            raise AnalysisError(
                f"plant matrices do not fit: A {A.shape}, B {B.shape}, C {C.shape}; expected (n, n), (n, n_u), (n_y, n)"
            )
        if not all(np.isfinite(M).all() for M in (A, B, C)):
            raise AnalysisError("plant matrices hold a NaN or an infinity; check the model's operating point")
        for M in (A, B, C):
            M.flags.writeable = False
        for name, M in zip("ABC", (A, B, C), strict=True):
            object.__setattr__(self, name, M)
        for kind, size, letter in (
            ("states", n, "x"),
            ("inputs", B.shape[1], "u"),
            ("outputs", C.shape[0], "y"),
        ):
            names = tuple(getattr(self, kind)) or tuple(f"{letter}{i}" for i in range(size))
            if len(names) != size:
                raise AnalysisError(f"plant has {size} {kind} but {len(names)} names: {', '.join(names)}")
            object.__setattr__(self, kind, names)
            of = f"{kind.removesuffix('s')}_units"
            units = tuple(getattr(self, of)) or ("",) * size
            if len(units) != size:
                raise AnalysisError(f"plant has {size} {kind} but {len(units)} units of them: {', '.join(units)}")
            object.__setattr__(self, of, units)

    @property
    def n(self) -> int:
        """Number of states."""
        return self.A.shape[0]

    @property
    def n_u(self) -> int:
        """Number of inputs."""
        return self.B.shape[1]

    @property
    def n_y(self) -> int:
        """Number of outputs."""
        return self.C.shape[0]

    @property
    def poles(self) -> NDArray[np.complex128]:
        """Eigenvalues of A [rad/s], by falling real part."""
        eigenvalues = np.linalg.eigvals(self.A).astype(complex)
        return eigenvalues[np.lexsort((eigenvalues.imag, -eigenvalues.real))]

    def scaled(self, gain: ArrayLike) -> LinearPlant:
        """The same plant with its inputs multiplied by ``gain`` (scalar or one for each input)."""
        return replace(self, B=self.B * np.asarray(gain, float))

    def statespace(self) -> StateSpace:
        """As a python-control ``StateSpace`` with the same names."""
        import control

        return control.ss(self.A, self.B, self.C, 0, states=self.states, inputs=self.inputs, outputs=self.outputs)

    @classmethod
    def from_statespace(cls, system: StateSpace) -> LinearPlant:
        """From a python-control ``StateSpace`` in continuous time without feed-through.

        Raises:
            AnalysisError: if the system is discrete or D is not zero.
        """
        if system.isdtime(strict=True):
            raise AnalysisError("the plant is a discrete-time system; intermittent control needs a continuous one")
        if np.any(system.D):
            raise AnalysisError("the plant has a direct feed-through D; move it into the states first")
        return cls(
            system.A,
            system.B,
            system.C,
            tuple(system.state_labels),
            tuple(system.input_labels),
            tuple(system.output_labels),
        )


def transformation(assumed: LinearPlant, actual: LinearPlant) -> Array:
    """T̂ of x̂ = T̂x, shape (n̂, n): picks from the actual states those of the same name (paper, section 3).

    States of the assumed plant that the actual one does not have get a row of zeros; the closed loop does
    not depend on this choice of coordinates.
    """
    return np.array([[float(name == other) for other in actual.states] for name in assumed.states])
