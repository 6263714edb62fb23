"""The characteristic roots of a loop with delayed feedback, and its limit of stability.

A linear plant under a controller that reads delayed outputs, in one mode, is

    ẇ(t) = F w(t) + Σ_j G_j w(t − τ_j),      w = (x, a)

and e^{st} v is a solution if Δ(s) v = 0 with Δ(s) = sI − F − Σ_j G_j e^{−sτ_j}. There are infinitely many such s, of
which finitely many lie to the right of any vertical line. They are found as eigenvalues of the solution's generator, on
Chebyshev points (Breda, Maset and Vermiglio 2005), and each is refined by Newton's method on Δ(s) v = 0. The argument
principle proves that none is missed to the right of a line: their number is the winding number of det Δ(s) along the
boundary of a region that contains all of them.

The loop of a plant under the continuous predictor controller: roots, frequency response, variance.

In the controller's own time, t_d later, with P what it predicts for now (:mod:`icmj.controller.predictor`),

    ẋ   = A x + B (u + d)
    ẋ_o = Â x_o + B̂ u(t − t_d) + L (y(t − t_d) + n(t − t_d) − Ĉ x_o)
    u   = −k̂ P,      P = e^{Â t̂} x_o + ∫_0^{t̂} e^{Âθ} B̂ u(t − θ) dθ

The integral is Φ(s) u in Laplace's terms, with Φ(s) = ∫_0^{t̂} e^{(Â − sI)θ} dθ B̂, which is an entire function: it has
no poles at the eigenvalues of Â, as the differential equation for P has. Those are left out by taking it as it is.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import singledispatch
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from icmj.base.array import Array, balance, falling
from icmj.controller.controller import Law
from icmj.controller.predictor import PredictorController
from icmj.errors import AnalysisError, expect
from icmj.plant.linear_plant import LinearPlant, match_ports

_FEWEST, _MANY, _MOST = 16, 64, 256  # Chebyshev points: at first, to see all roots of a loop that has few, at last
NEUTRAL = 1e-7  # of the inverse of the longest delay, or of the size of the matrix where there is none
_SAME = 1e-7  # relative to the fastest root asked for: two roots that are one
_CLOSE = 1e-9  # relative step of Newton's method below which only rounding keeps it from falling further


@dataclass(frozen=True, eq=False)
class DelayLoop:
    """A linear system with discrete delays.

    Attributes:
        F: matrix of the undelayed part, shape (N, N).
        G: matrices of the delayed parts, shape (T, N, N).
        tau: delays [s], positive, shape (T,); without any the loop is an ordinary linear system.
    """

    F: Array
    G: Array
    tau: Array

    @property
    def left_out(self) -> np.ndarray:
        """Roots of these equations that are not the loop's."""
        return np.zeros(0)

    def characteristic(self, s: complex) -> np.ndarray:
        """The characteristic matrix Δ(s), shape (N, N)."""
        delayed = np.tensordot(np.exp(-s * self.tau), self.G, axes=1)
        return np.asarray(s * np.eye(len(self.F)) - self.F - delayed)

    def slope(self, s: complex) -> np.ndarray:
        """Its derivative Δ'(s), shape (N, N)."""
        return np.asarray(np.eye(len(self.F)) + np.tensordot(self.tau * np.exp(-s * self.tau), self.G, axes=1))


def delay_loop(plant: LinearPlant, law: Law, mode: int = 0) -> DelayLoop:
    """The loop of ``plant`` under ``law`` if it stays in one mode; inputs and outputs are matched by name.

    Raises:
        AnalysisError: if the law reads its own commands, is reset, or has no such mode.
    """
    real, plant = law.realisation, match_ports(plant, law.plant)
    if real.commands or real.period < np.inf:
        raise AnalysisError(f"the {law.kind} controller reads its own commands or is reset; take predictor_loop of one")
    if not 0 <= mode < len(real.modes):
        raise AnalysisError(f"the {law.kind} controller has {len(real.modes)} modes, counted from 0; got {mode}")
    on, n, size, n_y = real.modes[mode], plant.n, real.layout.size, plant.n_y
    F = np.zeros((n + size, n + size))
    F[:n, :n], F[:n, n:], F[n:, n:] = plant.A, -plant.B @ on.K, on.M
    G = np.zeros((len(real.taps), n + size, n + size))
    for j in range(len(real.taps)):
        read = slice(j * n_y, (j + 1) * n_y)
        G[j, :n, :n], G[j, n:, :n] = -plant.B @ on.S[:, read] @ plant.C, on.N[:, read] @ plant.C
    if real.taps[0] == 0:  # what is read as it is belongs to the undelayed part
        F, G = F + G[0], G[1:]
    return DelayLoop(F, G, np.array(real.delayed))


