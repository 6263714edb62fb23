"""Changes of stability along a branch: test functions of the multipliers, and the points at which one is zero.

With κ the multipliers of sign · P^p, a fold or a branch point has ∏(κ − 1) = 0, a flip or the loss of the mirror
symmetry ∏(κ + 1) = 0, and a Neimark–Sacker point ∏_{i<j}(κ_i κ_j − 1) = 0. All three are smooth and real.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from icmj.base.array import Array, argmax_abs
from icmj.cycle.branch import SpecialPoint
from icmj.cycle.curve import Curve
from icmj.cycle.point import Point

Test = Literal["+1", "-1", "pair"]
TESTS: tuple[Test, ...] = ("+1", "-1", "pair")
_NEAR = 1e-2  # a κ this near to the circle is on it; a neutral saddle, two real ones of product 1, does not count


def compute_kappas(
    multipliers: NDArray[np.complex128], sign: int, neutral: int, alternating: bool = False
) -> NDArray[np.complex128]:
    """κ without those of neutral modes, and without the −1 of mirrored cycles that are of a family."""
    kappa = sign * multipliers
    kappa = kappa[np.sort(np.argsort(np.abs(kappa - 1))[neutral:])]
    return np.delete(kappa, np.abs(kappa + 1).argmin()) if alternating else kappa


def evaluate_test(test: Test, kappa: NDArray[np.complex128]) -> float:
    """A test function."""
    if test == "+1":
        return float(np.prod(kappa - 1).real)
    if test == "-1":
        return float(np.prod(kappa + 1).real)
    i, j = np.triu_indices(len(kappa), 1)
    # far inside, products are next to nothing and each factor next to −1
    return float(np.prod(1 - kappa[i] * kappa[j]).real)


def find_crossed(before: NDArray[np.complex128], after: NDArray[np.complex128]) -> list[Test]:
    """The tests that change sign between two points."""
    return [test for test in TESTS if evaluate_test(test, before) * evaluate_test(test, after) < 0]


def find_critical(test: Test, kappa: NDArray[np.complex128]) -> complex | None:
    """The κ that is on the circle; ``None`` where there is none, as at a neutral saddle."""
    if test != "pair":
        target = 1 if test == "+1" else -1
        nearest = complex(kappa[np.argmin(np.abs(kappa - target))])
        return nearest if abs(nearest - target) < _NEAR else None
    complexes = kappa[kappa.imag > 1e-8]
    if not len(complexes):
        return None
    nearest = complexes[np.argmin(np.abs(np.abs(complexes) - 1))]
    return complex(nearest) if abs(abs(nearest) - 1) < _NEAR else None


def find_direction(J: Array, multiplier: complex) -> Array:
    """The real eigenvector of J at a real multiplier, of unit norm, shape (N,)."""
    values, vectors = np.linalg.eig(J)
    v = vectors[:, np.argmin(np.abs(values - multiplier))]
    v = np.real(v * np.exp(-1j * np.angle(v[argmax_abs(v)])))
    return np.asarray(v / np.linalg.norm(v))


def describe_crossing(curve: Curve, test: Test, kappa: complex, at: Point, index: int, turns: bool) -> SpecialPoint:
    """A crossing in words."""
    name, value, p = curve.family.parameter.name, at.value, curve.p
    where = f"at {name} = {value:.8g}"
    if test == "+1":
        kind = "fold" if turns else "branch point"
        words = f"The branch turns about {where}." if turns else f"Another branch goes through it {where}."
    elif test == "-1" and curve.sign > 0:
        kind, words = "flip", f"A cycle of {2 * p} intervals branches off {where}."
    elif test == "-1":
        kind, words = "symmetry breaking", f"A pair of cycles with unlike halves branches off {where}."
    else:
        angle = abs(np.degrees(np.angle(kappa)))
        kind = "Neimark–Sacker"
        words = f"A pair of multipliers at ±{angle:.4g}° crosses the unit circle {where}: quasi-periodic sway near by."
    return SpecialPoint(
        kind,  # type: ignore[arg-type]
        value,
        index,
        at.states[0],
        at.intervals,
        at.y_peak,
        curve.sign * kappa,
        words,
    )
