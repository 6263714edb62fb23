"""Every Δ at which an eigenvalue of φ(Δ) crosses or touches the unit circle, with none lost between grid points.

Eigenvalues are not smooth where they meet, and all of them start together at φ(0) = I. So the search is for the
real zeros of three functions that are analytic in Δ, also there and at Δ = 0: with G(Δ) = (φ(Δ) − I)/Δ and its
eigenvalues g, that is λ = 1 + Δg,

    f₊ = ∏ g_i                              zero where λ = +1
    f₋ = ∏ (2 + Δ g_i)                      zero where λ = −1
    f_c = ∏_{i<j} (g_i + g_j + Δ g_i g_j)   zero where λ_i λ_j = 1, so for a complex pair on the circle

As Δ → 0, G tends to the matrix of the continuous controller (plant and observer): the eigenvalues leave +1 inwards
iff that is stable, and this departure is not a crossing. Each function is represented by Chebyshev interpolants on
panels, halved until the coefficients have decayed; all their zeros on a panel follow from a colleague matrix.
Zeros close together are zoomed into until they separate. Then the crossings found must explain the change in the
number of eigenvalues outside the circle over each panel, or the panel is halved again.

Resolution: two crossings of the same kind further apart than ``resolution`` are told apart. Closer ones, and a branch
that comes so close to the circle that its crossings would be so, are reported as one of direction ``tangent``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from icmj.base.array import Array
from icmj.errors import AnalysisError
from icmj.theory.chebyshev import coefficients, nodes, roots
from icmj.theory.circle import KINDS, Kind, Spectrum, circle_function, outside
from icmj.theory.error_system import ErrorSystem
from icmj.theory.flow import Flow, flow

_DEGREE = 24
_PANELS = 8
_DEPTH = 14
_DECAYED = 1e-10  # last Chebyshev coefficients, relative to the largest
_PLATEAU = 1e-6  # above _DECAYED they may stay below this (or 1e4 ε‖φ‖) where halving does not lower them
# from this depth on such a standstill is taken for rounding whatever its level below 1e-2
_NOISY = 5
# so many panels of one width are not all needed by zeros: what keeps them from decaying is rounding
_CROWD = 128
_ON = 1e-6  # |log|λ|| up to which an eigenvalue at a zero counts as on the circle
_NEAR = 2e-3  # zeros this close to each other or to the real axis, in half-panels, are zoomed into
# With ‖φ‖ beyond this, eigenvalues at the circle are known to no better than about 1e-6
_DROWNED = 1e8


@dataclass(frozen=True)
class Crossing:
    """One crossing of the unit circle by an eigenvalue of φ(Δ).

    Attributes:
        delta: Δ at the crossing [s].
        eigenvalue: where on the circle (the one with Im ≥ 0 of a complex pair).
        kind: ``+1``, ``-1`` or ``complex`` (a pair: Neimark–Sacker).
        direction: ``rising`` (outwards with growing Δ), ``falling`` or ``tangent``.
        largest_other: largest magnitude of the other eigenvalues there.
    """

    delta: float
    eigenvalue: complex
    kind: Literal["+1", "-1", "complex"]
    direction: Literal["rising", "falling", "tangent"]
    largest_other: float


@dataclass(frozen=True, eq=False)
class Search:
    """What was found and how far the search could see.

    Attributes:
        crossings: by rising Δ.
        delta_end: end of the interval searched [s]: ``delta_max``, or earlier where φ has grown so large that
            eigenvalues near the circle drown in its rounding (‖φ‖ > 1e8 in balanced coordinates).
    """

    crossings: tuple[Crossing, ...]
    delta_end: float


def crossings(
    system: ErrorSystem,
    delta_max: float,
    *,
    delta_start: float = 0.0,
    resolution: float = 1e-6,
    prepared: Flow | None = None,
) -> tuple[Crossing, ...]:
    """All unit-circle crossings of φ(Δ) for ``delta_start`` < Δ ≤ ``delta_max``, by rising Δ.

    Args:
        system: the error system.
        delta_max: end of the search [s].
        delta_start: start of the search [s]; the departure from φ(0) = I is never a crossing.
        resolution: distance below which two crossings of one kind count as a tangency [s].
        prepared: the flow of ``system``, if at hand.

    Raises:
        AnalysisError: if the interval is empty or not finite, or the resolution is not positive.
    """
    return search(system, delta_max, delta_start=delta_start, resolution=resolution, prepared=prepared).crossings


def search(
    system: ErrorSystem,
    delta_max: float,
    *,
    delta_start: float = 0.0,
    resolution: float = 1e-6,
    prepared: Flow | None = None,
) -> Search:
    """As :func:`crossings`, and says how far eigenvalues could be told from rounding."""
    if not (np.isfinite(delta_max) and 0 <= delta_start < delta_max):
        raise AnalysisError(f"crossings need 0 ≤ start < end, got {delta_start} and {delta_max} s")
    if delta_max <= system.delay.t_d:
        raise AnalysisError(f"no interval is shorter than the delay, {system.delay.t_d:g} s; search further than that")
    if not resolution > 0:
        raise AnalysisError(f"the resolution must be positive, got {resolution} s")
    return _Finder(system, prepared or flow(system.A_C), resolution).run(delta_start, delta_max)


class _Finder:
    """The search on one system: spectra of G on demand, panels, zeros, crossings."""

    def __init__(self, system: ErrorSystem, prepared: Flow, resolution: float) -> None:
        self.system, self.flow, self.resolution = system, prepared, resolution
        self.exit, self.entry, self.t_d = system.exit, system.entry, system.delay.t_d
        self.jump = self.exit @ self.entry - np.eye(len(self.exit))  # zero without a delay

    def run(self, start: float, end: float) -> Search:
        start = max(start, self.t_d)
        end = self._clear(end)
        if end <= start:
            return Search((), end)
        width = (end - start) / _PANELS
        left: Array = np.asarray(start + width * np.arange(_PANELS), dtype=float)
        tails = np.full(_PANELS, np.inf)
        found: list[Crossing] = []
        for depth in range(_DEPTH + 1):
            delta, g, size = self._panels(left, width)
            plateau = np.maximum(_PLATEAU, 1e4 * np.finfo(float).eps * size) if depth < _NOISY else 1e-2
            series = {kind: circle_function(kind, g, delta) @ coefficients(_DEGREE).T for kind in KINDS}
            tail = np.max([np.abs(c[:, -3:]).max(axis=1) / np.abs(c).max(axis=1) for c in series.values()], axis=0)
            standstill = (tail > tails / 4) | (len(left) > _CROWD)
            resolved = (tail < _DECAYED) | ((tail < plateau) & standstill) | (depth == _DEPTH)
            beyond = outside(g[:, [0, -1]], delta[:, [0, -1]])
            for m in np.flatnonzero(resolved):
                centre = left[m] + width / 2
                here = [x for kind, c in series.items() for x in self._zeros(kind, c[m], centre, width / 2)]
                explained = sum(_step(c) for c in here if abs(c.delta - centre) <= width / 2)
                if depth == _DEPTH or beyond[m, 1] - beyond[m, 0] == explained:
                    found += here
                else:
                    resolved[m] = False
            halve = left[~resolved]
            if not len(halve):
                break
            width /= 2
            left = np.column_stack([halve, halve + width]).reshape(-1)
            tails = np.repeat(tail[~resolved], 2)
        found = [c for c in found if start < c.delta <= end]
        return Search(tuple(_distinct(sorted(found, key=lambda c: c.delta), self.resolution)), float(end))

    def _clear(self, end: float) -> float:
        """``end``, or the last Δ before it at which φ has not outgrown its rounding."""
        while True:
            with np.errstate(over="ignore", invalid="ignore"):
                t, states = self.flow.trajectory(self.entry, end - self.t_d, 64)
                size = self._size(self.exit @ states)
            drowned = np.flatnonzero(~(size <= _DROWNED))
            if not len(drowned):
                return end
            first = int(drowned[0])
            if first > 16 or first == 0:
                return float(self.t_d + t[max(first - 1, 0)])
            end = float(self.t_d + t[first])

    def _size(self, phi: Array) -> Array:
        """Largest entry of φ in balanced coordinates."""
        scale = self.flow.scale[: len(self.exit)]
        return np.asarray(np.abs(phi * (scale / scale[:, None])).max(axis=(-2, -1)))

    def _panels(self, left: Array, width: float) -> tuple[Array, Spectrum, Array]:
        """Nodes, spectra of G and size of φ − I of each panel, shapes (P, nodes), (P, nodes, n + n̂) and (P,)."""
        s = (1 + nodes(_DEGREE)) / 2 * width
        F_s = self.flow.increment(s) @ self.entry
        F_a = self.flow.increment(left - self.t_d)
        F = (self.exit @ F_a @ self.entry + self.jump)[:, None] + (self.exit @ F_a + self.exit)[:, None] @ F_s
        delta = left[:, None] + s
        G = F / np.where(delta == 0, 1.0, delta)[..., None, None]
        if delta[0, 0] == 0:
            G[0, 0] = self.exit @ self.system.A_C @ self.entry
        return delta, np.linalg.eigvals(G).astype(complex), self._size(F).max(axis=1)

    def _spectrum(self, delta: Array) -> Spectrum:
        G = self.exit @ self.flow.increment(delta - self.t_d) @ self.entry + self.jump
        return np.linalg.eigvals(G / delta[:, None, None]).astype(complex)

    def _zeros(self, kind: Kind, c: Array, centre: float, radius: float) -> list[Crossing]:
        """Crossings from the zeros of one interpolant, those close together by zooming in."""
        if abs(c[0]) > np.abs(c[1:]).sum():
            return []
        z = roots(c)
        z = z[(np.abs(z.real) <= 1 + 1e-9) & (np.abs(z.imag) <= _NEAR)]
        z = z[np.argsort(z.real)]
        found = []
        while len(z):
            near = np.flatnonzero(np.diff(z.real) > _NEAR)
            group, z = np.split(z, [near[0] + 1 if len(near) else len(z)])
            middle = centre + radius * group.real.mean()
            if len(group) == 1:
                crossing = self._crossing(kind, middle, tangent=False)
                found += [crossing] if crossing else []
                continue
            reach = radius * 10 * _NEAR
            if reach > self.resolution * 10:
                found += self._zoom(kind, middle, reach)
            else:
                crossing = self._crossing(kind, middle, tangent=len(group) % 2 == 0)
                found += [crossing] if crossing else []
        return found

    def _zoom(self, kind: Kind, centre: float, radius: float) -> list[Crossing]:
        degree = 8
        low = max(centre - radius, self.t_d)
        centre, radius = (low + centre + radius) / 2, (centre + radius - low) / 2
        delta = centre + radius * nodes(degree)
        delta[0] = max(delta[0], delta[1] * 1e-3)
        f = circle_function(kind, self._spectrum(delta), delta)
        return self._zeros(kind, coefficients(degree) @ f, centre, radius)

    def _crossing(self, kind: Kind, delta: float, tangent: bool) -> Crossing | None:
        """The eigenvalue that a zero belongs to, its Δ polished; ``None`` if the zero is no crossing."""
        if delta <= 0 or delta < self.t_d:
            return None
        slope, lam, values = 0.0, 1 + 0j, np.empty(0, complex)
        for step in range(4):
            values, dlam = self._eigenvalue(kind, delta)
            if not len(values):
                return None
            lam = complex(values[0])
            slope = float(np.real(dlam / lam)) if np.isfinite(dlam) else 0.0
            if tangent or slope == 0:
                break
            move = -np.log(abs(lam)) / slope
            # a step that leaves the neighbourhood means a nearly defective eigenvalue; the zero of f stands
            if abs(move) > 1e-3 * delta:
                break
            delta = max(delta + move, self.t_d)
            if abs(move) < 1e-14 * delta or step == 3:
                break
        if abs(np.log(abs(lam))) > _ON or (kind != "complex" and abs(lam - int(kind)) > 1e-3):
            return None
        exact = {"+1": 1.0 + 0j, "-1": -1.0 + 0j, "complex": lam / abs(lam)}[kind]
        exact = complex(exact.real, abs(exact.imag))
        direction: Literal["rising", "falling", "tangent"] = (
            "tangent" if tangent or slope == 0 else "rising" if slope > 0 else "falling"
        )
        others = np.sort(np.abs(values[1:]))
        return Crossing(float(delta), exact, kind, direction, float(others[-1]) if len(others) else 0.0)

    def _eigenvalue(self, kind: Kind, delta: float) -> tuple[Spectrum, complex]:
        """Eigenvalues of φ, the one of this kind nearest to the circle first, and dλ/dΔ of that.

        Of a complex pair the lower one is left out; where there is no complex pair, there are none.
        """
        from scipy.linalg import eig

        F = self.flow.increment(delta - self.t_d)
        G = (self.exit @ F @ self.entry + self.jump) / delta
        g, left, right = eig(G, left=True, right=True)
        if kind == "complex":
            upper = np.flatnonzero(g.imag > 0)
            if not len(upper):
                return np.empty(0, complex), 0j
            i = upper[np.abs(2 * g[upper].real + delta * np.abs(g[upper]) ** 2).argmin()]
        else:
            target = 0.0 if kind == "+1" else -2.0 / delta
            i = int(np.abs(g - target).argmin())
        rest = np.delete(g, i)
        if kind == "complex":
            rest = np.delete(rest, np.abs(rest - g[i].conj()).argmin())
        w, v = left[:, i].conj(), right[:, i]
        rate = self.exit @ (self.system.A_C @ (self.entry + F @ self.entry))
        overlap = w @ v
        dlam = (w @ rate @ v) / overlap if abs(overlap) > 1e-12 else complex("nan")
        return np.asarray(1 + delta * np.concatenate([[g[i]], rest]), complex), complex(dlam)


def _step(crossing: Crossing) -> int:
    sign = {"rising": 1, "falling": -1, "tangent": 0}[crossing.direction]
    return sign * (2 if crossing.kind == "complex" else 1)


def _distinct(found: list[Crossing], resolution: float) -> list[Crossing]:
    """Without those that two neighbouring panels, or a panel and a zoom, both report."""
    kept: list[Crossing] = []
    for c in found:
        same = [
            k
            for k in kept[-8:]
            if k.kind == c.kind
            and abs(k.delta - c.delta) < resolution * (1 if "tangent" in (k.direction, c.direction) else 1e-3)
            and abs(k.eigenvalue - c.eigenvalue) < 1e-6
        ]
        if not same:
            kept.append(c)
    return kept
