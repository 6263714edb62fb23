"""The stationary covariance of x and u under the predictor controller and white noise, where its model is exact."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from icmj.base.array import Array
from icmj.controller.predictor import PredictorController
from icmj.errors import AnalysisError, expect


def predictor_covariance(law: PredictorController, W: ArrayLike, V: ArrayLike = 0.0) -> tuple[Array, Array]:
    """The stationary covariance of x and u under white noise, if the model of the controller is exact.

    With x(t + t_d) = p(t) + e^{Ât_d} e(t) + η(t), the observer error e and the prediction p follow a linear equation
    under the noise until t, and η is the effect of the noise from t to t + t_d.

    Args:
        law: the controller, whose assumed delay equals the actual one.
        W: intensity of white noise on the inputs [input² s], shape (n_u, n_u), or one number for each input.
        V: intensity of white noise on the readings [output² s], shape (n_y, n_y), or one number for each output.

    Returns:
        The covariances of x and u, shapes (n, n) and (n_u, n_u).

    Raises:
        AnalysisError: if the controller assumes another delay, is not stable, or an intensity has the wrong shape.
    """
    from scipy.linalg import expm, solve_continuous_lyapunov

    expect(law, PredictorController, "the covariance")
    D, t_d, n = law.design, law.delay.t_d, law.plant.n
    if len(law.realisation.taps) > 1 or "p" not in law.realisation.layout.names:
        raise AnalysisError("the covariance is that of a controller that knows its delay; this one assumes another")
    sizes = (("W", W, law.plant.n_u), ("V", V, law.plant.n_y))
    given = {name: np.asarray(value, dtype=float) for name, value, _ in sizes}
    for name, _, size in sizes:
        if given[name].ndim < 2:
            given[name] = given[name] * np.eye(size)
        if given[name].shape != (size, size) or not np.isfinite(given[name]).all():
            raise AnalysisError(f"the intensity {name} must be a number or a finite {size} × {size} matrix")
    E, B = law.E, law.plant.B
    M = np.block([[D.A_c, E @ D.L @ law.plant.C], [np.zeros((n, n)), D.A_o]])
    if np.linalg.eigvals(M).real.max() >= 0:
        raise AnalysisError("the loop is not stable, so that it has no stationary covariance")
    read, felt = np.vstack([E @ D.L, -D.L]), np.vstack([np.zeros_like(B), B])
    S = solve_continuous_lyapunov(M, -(felt @ given["W"] @ felt.T + read @ given["V"] @ read.T))
    # ∫_0^{t_d} e^{Aθ} B W Bᵀ e^{Aᵀθ} dθ (Van Loan 1978)
    block = np.block([[-law.plant.A, B @ given["W"] @ B.T], [np.zeros((n, n)), law.plant.A.T]])
    whole = expm(block * t_d)
    later = whole[n:, n:].T @ whole[:n, n:]
    now = np.hstack([np.eye(n), E])
    return now @ S @ now.T + later, D.k @ S[:n, :n] @ D.k.T
