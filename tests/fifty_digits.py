"""``python -m tests.fifty_digits --plants 1000 --seed 0`` from the checkout: crossings against a scan with 50 digits.

A loop is a plant of 1 to 12 states under an LQ design: random, of rates that are decades apart, defective, two alike
beside each other, or with a mode that nearly neither grows nor decays; its model is wrong in every entry, or lacks a
lag; the hold is the matched one, that of order zero or another; there is a delay or none, predicted or not. Some have
chains of integrators beside it that the loop drives and nothing reads, and units or coordinates of their own, with
``--far`` such as nobody would take.

The scan knows the loop as docs/theory.md and docs/delay.md state it, by A, B, C, k, L, the hold and the delay, without
the chains, in its first coordinates. Eigenvalues of φ(Δ) outside of the circle are counted on a grid, which is finer
where one comes near the circle; so is the sign of det(φ ∓ I). All their changes must lie within
:data:`CLOSE` of the crossings that :func:`icmj.theory.crossings.search` finds, or of one that is less certain as far
from it as it states, or in a part that it calls unresolved.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import chain, pairwise
from pathlib import Path
from typing import Any

import numpy as np
from scipy.linalg import block_diag, eig, expm

sys.path.insert(0, str(Path(__file__).parent))

from icmj import LinearPlant, error_system
from icmj.controller.delay import Delay
from icmj.controller.design import Design, design_lq
from icmj.controller.hold import Hold, system_matched, zero_order
from icmj.errors import AnalysisError, DesignError
from icmj.theory.crossing import Crossing, Search, change_outside
from icmj.theory.crossings import search

LONGEST = 3.0  # s: end of the range searched, in the first unit of time
CLOSE = 1e-6  # of the range searched: how far a crossing may be from that with 50 digits
GRID, EARLY, ZOOM = 72, 16, 14  # points of the grid, of a geometric one from the start on, and steps of a closer look
NEAR = 0.1  # |λ|² − 1 below which one is looked at more closely
DIGITS = 70  # fifty are left where φ grows by twenty decades
ON = 1e-40  # |λ|² − 1 of an eigenvalue that is on the circle at every Δ
KINDS = ("random", "decades", "defective", "alike", "slow")


@dataclass(frozen=True, eq=False)
class Loop:
    """A loop: what a plant is, what the controller knows, and how it holds and waits."""

    actual: LinearPlant
    design: Design
    hold: Hold
    delay: Delay
    end: float = LONGEST
    words: str = ""

    def crossings(self) -> Search:
        """What icmj finds.

        Raises:
            AnalysisError: if it refuses the loop.
        """
        return search(error_system(self.actual, self.design, self.hold, delay=self.delay), self.end)


def _plant(rng: np.random.Generator, kind: str) -> LinearPlant:
    n, n_u, n_y = min(int(rng.geometric(0.22)), 12), rng.integers(1, 4), rng.integers(1, 4)
    if kind == "alike":
        n = 2 * max(n // 2, 1)
    if kind == "slow":
        n = max(n, 2)
    A, B, C = rng.normal(size=(n, n)), rng.normal(size=(n, n_u)), rng.normal(size=(n_y, n))
    if kind == "decades":
        A *= 10 ** rng.uniform(-3, 3, size=n)[:, None]
    elif kind == "defective":
        A = rng.normal() * np.eye(n) + np.diag(np.ones(n - 1), 1)
    A *= rng.uniform(1, 30) / max(np.linalg.norm(A, 2), 1e-3)
    if rng.uniform() < 0.8:
        A += max(0.3 - np.linalg.eigvals(A).real.max(), 0) * np.eye(n)
    if kind == "alike":
        h = n // 2
        A, B, C = (block_diag(part, part) for part in (A[:h, :h], B[:h, :1], C[:1, :h]))
        if rng.uniform() < 0.5:
            A[h:, :h] = rng.normal(size=(h, h))
    elif kind == "slow":
        decay = -(10 ** rng.uniform(-8, -2)) * rng.choice([-1, 1])
        rate = rng.choice([0.0, rng.uniform(0.5, 10)])
        A[-2:] = 0
        A[-2:, -2:] = [[decay, rate], [-rate, decay]]
    return LinearPlant(A, B, C)


def _wrong(rng: np.random.Generator, kind: str, plant: LinearPlant) -> LinearPlant:
    share = 0.3 * rng.uniform()
    if kind == "alike" and rng.uniform() < 0.7:
        return LinearPlant(plant.A, plant.B * rng.uniform(0.5, 2), plant.C)
    A, B, C = (M * (1 + share * rng.normal(size=M.shape)) for M in (plant.A, plant.B, plant.C))
    n, n_u = B.shape
    if n + n_u <= 12 and rng.uniform() < 0.2:
        fast = 10 ** rng.uniform(0, 2, size=n_u)
        A = np.block([[A, B], [np.zeros((n_u, n)), -np.diag(fast)]])
        B, C = np.vstack([np.zeros((n, n_u)), np.diag(fast)]), np.hstack([C, np.zeros((len(C), n_u))])
    return LinearPlant(A, B, C)


def draw(seed: int) -> Loop:
    """A random loop."""
    rng = np.random.default_rng(seed)
    while True:
        kind = str(rng.choice(KINDS))
        assumed = _plant(rng, kind)
        try:
            design = design_lq(assumed, R_c=10 ** rng.uniform(-3, 0.5), R_o=10 ** rng.uniform(-3, 0.5))
        except DesignError:
            continue
        actual, held = _wrong(rng, kind, assumed), rng.choice(["matched", "zero", "own"])
        hold = zero_order(design) if held == "zero" else system_matched(design)
        if held == "own":
            hold = Hold("own", design.A_c + rng.normal(size=assumed.A.shape))
        t_d = float(rng.choice([0.0, 0.0, 0.1]))
        delay = Delay(t_d, t_d * float(rng.choice([1.0, 1.0, 0.8, 0.0])) if t_d else None)
        return Loop(actual, design, hold, delay, LONGEST, f"{kind}, {held}, {assumed.n} states")


def widen(loop: Loop, rng: np.random.Generator) -> Loop:
    """The same loop beside a chain of integrators, as place and speed are, that it drives and nothing reads."""
    m, known = int(rng.integers(1, 4)), bool(rng.uniform() < 0.7) and loop.hold.name != "zero-order"
    integrators, drives = np.eye(m, k=1), np.zeros((m, loop.actual.n))
    if rng.uniform() < 0.7:
        drives[-1] = rng.normal(size=loop.actual.n)

    def wider(P: LinearPlant) -> LinearPlant:
        A = np.block([[P.A, np.zeros((P.n, m))], [drives[:, : P.n], integrators]])
        named = (*P.states, *"pqr"[:m])
        return LinearPlant(A, np.pad(P.B, ((0, m), (0, 0))), np.pad(P.C, ((0, 0), (0, m))), named, P.inputs, P.outputs)

    design, hold = loop.design, loop.hold
    if known:
        model = wider(design.plant)
        design = Design(model, np.pad(design.k, ((0, 0), (0, m))), np.pad(design.L, ((0, m), (0, 0))))
        held = np.block([[hold.A_h, np.zeros((len(hold.A_h), m))], [model.A[-m:]]])
        hold = system_matched(design) if hold.name == "system-matched" else Hold(hold.name, held)
    words = f"{loop.words}, {m} integrators{' known' * known}{' driven' * bool(drives.any())}"
    return replace(loop, actual=wider(loop.actual), design=design, hold=hold, words=words)


def turn(loop: Loop, rng: np.random.Generator, decades: int) -> Loop:
    """The same loop with states, inputs, outputs and time in units up to so many decades away, or states mixed."""
    n, n_hat, (n_y, n_u) = loop.actual.n, loop.design.plant.n, (loop.actual.n_y, loop.actual.n_u)
    names = (*loop.design.plant.states, *loop.actual.states)
    states = {name: 10.0 ** rng.integers(-decades, decades + 1) for name in names}
    X, X_hat = (np.array([states[name] for name in P.states]) for P in (loop.actual, loop.design.plant))
    U, Y = (10.0 ** rng.integers(-decades, decades + 1, size) for size in (n_u, n_y))
    hour = float(rng.choice([1e-3, 1.0, 60.0, 3600.0]))
    M_hat, M, mixed = np.diag(X_hat), np.diag(X), bool(rng.uniform() < 0.5)
    if mixed:
        one, other = (np.linalg.qr(rng.normal(size=(n, n)))[0] for _ in range(2))
        M = M_hat = one * np.geomspace(1, rng.choice([1, 3, 10]), n) @ other
        U, Y, hour = U**0, Y**0, 1.0
        if n_hat != n:
            one, other = (np.linalg.qr(rng.normal(size=(n_hat, n_hat)))[0] for _ in range(2))
            M_hat = one * np.geomspace(1, rng.choice([1, 3, 10]), n_hat) @ other

    def plant(P: LinearPlant, M: Any) -> LinearPlant:
        A, B = np.linalg.solve(M, P.A @ M) * hour, np.linalg.solve(M, P.B * U) * hour
        return LinearPlant(A, B, P.C @ M / Y[:, None], P.states, P.inputs, P.outputs)

    model = plant(loop.design.plant, M_hat)
    L = np.linalg.solve(M_hat, loop.design.L * Y) * hour
    design = Design(model, loop.design.k @ M_hat / U[:, None], L)
    hold = Hold(loop.hold.name, np.linalg.solve(M_hat, loop.hold.A_h @ M_hat) * hour)
    hold = {"zero-order": zero_order, "system-matched": system_matched}.get(hold.name, lambda _: hold)(design)
    delay = Delay(loop.delay.t_d / hour, loop.delay.predicted / hour if loop.delay else None)
    words = f"{loop.words}, {'mixed' if mixed else f'units of 10^±{decades}'}"
    return Loop(plant(loop.actual, M), design, hold, delay, loop.end / hour, words)


def draw_pair(seed: int, far: bool = False) -> tuple[Loop, Loop, bool]:
    """A random loop, the same as it is given to icmj, and whether that has no further states."""
    rng, first = np.random.default_rng(seed + 10**6), draw(seed)
    given, alike = first, True
    if rng.uniform() < 0.3:
        first, alike = replace(first, delay=Delay()), False
        given = widen(first, rng)
    if rng.uniform() < 0.5:
        given = turn(given, rng, 6 if far else 3)
    return first, given, alike


class Scan:
    """Eigenvalues of φ(Δ) of a loop with 50 digits, or more where φ would lose them."""

    def __init__(self, loop: Loop, digits: int = DIGITS) -> None:
        from flint import arb, arb_mat, ctx

        ctx.dps = digits
        self._arb, self._loop, self._digits = arb, loop, digits

        def exact(M: Any) -> Any:
            return arb_mat([[arb(float(value)) for value in row] for row in np.atleast_2d(M)])

        P, D, t_d, t_hat = loop.actual, loop.design, loop.delay.t_d, loop.delay.predicted
        n, m = P.n, D.plant.n
        A, B, C, A_hat, B_hat, C_hat, k, L = (
            exact(M) for M in (P.A, P.B, P.C, D.plant.A, D.plant.B, D.plant.C, D.k, D.L)
        )
        A_h = A_hat - B_hat * k if loop.hold.name == "system-matched" else exact(loop.hold.A_h)
        zero = arb_mat(n, m), arb_mat(m, n), arb_mat(m, m)
        self.F = _block(((A, zero[0], -(B * k)), (L * C, A_hat - L * C_hat, -(B_hat * k)), (zero[1], zero[2], A_h)))
        one = np.eye(n + m)
        self.t_d, self.size = arb(t_d), n + m
        self.enter = exact(np.vstack([one, one[n:]]))  # x_h := x_o
        if t_d:
            self.size = n + 2 * m
            flown = (self.F * self.t_d).exp()
            ahead = (_block(((A_hat, -(B_hat * k)), (zero[2], A_h))) * arb(t_hat)).exp()
            rows = flown.tolist()[: n + m]
            rows += [[arb(0)] * n + row for row in ahead.tolist()[:m]]
            self.enter = arb_mat(rows)

        self._floats = [
            np.array([[float(x.mid()) for x in row] for row in M.tolist()], float) for M in (self.F, self.enter)
        ]

    def roughly(self, delta: float) -> tuple[np.ndarray, int, int] | None:
        """What :meth:`levels` gives, in floats; ``None`` where an error hundreds of times theirs may change a count.

        e^{FΔ} errs by its rounding times FΔ, and an eigenvalue by the error of the matrix times its condition number.
        """
        (F, enter), t = self._floats, delta - float(self.t_d.mid())
        with np.errstate(all="ignore"):
            flown = expm(F * t)
            phi = (flown @ enter)[: self.size]
            if not np.isfinite(phi).all():
                return None
            values, left, right = eig(phi, left=True, right=True)
            error = 1e-13 * (10 + np.linalg.norm(F, 2) * t) * np.linalg.norm(flown, 2) * np.linalg.norm(enter, 2)
            error = error / np.abs((left.conj() * right).sum(axis=0))
        if not (np.abs(np.abs(values) - 1) > error).all():
            return None
        real = values.real[values.imag == 0]
        return np.abs(values) ** 2 - 1, int((real > 1).sum() % 2), int((real < -1).sum() % 2)

    def levels(self, delta: float) -> tuple[np.ndarray, int, int]:
        """|λ|² − 1 of each eigenvalue of φ(Δ), and whether an odd number is beyond +1, and beyond −1."""
        from flint import acb_mat, arb_mat, ctx

        ctx.dps = self._digits
        flown = ((self.F * (self._arb(delta) - self.t_d)).exp() * self.enter).tolist()[: self.size]
        if max(float(entry.rad()) for row in flown for entry in row) > ON:
            return Scan(self._loop, 2 * self._digits).levels(delta)
        values = acb_mat(arb_mat(flown)).eig(algorithm="approx", maxiter=10000)
        level = np.array([float((z.real * z.real + z.imag * z.imag - 1).mid()) for z in values])
        odd = []
        for side in (-1, 1):
            product = self._arb(1)
            for z, h in zip(values, level, strict=True):
                away = side * z - self._arb(1)
                real = z.imag.abs_upper() < self._arb(1e-30) * (1 + z.real.abs_upper())
                if abs(h) > ON and real:
                    product *= -1 if away.real.mid() > 0 else 1
            odd.append(int(product.mid() < 0))
        return level, odd[1], odd[0]


def _block(rows: Any) -> Any:
    from flint import arb_mat

    return arb_mat([list(chain(*(part.tolist()[i] for part in row))) for row in rows for i in range(row[0].nrows())])


@dataclass(frozen=True)
class Count:
    """What is outside of the circle at some Δ: how many, and whether an odd number beyond +1, and −1."""

    outside: int
    beyond_plus: int
    beyond_minus: int
    nearest: float

    @classmethod
    def at(cls, scan: Scan, delta: float) -> Count:
        level, plus, minus = scan.roughly(delta) or scan.levels(delta)
        here = level[np.abs(level) > ON]
        return cls(int((here > 0).sum()), plus, minus, float(np.abs(here).min(initial=np.inf)))


def windows(crossings: tuple[Crossing, ...], reach: float) -> Iterator[tuple[float, float, list[Crossing]]]:
    """Stretches around crossings, as wide as each is uncertain or ``reach``; those that overlap as one."""
    first = last = 0.0
    group: list[Crossing] = []
    for crossing in crossings:
        far = max(reach, crossing.uncertainty)
        if group and crossing.delta - far > last:
            yield first, last, group
            group = []
        first = min(first, crossing.delta - far) if group else crossing.delta - far
        last = max(last, crossing.delta + far) if group else crossing.delta + far
        group.append(crossing)
    if group:
        yield first, last, group


def differences(found: Search, scan: Scan, end: float, reach: float = CLOSE) -> list[str]:
    """Where the crossings found are not those of the scan, outside of what is called unresolved."""
    start = max(float(scan.t_d.mid()), 0.0)
    last = found.delta_end
    width = reach * end
    if last <= start * (1 + CLOSE):
        return []
    taken = list(windows(found.crossings, width))
    first = start + 1e-6 * (last - start)
    if taken and taken[0][0] < first:
        first = start + (taken[0][0] - start) / 2 if taken[0][0] > start else taken[0][1]
    edges = [edge for a, b, _ in taken for edge in (a, b)]
    grid = [*np.linspace(first, last, GRID + 1), *(start + np.geomspace(first - start, last - start, EARLY)), *edges]
    points = sorted({float(x) for x in grid if first <= x <= last and not any(a < x < b for a, b, _ in taken)})
    counts = {x: Count.at(scan, x) for x in points}
    # where one comes near the circle between points, it may pass it and be back
    for a, b, c in zip(points, points[1:], points[2:], strict=False):
        if NEAR > counts[b].nearest < min(counts[a].nearest, counts[c].nearest):
            low, middle, high = a, b, c
            for _ in range(ZOOM):
                x = middle + 0.382 * ((high if high - middle > middle - low else low) - middle)
                if any(p < x < q for p, q, _ in taken):
                    break
                counts[x] = Count.at(scan, x)
                if counts[x].nearest < counts[middle].nearest:
                    low, middle, high = (low, x, middle) if x < middle else (middle, x, high)
                else:
                    low, high = (x, high) if x < middle else (low, x)
    words = []
    points = sorted(counts)
    for a, b in pairwise(points):
        inside = [c for p, q, group in taken if a <= p and q <= b for c in group]
        here, there = counts[a], counts[b]
        step = sum(change_outside(c) for c in inside)
        real = [c for c in inside if c.direction != "tangent"]
        flips = [sum(c.multiplicity for c in real if c.kind == kind) for kind in ("+1", "-1")]
        odd = [here.beyond_plus ^ there.beyond_plus, here.beyond_minus ^ there.beyond_minus]
        if there.outside - here.outside == step and odd == [flip % 2 for flip in flips]:
            continue
        if any(p - width <= b and a <= q + width for p, q in found.unresolved):
            continue
        what = ", ".join(f"{c.kind} {c.direction} ×{c.multiplicity} at {c.delta:.9g}" for c in inside) or "nothing"
        words.append(
            f"{a:.9g} to {b:.9g}: {there.outside - here.outside:+d} outside, odd ±1 {odd}; found {what} ({step:+d})"
        )
    return words


def check(seed: int, far: bool) -> tuple[str, list[str], str]:
    """Whether crossings are those of the scan, where they are not, and what was drawn.

    They are the ``same``, ``unresolved`` where icmj says so, or ``refused``; otherwise ``rounded`` if they are those of
    the scan in the same coordinates, ``near`` if within a hundred times :data:`CLOSE`, or ``wrong``.
    """
    first, given, alike = draw_pair(seed, far)
    words = f"seed {seed}: {given.words}, delay {given.delay}"
    try:
        found = given.crossings()
    except AnalysisError as error:
        return "refused", [str(error)], words
    hour = first.end / given.end
    here = replace(
        found,
        crossings=tuple(replace(c, delta=c.delta * hour, uncertainty=c.uncertainty * hour) for c in found.crossings),
        delta_end=found.delta_end * hour,
        unresolved=tuple((p * hour, q * hour) for p, q in found.unresolved),
    )
    differ = differences(here, Scan(first), first.end)
    if not differ:
        return ("unresolved" if found.unresolved else "same"), [f"{here.unresolved}"], words
    if given is not first and alike:
        there = differences(found, Scan(given), given.end)
        if not there:
            return "rounded", differ, words
    return ("near" if not differences(here, Scan(first), first.end, 1e-4) else "wrong"), differ, words


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--plants", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0, help="of the first plant")
    parser.add_argument("--far", action="store_true", help="units of up to six decades, not three")
    given = parser.parse_args()
    tally: Counter[str] = Counter()
    begin = time.monotonic()
    for seed in range(given.seed, given.seed + given.plants):
        kind, differ, words = check(seed, given.far)
        tally[kind] += 1
        if kind != "same":
            print(f"{kind}: {words}", *differ, sep="\n    ", flush=True)
    print(dict(tally), f"{time.monotonic() - begin:.0f} s")
    return 1 if tally["wrong"] else 0


if __name__ == "__main__":
    sys.exit(main())