def rightmost_roots(loop: DelayLoop, count: int = 4) -> np.ndarray:
    """At least the ``count`` rightmost characteristic roots, with complete pairs, by decreasing real part [rad/s].

    Each root is accurate to rounding, and no root between them or to their right is missing. Fewer roots are returned
    if the loop has no others within a distance of at least 1 / (largest delay) to the left of the last one.

    Raises:
        AnalysisError: if they cannot be found, because the rates of the loop are too large for its delay.
    """
    if not len(loop.tau):
        roots = np.linalg.eigvals(loop.F).astype(complex)
        return roots[falling(roots.real, -np.abs(roots.imag), roots.imag)]
    points, slow = _FEWEST, _rate(loop)
    while points <= _MOST:
        guesses = np.linalg.eigvals(_generator(loop, points))
        order = falling(guesses.real.astype(np.float64), np.abs(guesses.imag).astype(np.float64))
        # what turns faster than these points can follow is none, and stands in crowds
        guesses = guesses[order][np.abs(guesses[order]) * loop.tau.max() < points][: 2 * count + 4]
        found = _distinct([root for guess in guesses if (root := _polish(loop, complex(guess))) is not None], slow)
        last = min(count, len(found))
        if last:
            while last < len(found) and found[last - 1].real - found[last].real < _SAME * (slow + abs(found[last])):
                last += 1
            # a line between the last that is wanted and the next, or where there seems to be none
            next = found[last].real if last < len(found) else found[-1].real - 2 / loop.tau.max()
            line, seen = float(found[last - 1].real + next) / 2, last < len(found) or points >= _MANY
            if seen and _number_right_of(loop, line) == last:
                return found[:last]
        points *= 2
    raise AnalysisError(
        f"the {count} rightmost roots of the delayed loop cannot be distinguished; its rates are out of proportion "
        f"to its delay of {loop.tau.max():g} s"
    )


def stability_limit(loop_of: Callable[[float], DelayLoop], stable: float, unstable: float) -> tuple[float, float]:
    """The limit of stability of a family of loops, between a stable and an unstable member.

    Args:
        loop_of: a function that returns the loop for a value of the parameter.
        stable, unstable: values of the parameter at which the loop is stable, and unstable.

    Returns:
        The value at the limit, and the frequency of the roots that cross there [rad/s]; 0 for a real root.

    Raises:
        AnalysisError: if the first member is not stable, or the second one is.
    """
    from scipy.optimize import brentq

    def growth(value: float) -> float:
        return float(rightmost_roots(loop_of(value), 1)[0].real)

    if growth(stable) >= 0 or growth(unstable) <= 0:
        raise AnalysisError(f"no limit between {stable:g} and {unstable:g}: expected a stable and an unstable loop")
    at = float(brentq(growth, stable, unstable, xtol=1e-14 * max(abs(stable), abs(unstable)), rtol=1e-14))
    return at, float(abs(rightmost_roots(loop_of(at), 1)[0].imag))


def _generator(loop: DelayLoop, points: int) -> Array:
    """The generator of the solution on Chebyshev points of [−τ, 0], shape ((points + 1) N, (points + 1) N)."""
    N, longest = len(loop.F), float(loop.tau.max())
    nodes = np.cos(np.pi * np.arange(points + 1) / points)  # from 1, now, to −1, the longest delay ago
    ends = np.where((np.arange(points + 1) == 0) | (np.arange(points + 1) == points), 2.0, 1.0)
    weights = ends * (-1.0) ** np.arange(points + 1)
    gaps = nodes[:, None] - nodes[None, :] + np.eye(points + 1)
    D = np.outer(weights, 1 / weights) / gaps
    D -= np.diag(D.sum(axis=1))
    generator: Array = np.kron(2 / longest * D, np.eye(N)).astype(np.float64)
    generator[:N] = 0
    generator[:N, :N] = loop.F
    for G, tau in zip(loop.G, loop.tau, strict=True):
        generator[:N] += np.kron(_lagrange(nodes, weights, 1 - 2 * tau / longest)[None, :], G)
    return generator


