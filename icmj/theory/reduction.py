"""The error system in balanced coordinates, without its neutral directions (docs/theory.md, "Neutral modes").

Here units end: tolerances of the search and of multipliers are relative to rows and columns of like norms.

In the coordinates Z = (x̄, e_hp) a jump is e_hp := 0 and nothing else. So what never shows in e_hp is not touched by
jumps, and what e_hp does not drive is not changed by them: both go as e^{μΔ} whatever the intervals are. Such modes
with Re μ = 0 put an eigenvalue of φ(Δ) on the unit circle for every Δ, which says nothing of the cycle. Taken out are

- modes that neither e_hp nor u sees (the quotient by an invariant subspace), with Re μ = 0;
- of those with Re μ > 0 the ones that y does not see either;
- modes with Re μ = 0 that the loop sees but cannot change (the restriction to where they are zero).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from icmj.base.array import Array
from icmj.base.balancing import balance
from icmj.errors import AnalysisError
from icmj.theory.error_system import ErrorSystem
from icmj.theory.flow import Flow, make_flow
from icmj.theory.invariant_subspaces import (
    complete_basis,
    estimate_error,
    find_neutral,
    find_unseen,
    group_eigenvalues,
    select_growing,
    select_lasting,
)
from icmj.theory.neutral_modes import NeutralKind, NeutralMode, describe_mode, name_carriers

_SHOWS = 1e-8  # an output sees a mode above this, relative to its row


@dataclass(frozen=True, eq=False)
class Reduction:
    """φ_r(Δ) = left e^{A (Δ − t_d)} right on x̄_r = project x̄, balanced and without neutral directions; m are left.

    Attributes:
        flow: of A, the matrix of what is left, shape (M, M).
        left, right: from its state to x̄_r and back after an event, shapes (m, M) and (M, m).
        project: x̄_r = project x̄, shape (m, n + n̂).
        lift: an x̄ for each x̄_r, shape (n + n̂, m); project lift = I.
        dropped: x̄ of the directions that are unseen, shape (n + n̂, r).
        along: coordinates of x̄ in those directions, shape (r, n + n̂); along dropped = I, along lift = 0.
        fixed: coordinates of x̄ that the loop cannot change and that are taken to be zero, shape (c, n + n̂).
        scale: of the balanced coordinates of x̄, shape (n + n̂,).
        modes: what was taken out.
        t_d: delay [s]; ``right`` then leads to the state after the action, and x̄ is the whole state at an event.
        neglected: what the removed directions do to the rest, or it to them, relative to A. It is rounding, unless one
            is neutral but for an error that A may have.
    """

    flow: Flow
    left: Array
    right: Array
    project: Array
    lift: Array
    dropped: Array
    along: Array
    fixed: Array
    scale: Array
    modes: tuple[NeutralMode, ...]
    t_d: float = 0.0
    neglected: float = 0.0

    @property
    def A(self) -> Array:
        """The matrix of the reduced system, shape (M, M)."""
        return self.flow.A_C

    def shown_by(self, rows: Array) -> NDArray[np.bool_]:
        """Whether each row depends on a direction that events do not see, shape (c, n + n̂) → (c,)."""
        rows = rows * self.scale
        seen = np.linalg.norm(rows @ (self.dropped / self.scale[:, None]), axis=1)
        return np.asarray(seen > _SHOWS * np.linalg.norm(rows, axis=1))

    def complete(self, vector: Array, phi: Array, sign: int) -> Array:
        """x̄ for an eigenvector of φ_r, with what it takes along in the unseen directions for φ x̄ = ±x̄.

        Where these drift over every interval there is no such x̄; then the one that drifts least.

        Args:
            vector: eigenvector of φ_r at ``sign``, shape (m,).
            phi: φ, shape (n + n̂, n + n̂).
            sign: +1 or −1.
        """
        x_bar = self.lift @ vector
        if not self.dropped.shape[1]:
            return x_bar
        moved = self.along @ (phi @ np.column_stack([x_bar, self.dropped]))
        moved[:, 1:] -= sign * np.eye(len(moved))
        U, values, Vh = np.linalg.svd(moved[:, 1:])
        kept = values > 1e-9 * max(1.0, values[0])
        along = Vh[kept].T @ ((U[:, kept].T @ moved[:, 0]) / values[kept])
        return np.asarray(x_bar - self.dropped @ along)

    def sample(self, end: float, points: int) -> tuple[Array, Array]:
        """Δ from t_d to ``end`` [s] in at least ``points`` steps, and φ_r there, which may overflow.

        Returns:
            shapes (M,) and (M, m, m).
        """
        with np.errstate(over="ignore", invalid="ignore"):
            t, states = self.flow.trajectory(self.right, end - self.t_d, points)
            return self.t_d + t, self.left @ states

    def phi(self, delta: float) -> Array:
        """φ_r(Δ), shape (m, m)."""
        return np.asarray(self.left @ self.flow.exponential(delta - self.t_d) @ self.right)


def reduce_system(system: ErrorSystem, prepared: Flow | None = None) -> Reduction:
    """Balance the system, and remove the neutral directions.

    Args:
        system: the error system.
        prepared: its flow, if at hand.

    Raises:
        AnalysisError: if Ā_C is not finite, or there are neutral directions and a delay; it names their states.
    """
    whole = prepared or make_flow(system.A_C)
    size, n_hat = system.n + system.n_hat, system.n_hat
    H = np.eye(len(system.A_C))  # X̄ = H (x̄, e_hp)
    H[size:, system.n : size] = np.eye(n_hat)
    A = (2 * np.eye(len(H)) - H) @ system.A_C @ H
    try:
        A, scale = balance(A)
        e_hp = np.eye(len(A))[size:]
        felt, shown = np.vstack([e_hp, (system.C_u @ H) * scale]), (system.C_y @ H) * scale
        unfelt = find_unseen(A, felt)
        D = np.linalg.qr(np.hstack([select_lasting(A, unfelt), select_growing(A, unfelt, shown)]))[0][:size]
        A_q = restrict_system(A, complete_basis(D))
        L = find_neutral(A_q.T, np.eye(len(A_q))[-n_hat:])[: len(A_q) - n_hat]
    except np.linalg.LinAlgError as error:
        raise AnalysisError(
            f"not analysable, because the modes of the error system cannot be distinguished ({error})"
        ) from error
    if not D.shape[1] and not L.shape[1]:
        return _balance_whole(system, whole)
    Q = complete_basis(D)
    R = Q @ complete_basis(L)
    named = _ModeNames(system, A, scale, shown)
    modes = [*named.unfelt(D), *named.unmoved(Q @ L)]
    if system.delay:
        raise AnalysisError(f"not analysable with a delay: {_in_the_way(modes)}")
    m, s = R.shape[1], scale[:size]
    left = np.eye(m, m + n_hat)
    return Reduction(
        make_flow(restrict_system(A, R)),
        left,
        left.T.copy(),
        R.T / s,
        R * s[:, None],
        D * s[:, None],
        D.T / s,
        (Q @ L).T / s,
        s,
        tuple(modes),
        neglected=_measure_coupling(A, D, Q @ L, R),
    )


def _in_the_way(modes: Sequence[NeutralMode]) -> str:
    """The treatment of neutral modes if a jump is more than e_hp := 0, so that they cannot be removed."""
    names = tuple(dict.fromkeys(name for mode in modes for name in mode.states))
    drop = ", ".join(f'"{name}"' for name in names if not name.startswith("observer's"))
    does = "are" if len(names) > 1 else "is"
    words = f"{', '.join(names)} {does} neutral (no event and no control changes it)"
    return words + (f"; leave it out of the model, as drop = [{drop}] does, or take the delay out" if drop else "")


def _balance_whole(system: ErrorSystem, whole: Flow) -> Reduction:
    """The system as it is, in balanced coordinates."""
    size, s = len(system.exit), whole.scale
    empty = np.zeros((size, 0))
    left, right = system.exit * s / s[:size, None], system.entry * s[:size] / s[:, None]
    s = s[:size]
    own = replace(whole, A_C=whole.balanced, scale=np.ones(len(whole.scale)))
    return Reduction(own, left, right, np.diag(1 / s), np.diag(s), empty, empty.T, empty.T, s, (), system.delay.t_d)


def restrict_system(A: Array, R: Array) -> Array:
    """A on (R x̄_r, e_hp)."""
    K = _extend(R, len(A))
    return np.asarray(K.T @ A @ K)


def _extend(R: Array, size: int) -> Array:
    """Basis of (R x̄_r, e_hp) in (x̄, e_hp), shape (size, m + n̂)."""
    rest = size - len(R)
    K = np.zeros((size, R.shape[1] + rest))
    K[: len(R), : R.shape[1]], K[len(R) :, R.shape[1] :] = R, np.eye(rest)
    return K


def _measure_coupling(A: Array, D: Array, L: Array, R: Array) -> float:
    """What D does to (R x̄_r, e_hp), and these to L, relative to A: none if D and L are invariant."""
    K, size = _extend(R, len(A)), len(R)
    onto, out_of = K.T @ A[:, :size] @ D, L.T @ A[:size] @ K
    return float(np.hypot(np.linalg.norm(onto), np.linalg.norm(out_of)) / np.linalg.norm(A))


class _ModeNames:
    """Finds what to call a mode. Vectors are of balanced coordinates, so that their entries can be compared."""

    def __init__(self, system: ErrorSystem, A: Array, scale: Array, shown: Array) -> None:
        self.system, self.shown = system, shown
        self.size = system.n + system.n_hat
        self.A, self.scale = A[: self.size, : self.size], scale[: self.size]

    def unfelt(self, D: Array) -> list[NeutralMode]:
        """Records of the modes in the invariant subspace D of x̄."""
        A_D = D.T @ self.A @ D
        found = []
        for rates, within in group_eigenvalues(A_D, estimate_error(self.A)):
            V = D @ within
            x, x_o = np.split(V * self.scale[:, None], [self.system.n])
            weights = np.vstack([x, x_o + self.system.T_hat @ x]) / self.scale[:, None]
            rows = self.shown[:, : self.size]
            seen = np.linalg.norm(rows @ V, axis=1) > _SHOWS * np.linalg.norm(rows, axis=1)
            outputs = tuple(name for name, sees in zip(self.system.actual.outputs, seen, strict=True) if sees)
            kind: NeutralKind = "unstable" if rates[0].real > 0 else "neutral"
            drifts = not rates[0].imag and np.abs(within.T @ A_D @ within).max() > estimate_error(self.A)
            found.append(describe_mode(kind, rates, self._carried(weights), outputs, drifts=drifts))
        return found

    def unmoved(self, L: Array) -> list[NeutralMode]:
        """Records of the conserved directions in the left-invariant subspace L of x̄."""
        A_L = L.T @ self.A @ L
        found = []
        for rates, within in group_eigenvalues(A_L, estimate_error(self.A)):
            x, x_o = np.split((L @ within) / self.scale[:, None], [self.system.n])
            weights = np.vstack([x - self.system.T_hat.T @ x_o, x_o]) * self.scale[:, None]
            found.append(describe_mode("offset", rates, self._carried(weights)))
        return found

    def _carried(self, weights: Array) -> tuple[str, ...]:
        x, x_o = np.split(np.linalg.norm(weights, axis=1), [self.system.n])
        if x.max(initial=0.0) >= 1e-3 * x_o.max(initial=0.0):
            return name_carriers(x, self.system.actual.states)
        return tuple(f"observer's {name}" for name in name_carriers(x_o, self.system.design.plant.states))


def is_stable_modulo_neutral(A: Array, inputs: Array, outputs: Array) -> bool:
    """Whether ẋ = A x decays, but for neutral modes that ``outputs`` do not see or ``inputs`` cannot change.

    Args:
        A: shape (n, n).
        inputs: shape (n, n_u).
        outputs: shape (c, n).
    """
    A, scale = balance(A)
    Q = complete_basis(find_neutral(A, outputs * scale))
    A, inputs = Q.T @ A @ Q, Q.T @ (inputs / scale[:, None])
    R = complete_basis(find_neutral(A.T, inputs.T))
    return bool(np.linalg.eigvals(R.T @ A @ R).real.max(initial=-np.inf) < 0)
