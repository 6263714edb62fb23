"""The characteristic roots of a loop with delayed feedback, and its limit of stability.

A linear plant under a controller that reads delayed outputs, in one mode, is

    ẇ(t) = F w(t) + Σ_j G_j w(t − τ_j),      w = (x, a)

and e^{st} v is a solution if Δ(s) v = 0 with Δ(s) = sI − F − Σ_j G_j e^{−sτ_j}. There are infinitely many such s, of
which finitely many lie to the right of any vertical line. They are found as eigenvalues of the solution's generator, on
Chebyshev points (Breda, Maset and Vermiglio 2005), and each is refined by Newton's method on Δ(s) v = 0. The argument
principle proves that none is missed to the right of a line: their number is the winding number of det Δ(s) along the
boundary of a region that contains all of them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from icmj.base.array import Array, argsort_descending
from icmj.base.balancing import balance
from icmj.controller.law import Law
from icmj.errors import AnalysisError
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
        return roots[argsort_descending(roots.real, -np.abs(roots.imag), roots.imag)]
    points, slow = _FEWEST, _rate(loop)
    while points <= _MOST:
        guesses = np.linalg.eigvals(_generator(loop, points))
        order = argsort_descending(guesses.real.astype(np.float64), np.abs(guesses.imag).astype(np.float64))
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
    return whole[argsort_descending(whole.real, -np.abs(whole.imag), whole.imag)] if len(whole) else whole


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
