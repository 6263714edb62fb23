"""Every Δ at which an eigenvalue of φ(Δ) crosses or touches the unit circle, with none lost between grid points.

Eigenvalues are not smooth where they meet, and all of them start together at φ(0) = I. So the search is for the
real zeros of three functions that are analytic in Δ, also there and at Δ = 0: with G(Δ) = (φ(Δ) − I)/Δ, as Δ → 0 the
matrix of the continuous controller (plant and observer), and its eigenvalues g, that is λ = 1 + Δg,

    f₊ = ∏ g_i                              zero where λ = +1
    f₋ = ∏ (2 + Δ g_i)                      zero where λ = −1
    f_c = ∏_{i<j} (g_i + g_j + Δ g_i g_j)   zero where λ_i λ_j = 1, so for a complex pair on the circle

The functions are made of the eigenvalues that come near the circle (:mod:`icmj.theory.circle`), represented by
Chebyshev interpolants on panels, halved until the coefficients have decayed; all their zeros on a panel follow from a
colleague matrix. Zeros close together are zoomed into until they separate. Then the crossings found must explain the
change in the number of eigenvalues outside the circle over each panel, or the panel is halved again. What the shortest
panels leave unexplained, or rounding decides, is searched again with φ in long arithmetic
(:mod:`icmj.theory.long_arithmetic`), and what remains is part of the result.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from icmj.base.array import Array
from icmj.errors import AnalysisError
from icmj.theory.chebyshev import find_roots, make_coefficient_matrix, make_nodes
from icmj.theory.circle import (
    DEGREE,
    KINDS,
    count_outside,
    evaluate_circle_function,
    expand_near,
    find_near,
    is_quiet,
    measure_height,
    measure_tail,
    merge_repeated,
)
from icmj.theory.crossing import Crossing, Direction, Kind, Search, change_outside, select_distinct
from icmj.theory.error_system import ErrorSystem
from icmj.theory.flow import Flow, make_flow
from icmj.theory.reduction import Reduction, reduce_system
from icmj.theory.spectra import EigenvalueBranch, Spectra

_PANELS = 8
_DEPTH = 14
_DECAYED = 1e-10  # last Chebyshev coefficients, relative to the largest
_PLATEAU = 1e-6  # above _DECAYED they may stay below this (or 1e4 ε‖φ‖) where halving does not lower them
# from this depth on such a standstill is taken for rounding whatever its level below 1e-2
_NOISY = 5
# so many panels of one width are not all needed by zeros: what keeps them from decaying is rounding
_CROWD = 128
_ON = 1e-6  # |log|λ|| up to which an eigenvalue at a zero counts as on the circle
_ON_AT_MOST = 1e-3  # the same where rounding moves it as far
_RESOLUTION = 1e-6  # in the search's own unit of time
_NEAR = 2e-3  # zeros this close to each other or to the real axis, in half-panels, are zoomed into
# With ‖φ‖ beyond this, eigenvalues at the circle are known to no better than about 1e-6
DROWNED = 1e8
_ERROR = 1e-15  # relative: what rounding may make of an entry
_EXACT = 1000 * _ERROR  # the same of what a reduction neglects: rounding that a matrix of some dozens of states gathers
# heights above the circle that are zero to rounding, that may become so, and by which no rounding is to move these
_CLOSE, _NEARBY, _BLURRED = 1e-8, 0.3, 1e-2
_MARGIN = 10  # times as far as one error of this size moves a crossing, others may
_KNOWN = 1e-3  # the search's own unit of time: a crossing that rounding moves by less is found
# panels that a search may take: no plant known needs a fifth of it, and small ones are through them in seconds
_MOST_PANELS = 2000


def check_range(system: ErrorSystem, delta_max: float, delta_start: float = 0.0) -> None:
    """Refuse a range without an interval in it, before anything is computed at its ends.

    Raises:
        AnalysisError: if ``0 ≤ delta_start < delta_max`` does not hold, or the delay is as long.
    """
    if not (np.isfinite(delta_max) and 0 <= delta_start < delta_max):
        raise AnalysisError(f"crossings need 0 ≤ start < end, got {delta_start} and {delta_max} s")
    if delta_max <= system.delay.t_d:
        raise AnalysisError(f"no interval is shorter than the delay, {system.delay.t_d:g} s; search further than that")


def search(
    system: ErrorSystem,
    delta_max: float,
    *,
    delta_start: float = 0.0,
    resolution: float | None = None,
    prepared: Flow | None = None,
    reduced: Reduction | None = None,
    progress: Callable[[float], None] | None = None,
) -> Search:
    """All unit-circle crossings of φ(Δ) for ``delta_start`` < Δ ≤ ``delta_max``, by rising Δ.

    With them comes the range of Δ in which eigenvalues exceed rounding errors.

    Args:
        system: the error system.
        delta_max: end of the search [s].
        delta_start: start of the search [s]; the departure from φ(0) = I is never a crossing.
        resolution: two crossings of one kind further apart are told apart [s]; closer ones, and a branch that comes so
            near to the circle that its crossings would be, are one ``tangent``. If ``None``, some 3e-7 of
            ``delta_max``.
        prepared: the flow of ``system``, if at hand.
        reduced: the system without its neutral directions, if at hand.
        progress: called repeatedly with the completed fraction, 0–1.

    Raises:
        AnalysisError: if the interval is empty or not finite, the resolution is not positive, or the system is beyond
            what can be analysed.
    """
    check_range(system, delta_max, delta_start)
    if resolution is not None and not resolution > 0:
        raise AnalysisError(f"the resolution must be positive, got {resolution} s")
    if reduced is None:
        prepared = prepared or make_flow(system.A_C)
        prepared.demand(delta_max)
        reduced = reduce_system(system, prepared)
    if not len(reduced.left):
        return Search((), delta_max)
    # bounds hold of a plant in any unit of time, and a power of two changes no digit
    unit = 2.0 ** round(np.log2(delta_max / 3))
    fine = _RESOLUTION * unit if resolution is None else resolution
    finder = _Finder(reduced, fine, unit, progress or (lambda _: None))
    found = finder.run(max(delta_start, finder.t_d), _find_end(reduced, delta_max))
    if not found.unresolved:
        return found
    finder = _Finder(reduced, fine, unit, finder.progress, long=True)
    return finder.repeat(found)


def _find_end(reduced: Reduction, end: float) -> float:
    """``end``, or the last Δ before it at which φ has not outgrown its rounding."""
    first_end = end
    while True:
        delta, phi = reduced.sample(end, 64)
        drowned = np.flatnonzero(~(np.abs(phi).max(axis=(1, 2)) <= DROWNED))
        if not len(drowned):
            return end
        first = int(drowned[0])
        if first > 16 or (first == 0 and reduced.t_d):
            return float(delta[max(first - 1, 0)])
        end = float(delta[first])
        if end < 1e-9 * first_end:
            raise AnalysisError(
                f"not analysable: φ(Δ) grows beyond {DROWNED:.0e} within {end:.1e} s, of {first_end:.4g} s to "
                "search; look for gains or rates that are out of proportion"
            )


class _Finder:
    """The search on one system: panels, zeros, crossings."""

    def __init__(
        self,
        reduced: Reduction,
        resolution: float,
        unit: float,
        progress: Callable[[float], None],
        long: bool = False,
    ) -> None:
        self.resolution, self.unit, self.progress = resolution, unit, progress
        self.spectra, self.other = Spectra(reduced, long=long), Spectra(reduced, _ERROR, long=long)
        # what was taken out is slow and mixes with what is beside +1, unless it was taken out exactly
        beside = Spectra(reduced, reduced.neglected, long=long) if reduced.neglected > _EXACT else self.other
        self.others: dict[Kind, Spectra] = {"+1": beside, "-1": self.other, "complex": self.other}
        self.t_d = reduced.t_d

    def run(self, start: float, end: float) -> Search:
        if end <= start:
            return Search((), end)
        width = (end - start) / _PANELS
        left: Array = np.asarray(start + width * np.arange(_PANELS), dtype=float)
        tails = np.full(_PANELS, np.inf)
        found: list[Crossing] = []
        unexplained: list[tuple[float, float, int]] = []
        edges: list[tuple[float, float, int]] = []
        blind: list[tuple[float, float, int]] = []  # where eigenvalues cannot be followed
        taken = 0
        for depth in range(_DEPTH + 1):
            taken += len(left)
            if taken > _MOST_PANELS and 2 * len(left) * width < end - start:
                blind = [(float(a), float(a + width), 1) for a in left]
                break
            if taken > _MOST_PANELS:
                raise AnalysisError(
                    f"not analysable: the eigenvalues of φ(Δ) up to {end:.4g} s move too wildly to be followed; "
                    "search a shorter range, or look for gains or rates that are out of proportion"
                )
            delta, g, size = self.spectra.panels(left, (1 + make_nodes(DEGREE)) / 2 * width)
            delta, g = delta / self.unit, g * self.unit
            plateau = np.maximum(_PLATEAU, 1e4 * np.finfo(float).eps * size) if depth < _NOISY else 1e-2
            sets = find_near(g, delta)
            parts = [expand_near(g[m, :, a:b], delta[m]) for m, (a, b) in enumerate(sets)]
            decay = np.array([max((measure_tail(c) for c in s.values()), default=0.0) for s in parts])
            standstill = (decay > tails / 4) | (len(left) > _CROWD)
            resolved = (decay < _DECAYED) | ((decay < plateau) & standstill) | (depth == _DEPTH)
            if depth < _DEPTH and len(left) <= _CROWD:
                for m in np.flatnonzero(resolved):
                    a, b = sets[m]
                    resolved[m] = is_quiet(g[m, :, :a], delta[m]) and is_quiet(g[m, :, b:], delta[m])
            beyond = count_outside(g[:, [0, -1]], delta[:, [0, -1]])
            for m in np.flatnonzero(resolved):
                change, centre = int(beyond[m, 1] - beyond[m, 0]), left[m] + width / 2
                here, explained = self._find(parts[m], centre, width / 2, sets[m])
                if depth == _DEPTH or explained == change:
                    found += here
                    for edge, count in ((left[m], beyond[m, 0]), (left[m] + width, -beyond[m, 1])):
                        edges.append((float(edge), float(edge), int(count)))
                    if explained != change:
                        unexplained.append((float(left[m]), float(left[m] + width), change - explained))
                else:
                    resolved[m] = False
            halve = left[~resolved]
            self.progress(1 - len(halve) * width / (_PANELS * width * 2**depth) if len(halve) else 1.0)
            if not len(halve):
                break
            width /= 2
            left = np.column_stack([halve, halve + width]).reshape(-1)
            tails = np.repeat(decay[~resolved], 2)
        # by rounding two panels may disagree on the number outside where they meet, and in places again and again
        inner = [edge for edge in edges if start < edge[0] - width / 2 < end - width]
        unexplained += _join(_join(inner), (end - start) / _CROWD)
        found = [c for c in found if start < c.delta <= end]
        apart = [
            self._with_uncertainty(c) for c in select_distinct(sorted(found, key=lambda c: c.delta), self.resolution)
        ]
        # one that is alone is there, wherever in its range; two that may meet may as well never have come
        moved = [c for c in apart if c.uncertainty]
        known = [c.range for c in moved if c.uncertainty < _KNOWN * self.unit and not _meets(c, apart)]
        blind += self._doubtful(np.array([edge for edge, _, _ in edges]).reshape(-1, 2))
        blind = [part for part in blind if not any(a <= part[0] and part[1] <= b for a, b in known)]
        blurred = bool(blind)
        blind += [(first, last, 1) for first, last, _ in _join(unexplained)]
        doubted = _join(blind, (end - start) / _PANELS if blurred else 0.0)
        wider = [(first - self._moved(first), last + self._moved(last)) for first, last, _ in doubted]
        wider += [c.range for c in moved if c.range not in known]
        unresolved = _join([(max(first, start), min(last, end), 1) for first, last in wider])
        return Search(tuple(apart), float(end), tuple((float(first), float(last)) for first, last, _ in unresolved))

    def repeat(self, found: Search) -> Search:
        """The search again, where it left crossings unresolved."""
        crossings, unresolved = list(found.crossings), list[tuple[float, float]]()
        for first, last in found.unresolved:
            if last - first < _KNOWN * self.unit:  # two panels disagree where they meet
                first, last = max(first - _KNOWN * self.unit, self.t_d), min(last + _KNOWN * self.unit, found.delta_end)
            try:
                here = self.run(first, last)
            except AnalysisError:  # they move too wildly still
                unresolved.append((first, last))
                continue
            crossings = [c for c in crossings if not first < c.delta <= last] + list(here.crossings)
            unresolved += here.unresolved
        return Search(tuple(sorted(crossings, key=lambda c: c.delta)), found.delta_end, tuple(unresolved))

    def _with_uncertainty(self, c: Crossing) -> Crossing:
        moved = 0.0 if c.direction == "tangent" else self._moved(c.delta, c.kind)
        return replace(c, uncertainty=float(moved)) if moved > _MARGIN * _RESOLUTION * self.unit else c

    def _doubtful(self, panels: Array) -> list[tuple[float, float, int]]:
        """Those panels (first and last Δ, shape (P, 2)) at whose ends or middle rounding decides what is outside."""
        delta = np.column_stack([panels, panels.mean(axis=1)]).reshape(-1)
        delta = np.maximum(delta, 1e-12 * panels.max(initial=0.0))
        one, other = (measure_height(of.at(delta) * self.unit, delta / self.unit) for of in (self.spectra, self.other))
        nearest = np.minimum(np.abs(one), np.abs(other))
        passed = (one * other < 0) & (nearest > _CLOSE)
        blurred = (nearest < _NEARBY) & (np.abs(one - other) > _BLURRED)
        doubtful = np.any((passed | blurred).any(axis=1).reshape(-1, 3), axis=1)
        if 2 * doubtful.sum() > len(panels):  # elsewhere, too, what agrees does so by chance
            doubtful[:] = True
        return [(float(first), float(last), 1) for first, last in panels[doubtful]]

    def _blur(self, kind: Kind, delta: float, level: float) -> float:
        """How far rounding moves log|λ| = ``level`` of the eigenvalue of this kind at ``delta``."""
        there = self.others[kind].branch(kind, delta)
        return abs(float(np.log(abs(there.value))) - level) if there is not None and there.value else 0.0

    def _moved(self, delta: float, *kinds: Kind) -> float:
        """How far rounding may move a crossing near ``delta``, of these kinds or of any [s]; 0 if there is none."""
        farthest = 0.0
        for kind in (kinds or KINDS) if delta > self.t_d else ():
            here, there = (of.branch(kind, delta) for of in (self.spectra, self.others[kind]))
            if here is None or there is None or not here.value or not there.value:
                continue
            level, slope = np.log(abs(here.value)), float(np.abs(here.rates.mean()))
            off = abs(np.log(abs(there.value)) - level)
            if abs(level) < max(_ON_AT_MOST, off) and slope > 0:
                farthest = max(farthest, _MARGIN * (off + (0.0 if kinds else abs(level))) / slope)
        return min(farthest, self.unit / _PANELS)  # farther, a slope tells nothing

    def _find(
        self, functions: dict[Kind, Array], centre: float, radius: float, near_set: NDArray[np.intp]
    ) -> tuple[list[Crossing], int]:
        """Crossings on one panel, and the change of the number of eigenvalues outside that they explain."""
        set_ = (int(near_set[0]), int(near_set[1]))
        here = [x for kind, c in functions.items() for x in self._zeros(kind, c, centre, radius, set_)]
        here = select_distinct(sorted(here, key=lambda c: c.delta), self.resolution)
        return here, sum(change_outside(c) for c in here if abs(c.delta - centre) <= radius)

    def _zeros(self, kind: Kind, c: Array, centre: float, radius: float, near_set: tuple[int, int]) -> list[Crossing]:
        """Crossings from the zeros of one interpolant, those close together by zooming in."""
        if abs(c[0]) > np.abs(c[1:]).sum():
            return []
        z = find_roots(c)
        z = z[(np.abs(z.real) <= 1 + 1e-9) & (np.abs(z.imag) <= _NEAR)]
        z = z[np.argsort(z.real)]
        found = []
        while len(z):
            apart = np.flatnonzero(np.diff(z.real) > _NEAR)
            group, z = np.split(z, [apart[0] + 1 if len(apart) else len(z)])
            middle = centre + radius * group.real.mean()
            if len(group) == 1:
                found += self._crossing(kind, middle, tangent=False)
                continue
            reach = radius * 10 * _NEAR
            together = self._crossing(kind, middle, tangent=False, at_least=2)
            if together:
                found += together
            elif reach > self.resolution * 10:
                found += self._zoom(kind, middle, reach, near_set)
            else:
                found += self._crossing(kind, middle, tangent=len(group) % 2 == 0)
        return found

    def _zoom(self, kind: Kind, centre: float, radius: float, near_set: tuple[int, int]) -> list[Crossing]:
        degree = 8
        low = max(centre - radius, self.t_d)
        centre, radius = (low + centre + radius) / 2, (centre + radius - low) / 2
        delta = centre + radius * make_nodes(degree)
        delta[0] = max(delta[0], delta[1] * 1e-3)
        g = merge_repeated(self.spectra.at(delta)[:, slice(*near_set)] * self.unit)
        f = evaluate_circle_function(kind, g, delta / self.unit)
        return self._zeros(kind, make_coefficient_matrix(degree) @ f, centre, radius, near_set)

    def _crossing(self, kind: Kind, delta: float, *, tangent: bool, at_least: int = 1) -> list[Crossing]:
        """The eigenvalue that a zero belongs to, its Δ polished; none if the zero is no crossing.

        Several where ``at_least`` equal eigenvalues are at the zero together but do not all go the same way.
        """
        if delta <= 0 or delta < self.t_d:
            return []
        slope, at = 0.0, None
        for step in range(4):
            at = self.spectra.branch(kind, delta)
            if at is None or at.count < at_least:
                return []
            mean = float(at.rates.mean())
            slope = mean if np.isfinite(mean) else 0.0
            if tangent or slope == 0:
                break
            move = -np.log(abs(at.value)) / slope
            # a step that leaves the neighbourhood means a nearly defective eigenvalue; the zero of f stands
            if abs(move) > 1e-3 * delta:
                break
            delta = max(delta + move, self.t_d)
            if abs(move) < 1e-14 * delta or step == 3:
                break
        assert at is not None
        if not at.value or (kind != "complex" and abs(at.value - int(kind)) > 1e-3):
            return []
        level = float(np.log(abs(at.value)))
        # beside +1, where every slow eigenvalue is at first, a pair is on the circle only by its distance from there
        bound = _ON * (min(1.0, abs(at.value - 1)) if kind == "complex" else 1.0)
        if abs(level) > bound and (abs(level) > _ON_AT_MOST or abs(level) > _MARGIN * self._blur(kind, delta, level)):
            return []
        lam = {"+1": 1.0 + 0j, "-1": -1.0 + 0j, "complex": at.value / abs(at.value)}[kind]
        lam = complex(lam.real, abs(lam.imag))
        ways = self._ways(kind, delta, at, tangent or slope == 0)
        return [
            Crossing(float(delta), lam, kind, way, at.largest_other, count, at.dimension if len(ways) == 1 else count)
            for way, count in ways.items()
        ]

    def _ways(self, kind: Kind, delta: float, at: EigenvalueBranch, tangent: bool) -> dict[Direction, int]:
        """Number of eigenvalues at a crossing that leave and that enter the circle."""
        if at.count == 1 or np.isfinite(at.rates).all():
            if tangent:
                return {"tangent": at.count}
            rising = int((at.rates > 0).sum())
            return {way: n for way, n in (("rising", rising), ("falling", at.count - rising)) if n}  # type: ignore[misc]
        # defective: the rates are unknown, but on either side the eigenvalues can be counted
        reach = 1e-4 * delta
        before, after = self.spectra.at(np.maximum(delta + reach * np.array([-1.0, 1.0]), self.t_d))
        step = 0
        for sign, g, d in ((-1, before, delta - reach), (1, after, delta + reach)):
            lam = 1 + d * g
            close = np.abs(lam[lam.imag > 1e-6] if kind == "complex" else lam)[
                np.argsort(np.abs((lam[lam.imag > 1e-6] if kind == "complex" else lam) - at.value))[: at.count]
            ]
            step += sign * int((close > 1).sum())
        return {"rising" if step > 0 else "falling": abs(step)} if step else {"tangent": at.count}


def _meets(one: Crossing, crossings: list[Crossing]) -> bool:
    """Whether one may be where another is."""
    first, last = one.range
    return any(c.range[0] <= last and first <= c.range[1] for c in crossings if c is not one)


def _join(parts: list[tuple[float, float, int]], apart: float = 0.0) -> list[tuple[float, float, int]]:
    """Parts (first, last, count unexplained) that touch, or are so far apart, as one, but those whose counts cancel.

    An eigenvalue that is on the circle to rounding where two panels meet is one too many in one, and one too few in the
    other.
    """
    joined: list[tuple[float, float, int]] = []
    for first, last, count in sorted(parts):
        if joined and first <= joined[-1][1] * (1 + 1e-12) + apart:
            begin, until, before = joined.pop()
            first, last, count = begin, max(until, last), before + count
        joined.append((first, last, count))
    return [part for part in joined if part[2]]
