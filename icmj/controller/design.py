"""The parts of the intermittent controller: design, hold, delay with its predictor.

The design: state-feedback gain k̂ and observer gain L for the assumed plant (paper, eqs. obs–A_c).

The hold, which generates the control between events (paper, section 2.2).

The delay between an event and its action, and the predictor that compensates for it.

At an event t_i the pair (x_o, x_h) is sampled. The old hold continues until t_i + t_d; then x_h := E_p (x_o, x_h)(t_i),
where the model is run over the delay under the current hold (Gawthrop, Loram, Lakie and Gollee 2011). The predictor
uses the delay that the controller *assumes*, which may differ from the actual one.

An event rule is armed again only after its feedback has acted, so at most one action is pending. A clock may tick
faster than the delay; the model is then run through the pending resets, each at the time at which the controller
expects it. The controller knows its own hold, so a reset that has taken place is no longer expected; overdue resets are
left out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from icmj.base.array import RELATIVE_ROUNDING, SEMIDEFINITE, Array, balanced_modes, real
from icmj.base.blas_threads import ignore_warnings, limit_to_one_thread
from icmj.base.text import one_line
from icmj.errors import AnalysisError, DesignError
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
    if balanced_modes(W)[1][0] < -SEMIDEFINITE:
        raise DesignError(f"weight {name} has a negative eigenvalue; it must not reward what it weighs")
    return W


def _definite(W: Array, name: str) -> Array:
    if not balanced_modes(W)[1][0] > 0:
        raise DesignError(f"weight {name} must be positive in every direction; it has an eigenvalue that is not")
    return W


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


GROWTH = 36.0  # e³⁶: over a delay with more growth than that, rounding is as large as the state that is predicted
LEAST = 1e-9  # s; with a shorter one event and action cannot be told apart in a recording


@dataclass(frozen=True)
class Delay:
    """The time from an event to its action.

    Attributes:
        t_d: the actual delay [s].
        assumed: the delay that the predictor assumes [s]; ``t_d`` if ``None``.

    Raises:
        AnalysisError: on construction, if a delay is negative or not finite, if only the assumed delay is positive, or
            if the actual delay is too short to be resolved.
    """

    t_d: float = 0.0
    assumed: float | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "t_d", float(self.t_d))
        object.__setattr__(self, "assumed", None if self.assumed is None else float(self.assumed))
        for name, value in (("delay", self.t_d), ("assumed delay", self.predicted)):
            if not (np.isfinite(value) and value >= 0):
                raise AnalysisError(f"the {name} must be at least 0 s and finite, got {value}")
        if 0 < self.t_d < LEAST:
            raise AnalysisError(f"the delay must be 0 or at least {LEAST:g} s, got {self.t_d:g}")
        if self.t_d == 0 and self.predicted > 0:
            raise AnalysisError(
                f"a delay of {self.predicted:g} s is assumed where none is there; give the actual one, too"
            )

    @property
    def predicted(self) -> float:
        """The delay that the predictor compensates for [s]."""
        return self.t_d if self.assumed is None else self.assumed

    def __bool__(self) -> bool:
        return self.t_d > 0

    def in_flight(self, clock: float) -> int:
        """The largest number of pending actions right after an event, under a rule or a clock of this interval."""
        if not self:
            return 0
        return max(int(np.ceil(self.t_d / clock * (1 - RELATIVE_ROUNDING))), 1) if np.isfinite(clock) else 1

    def expected(self, ages: Sequence[float]) -> list[float]:
        """Times until pending actions are expected [s], from the ages of their events; overdue ones are left out."""
        times = [self.predicted - age for age in ages]
        return [time for time in times if time > RELATIVE_ROUNDING * self.predicted]


NO_DELAY = Delay()


def predictor(design: Design, hold: Hold, delay: float, resets: Sequence[float] = ()) -> Array:
    """E_p, which takes (x_o, x_h, p_1 … p_r) to the state of the model after ``delay``.

    It is the first block row of expm([[Â, −B̂k̂], [0, A_h]] t_d), taken through resets x_h := p_j on the way.

    Args:
        design, hold: of the controller.
        delay: how far ahead [s].
        resets: when x_h will be reset to p_1 … p_r, rising, each less than ``delay`` [s].

    Returns:
        shape (n̂, (2 + r) n̂).

    Raises:
        AnalysisError: if the model or the hold grows so much over the delay that no digit of the prediction is right.
    """
    from scipy.linalg import expm

    n, known = design.plant.n, 2 + len(resets)
    M = np.block([[design.plant.A, -design.plant.B @ design.k], [np.zeros((n, n)), hold.A_h]])
    fastest = float(np.linalg.eigvals(M).real.max())
    if fastest * delay > GROWTH:
        raise AnalysisError(
            f"no prediction over a delay of {delay:g} s: the model grows e^{fastest * delay:.3g}-fold in it, which "
            "leaves no significant digit; assume a shorter delay"
        )
    state, now = np.eye(2 * n, known * n), 0.0
    for j, at in enumerate(resets):
        state = expm(M * (at - now)) @ state
        state[n:] = 0
        state[n:, (2 + j) * n : (3 + j) * n] = np.eye(n)
        now = at
    return np.asarray((expm(M * (delay - now)) @ state)[:n])