def _lagrange(nodes: Array, weights: Array, at: float) -> Array:
    """The basis polynomials of the nodes at a place, by the barycentric formula."""
    gaps = at - nodes
    if (hit := np.abs(gaps) < 1e-14).any():
        return hit.astype(float)
    terms = (1 / weights) / gaps
    return np.asarray(terms / terms.sum())


def _polish(loop: DelayLoop, s: complex) -> complex | None:
    """The root near ``s`` by Newton's method on (v, s); ``None`` where it goes elsewhere.

    Its steps end where they stop falling, which large gains let them do long before the last bit of s. States are
    balanced, so that their units do not decide which v it begins with.
    """
    start, before, slow = s, np.inf, _rate(loop)
    _, scale = balance(np.abs(loop.characteristic(s)))
    units = scale / scale[:, None]
    *_, right = np.linalg.svd(loop.characteristic(s) * units)
    N = len(right)
    v = right[-1].conj()
    fixed = v.conj()
    for _ in range(30):
        delta = loop.characteristic(s) * units
        system = np.block([[delta, (loop.slope(s) * units @ v)[:, None]], [fixed[None, :], np.zeros((1, 1))]])
        try:
            step = np.linalg.solve(system, -np.append(delta @ v, fixed @ v - 1))
        except np.linalg.LinAlgError:
            return None
        v, s = v + step[:N], s + complex(step[N])
        if not np.isfinite(s):
            return None
        moved = abs(step[N]) / (slow + abs(s))
        if moved <= 1e-14 or before <= moved < _CLOSE:
            break
        before = moved
    else:
        return None
    return s if abs(s - start) <= 0.1 * (slow + abs(start)) else None


def _distinct(roots: list[complex], slow: float) -> np.ndarray:
    """Each once, with its conjugate, by falling real part; real ones without an imaginary part."""
    kept: list[complex] = []
    for root in roots:
        root = complex(root.real, abs(root.imag))
        if root.imag < _SAME * (slow + abs(root)):
            root = complex(root.real)
        if not any(abs(root - other) < _SAME * (slow + abs(root)) for other in kept):
            kept.append(root)
    whole = np.array([each for root in kept for each in ([root, root.conjugate()] if root.imag else [root])])
    return whole[falling(whole.real, -np.abs(whole.imag), whole.imag)] if len(whole) else whole


def _rate(loop: DelayLoop) -> float:
    """What slow roots are measured by [1/s]: the inverse of the longest delay, or the size of F where there is none."""
    return 1 / float(loop.tau.max()) if len(loop.tau) else float(np.linalg.norm(loop.F))


def count_unstable(loop: DelayLoop) -> int:
    """The number of roots of a loop by which it grows, with multiplicity, by the argument principle.

    Roots within ``NEUTRAL`` of the imaginary axis are not counted: a neutral mode is there but for rounding. Those of a
    predictor's loop are counted in its differential equations, less the eigenvalues of Â, which are cheaper than
    Δ(s) with its integral.
    """
    equations = DelayLoop(loop.F, loop.G, loop.tau)
    line = NEUTRAL * _rate(loop)
    return _number_right_of(equations, line) - int((loop.left_out.real > line).sum())


def _number_right_of(loop: DelayLoop, line: float) -> int:
    """The number of roots with a real part above ``line``, with multiplicity, by the argument principle.

    To the right of it s is an eigenvalue of a matrix whose entries are at most those of the sum of all magnitudes; so
    |s| is at most the spectral radius of the latter, which bounds the region. Half of it is the mirror image.
    """
    delayed = np.tensordot(np.exp(-min(line, 0.0) * loop.tau), np.abs(loop.G), axes=1)
    far = float(np.abs(np.linalg.eigvals(np.abs(loop.F) + delayed)).max()) + _rate(loop) + abs(line)
    corners = [complex(far), complex(far, far), complex(line, far), complex(line)]
    return round(sum(_turn(loop, a, b) for a, b in pairwise(corners)) / np.pi)


