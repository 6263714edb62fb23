"""The design: state-feedback gain k̂ and observer gain L for the assumed plant (paper, eqs. obs–A_c)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from icmj.base.array import Array, real
from icmj.base.balancing import SEMIDEFINITE, compute_balanced_modes
from icmj.base.blas_threads import ignore_warnings, limit_to_one_thread
from icmj.base.text import one_line
from icmj.errors import DesignError
from icmj.plant.linear_plant import LinearPlant, expect_linear


@dataclass(frozen=True, eq=False)
class Design:
    """Gains designed on the assumed plant.

    Attributes:
        plant: the assumed plant [Â, B̂, Ĉ].
        k: state-feedback gain k̂, shape (n_u, n̂); u = −k̂ x_h.
        L: observer gain, shape (n̂, n_y).
    """

    plant: LinearPlant
    k: Array
    L: Array

    def __post_init__(self) -> None:
        expect_linear(self.plant, "the plant of the design")
        k, L = np.atleast_2d(real(self.k, "k", DesignError)), np.atleast_2d(real(self.L, "L", DesignError))
        if k.shape != (self.plant.n_u, self.plant.n) or L.shape != (self.plant.n, self.plant.n_y):
            raise DesignError(
                f"gains do not fit the plant: k {k.shape}, expected {(self.plant.n_u, self.plant.n)}; "
                f"L {L.shape}, expected {(self.plant.n, self.plant.n_y)}"
            )
        object.__setattr__(self, "k", k)
        object.__setattr__(self, "L", L)

    @property
    def A_c(self) -> Array:
        """Â_c = Â − B̂k̂, shape (n̂, n̂) (eq. A_c)."""
        return self.plant.A - self.plant.B @ self.k

    @property
    def A_o(self) -> Array:
        """Â_o = Â − LĈ, shape (n̂, n̂) (eq. A_o)."""
        return self.plant.A - self.L @ self.plant.C


def output_weight(design: Design) -> Array:
    """Q_t = ĈᵀĈ: the event error is measured at the outputs."""
    return design.plant.C.T @ design.plant.C


@limit_to_one_thread()
def design_lq(
    plant: LinearPlant,
    *,
    Q_c: ArrayLike | None = None,
    R_c: ArrayLike = 1.0,
    Q_o: ArrayLike | None = None,
    R_o: ArrayLike = 1.0,
) -> Design:
    """Linear-quadratic regulator and estimator of ``plant``, equal to python-control's ``lqr`` and ``lqe`` bit for bit.

    Args:
        plant: the assumed plant.
        Q_c: state weight, shape (n, n); ``None`` means ĈᵀĈ (the outputs are weighted).
        R_c: input weight, scalar (times identity) or shape (n_u, n_u).
        Q_o: state disturbance intensity, shape (n, n); ``None`` means B̂B̂ᵀ (noise enters with the inputs).
        R_o: output noise intensity, scalar (times identity) or shape (n_y, n_y).

    Raises:
        DesignError: if a weight has the wrong shape or sign or is not symmetric, or a Riccati equation has no
            stabilising solution.
        AnalysisError: if the plant is not linear.
    """
    expect_linear(plant, "the plant to design for")
    C_w = plant.C.T @ plant.C if Q_c is None else _semidefinite(_square(Q_c, plant.n, "Q_c"), "Q_c")
    B_w = plant.B @ plant.B.T if Q_o is None else _semidefinite(_square(Q_o, plant.n, "Q_o"), "Q_o")
    R_c, R_o = (
        _definite(_square(R, size, name), name) for R, size, name in ((R_c, plant.n_u, "R_c"), (R_o, plant.n_y, "R_o"))
    )
    try:
        # what overflows on the way shows in the poles, and needs no warning
        with np.errstate(all="ignore"), ignore_warnings():
            k, E_c = _regulator(plant.A, plant.B, C_w, R_c)
            L_transposed, E_o = _regulator(plant.A.T, plant.C.T, B_w, R_o)
            L = L_transposed.T
    except (np.linalg.LinAlgError, ArithmeticError, ValueError, MemoryError) as error:
        raise DesignError(_NO_DESIGN.format(one_line(error, 200))) from error
    if not (np.isfinite(k).all() and np.isfinite(L).all()):
        raise DesignError(_NO_DESIGN.format("the gains are not finite"))
    design = Design(plant, k, L)
    for what, poles in (("state feedback", E_c), ("observer", E_o)):
        if not np.all(np.isfinite(poles)) or np.max(np.real(poles)) >= 0:
            raise DesignError(
                f"the {what} designed is not stable (largest real part "
                f"{np.max(np.real(poles)):.3g}/s); see that inputs move and outputs show each unstable mode of the "
                "plant, or change its weights"
            )
    return design


def _regulator(A: Array, B: Array, Q: Array, R: Array) -> tuple[Array, NDArray[np.complex128]]:
    """The gain that minimises ∫ xᵀQx + uᵀRu, and the poles it makes; the estimator's is that of the dual system.

    The same steps as in python-control, whose import alone would take longer than the whole analysis.
    """
    from scipy.linalg import solve_continuous_are

    X = solve_continuous_are(A, B, Q, R)
    k = np.linalg.solve(R, B.T @ X)
    return k, np.linalg.eigvals(A - B @ k).astype(complex)


_NO_DESIGN = (
    "no LQ design for this plant ({}); check that its unstable poles can be reached by the inputs and seen in the "
    "outputs, and that the weights see them and are not orders of magnitude apart"
)


def _square(weight: ArrayLike, size: int, name: str) -> Array:
    expected = f"expected a scalar, {size} diagonal entries or a {size} × {size} matrix"
    W = real(weight, f"weight {name}", DesignError)
    if not np.isfinite(W).all():
        raise DesignError(f"weight {name} holds a NaN or an infinity")
    if W.ndim == 0:
        return W * np.eye(size)
    if W.ndim == 1 and W.size == size:
        return np.diag(W)
    if W.shape != (size, size):
        raise DesignError(f"weight {name} has shape {W.shape}; {expected}")
    if np.abs(W - W.T).max() > 1e-9 * np.abs(W).max():
        raise DesignError(f"weight {name} is not symmetric; write each entry off the diagonal twice")
    return (W + W.T) / 2


def _semidefinite(W: Array, name: str) -> Array:
    if compute_balanced_modes(W)[1][0] < -SEMIDEFINITE:
        raise DesignError(f"weight {name} has a negative eigenvalue; it must not reward what it weighs")
    return W


def _definite(W: Array, name: str) -> Array:
    if not compute_balanced_modes(W)[1][0] > 0:
        raise DesignError(f"weight {name} must be positive in every direction; it has an eigenvalue that is not")
    return W