def _turn(loop: DelayLoop, a: complex, b: complex) -> float:
    """The change of the argument of det Δ from ``a`` to ``b``, in parts on which it changes by less than half a turn.

    Its rate is that of log det Δ, tr(Δ⁻¹Δ'), which at a distance d from a root is about 1/d.
    """
    total, stack, here = 0.0, [b], a
    at_here, rate = _direction(loop, here)
    shortest = abs(b - a) * 2.0**-40
    while stack:
        there = stack[-1]
        at_there, rate_there = _direction(loop, there)
        length = abs(there - here)
        if max(rate, rate_there) * length < 0.5 or length < shortest:
            total += float(np.angle(at_there / at_here))
            here, at_here, rate = there, at_there, rate_there
            stack.pop()
        else:
            stack.append((here + there) / 2)
    return total


def _direction(loop: DelayLoop, s: complex) -> tuple[complex, float]:
    """det Δ(s) over its magnitude, and |tr(Δ⁻¹Δ')| there."""
    delta = loop.characteristic(s)
    return complex(np.linalg.slogdet(delta)[0]), float(abs(np.trace(np.linalg.solve(delta, loop.slope(s)))))


MOST_MODES = 16


@dataclass(frozen=True, eq=False)
class PredictorLoop(DelayLoop):
    """The loop of a plant under the continuous predictor controller.

    F, G and tau are those of its differential equations, which have the roots of Â in addition to those of the loop.

    Attributes:
        plant: the actual plant, with inputs and outputs in the order of those of the controller.
        law: the controller.
    """

    plant: LinearPlant
    law: PredictorController

    @property
    def left_out(self) -> np.ndarray:
        """The eigenvalues of Â, if the prediction is part of the equations."""
        added = len(self.F) > self.plant.n + self.law.plant.n
        return np.linalg.eigvals(self.law.plant.A) if added else np.zeros(0)

    def characteristic(self, s: complex) -> np.ndarray:
        """The characteristic matrix Δ(s) of (x, x_o, u), shape (N, N)."""
        P, D, k = self.plant, self.law.design, self.law.design.k
        n, m, u = P.n, D.plant.n, P.n + D.plant.n
        late, N = np.exp(-s * self.law.delay.t_d), u + len(k)
        delta = np.zeros((N, N), complex)
        delta[:n, :n], delta[n:u, n:u], delta[u:, u:] = s * np.eye(n) - P.A, s * np.eye(m) - D.A_o, np.eye(len(k))
        delta[:n, u:], delta[n:u, :n], delta[n:u, u:] = -P.B, -late * D.L @ P.C, -late * D.plant.B
        delta[u:, n:u] = k @ self.law.E
        delta[u:, u:] += k @ self._integral(s)[0]
        return delta

    def slope(self, s: complex) -> np.ndarray:
        """Its derivative Δ'(s), shape (N, N)."""
        P, D, k, t_d = self.plant, self.law.design, self.law.design.k, self.law.delay.t_d
        n, u = P.n, P.n + D.plant.n
        late, slope = t_d * np.exp(-s * t_d), np.zeros((u + len(k),) * 2, complex)
        slope[:u, :u] = np.eye(u)
        slope[n:u, :n], slope[n:u, u:] = late * D.L @ P.C, late * D.plant.B
        slope[u:, u:] = k @ self._integral(s)[1]
        return slope

    def response(self, omega: ArrayLike) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The frequency responses of (x, u) to d, n and r.

        Args:
            omega: angular frequencies ω [rad/s], shape (K,).

        Returns:
            Responses to disturbances of the inputs, to errors of the readings, and to the set-point, of shapes
            (K, n + n_u, n_u), (K, n + n_u, n_y) and (K, n + n_u, R).
        """
        P, D, r = self.plant, self.law.design, self.law.setpoint
        n, u, n_y = P.n, P.n + D.plant.n, P.n_y
        R, columns = (len(r.names) if r else 0), P.n_u + P.n_y
        found = []
        for w in np.atleast_1d(np.asarray(omega, dtype=float)):
            late, given = np.exp(-1j * w * self.law.delay.t_d), np.zeros((u + P.n_u, columns + R), complex)
            given[:n, : P.n_u], given[n:u, P.n_u : columns] = P.B, late * D.L
            if r:
                # its integral takes in what the set-point has commanded, too, which the first row of u does
                given[u:, columns:] = late * r.gain(D.k)
            found.append(np.delete(np.linalg.solve(self.characteristic(1j * w), given), np.s_[n:u], axis=0))
        d, e, s = np.split(np.array(found), [P.n_u, P.n_u + n_y], axis=2)
        return d, e, s

    def _integral(self, s: complex) -> tuple[np.ndarray, np.ndarray]:
        """Φ(s) and Φ'(s), of exponentials of blocks (Van Loan 1978)."""
        from scipy.linalg import expm

        A, B, t = self.law.plant.A, self.law.plant.B, self.law.delay.predicted
        n, n_u = B.shape
        block = np.zeros((n + 2 * n_u,) * 2, complex)
        block[:n, :n], block[:n, n : n + n_u], block[n : n + n_u, n + n_u :] = A - s * np.eye(n), B, np.eye(n_u)
        whole = expm(block * t)[:n]
        once, twice = whole[:, n : n + n_u], whole[:, n + n_u :]
        return once, twice - t * once


@singledispatch
def loops_of(law: Law, plant: LinearPlant) -> dict[str, DelayLoop]:
    """The loops of ``plant`` under a controller that stays in one mode, by mode; of very many modes, of the first.

    Raises:
        AnalysisError: if the controller reads its outputs without a delay.
    """
    return {mode.name: delay_loop(plant, law, i) for i, mode in enumerate(law.realisation.modes[:MOST_MODES])}


@loops_of.register
def _(law: PredictorController, plant: LinearPlant) -> dict[str, DelayLoop]:
    return {"predictor": predictor_loop(plant, law)}


def predictor_loop(plant: LinearPlant, law: PredictorController) -> PredictorLoop:
    """The loop of ``plant`` under the continuous predictor controller; inputs and outputs are matched by name.

    :func:`icmj.theory.rightmost_roots` computes its characteristic roots. With an exact model these are exactly the
    eigenvalues of Â − B̂k̂ and Â − LĈ, for any delay.
    """
    expect(law, PredictorController, "the loop of a predictor")
    plant = match_ports(plant, law.plant)
    D, t_d, assumed, k = law.design, law.delay.t_d, law.delay.predicted, law.design.k
    n, m, E, B = plant.n, law.plant.n, law.E, law.plant.B
    layout, (o, p) = law.realisation.layout, (slice(n, n + m), slice(n + m, n + 2 * m))
    if "p" not in layout.names:
        F, G = np.zeros((n + m, n + m)), np.zeros((1, n + m, n + m))
        F[:n, :n], F[:n, o], F[o, o] = plant.A, -plant.B @ k, D.A_o
        G[0, o, :n], G[0, o, o] = D.L @ plant.C, -B @ k
        return PredictorLoop(F, G, np.array([t_d]), plant, law)
    F, G = np.zeros((n + 2 * m, n + 2 * m)), np.zeros((2, n + 2 * m, n + 2 * m))
    F[:n, :n], F[:n, p], F[o, o], F[p, o], F[p, p] = plant.A, -plant.B @ k, D.A_o, -E @ D.L @ law.plant.C, D.A_c
    G[0, o, :n], G[0, o, p], G[0, p, :n], G[0, p, p] = D.L @ plant.C, -B @ k, E @ D.L @ plant.C, -E @ B @ k
    G[1, p, p] = E @ B @ k
    if len(law.realisation.taps) == 1:
        return PredictorLoop(F, G[:1] + G[1:], np.array([t_d]), plant, law)
    return PredictorLoop(F, G, np.array([t_d, assumed]), plant, law)


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
