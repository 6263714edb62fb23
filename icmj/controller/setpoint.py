"""The set-point r(t): the target of the plant, its steady state, and its course over time.

A controller regulates x − x_ss r with u − u_ss r, where the *assumed* plant is at rest in x_ss r under u_ss r. It is
the same controller for a larger model, whose state is (x, r): r is known, and the controller cannot change it.
Observer, hold, event rule, delay and predictor are therefore unchanged, and x_h := x_o also samples the set-point;
until then a new set-point is a prediction error. The given signal ṙ(t) moves r: it consists of sinusoids and constants
in windows, and of impulses where r jumps.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from icmj.base.array import Array, at_or_after, count_steps
from icmj.base.balancing import choose_units
from icmj.controller.design import Design
from icmj.controller.hold import Hold
from icmj.controller.trigger import Faces
from icmj.errors import AnalysisError
from icmj.plant.linear_plant import LinearPlant, expect_linear

_REST = 1e-9  # relative: what a steady state may miss, by rounding of its equations
_REGISTER, _TAPS = (2, 0, 2, 0, 2), (0, 0, 1, -1, -1)
TERNARY_INTERVALS = 3 ** len(_REGISTER) - 1
"""Intervals of a pseudo-random ternary sequence before it repeats."""


@dataclass(frozen=True, eq=False)
class Setpoint:
    """A set-point of R channels and its steady states.

    Attributes:
        names, units: names and units of its channels.
        x_ss, u_ss: state and command at which the assumed plant is at rest for r = 1, shapes (n̂, R) and (n_u, R).
        terms: terms of ṙ(t): channel, amplitude a, ω [rad/s], φ, start and end [s] of a cos(ωt + φ), shape (M, 6); a
            term that ends when it starts is a jump of r by a.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    x_ss: Array
    u_ss: Array
    terms: Array

    def __call__(self, t: ArrayLike) -> Array:
        """r(t), shape (..., R) for ``t`` of shape (...); where it jumps the value from there on."""
        t = np.asarray(t, dtype=float)
        r = np.zeros((*t.shape, len(self.names)))
        for channel, a, omega, phi, start, end in self.terms:
            lasted = np.clip(t, start, end) - start
            if start == end:
                gone = a * at_or_after(t, start)
            elif omega == 0:
                gone = a * np.cos(phi) * lasted
            else:
                gone = a / omega * (np.sin(omega * (start + lasted) + phi) - np.sin(omega * start + phi))
            r[..., int(channel)] += gone
        return r

    @property
    def edges(self) -> Array:
        """Times at which r or its rate jumps, increasing, positive and finite [s]."""
        times = np.unique(self.terms[:, 4:])
        return times[np.isfinite(times) & (times > 0)]

    def gain(self, k: Array) -> Array:
        """k_r of u = −k x + k_r r, shape (n_u, R)."""
        return np.asarray(k @ self.x_ss + self.u_ss)

    def model(self, design: Design, hold: Hold) -> tuple[Design, Hold]:
        """Design and hold of the larger model (x, r)."""
        plant, n, R = design.plant, design.plant.n, len(self.names)
        own = design.A_c - hold.A_h  # zero, to the bit, where the hold is the model
        wide, A = (0, R), np.zeros((n + R, n + R))
        A[:n, :n] = plant.A
        larger = replace(
            plant,
            A=A,
            B=np.pad(plant.B, (wide, (0, 0))),
            C=np.pad(plant.C, ((0, 0), wide)),
            B_d=np.pad(plant.B_d, (wide, (0, 0))),
            states=(*plant.states, *(f"r.{name}" for name in self.names)),
            state_units=(*plant.state_units, *self.units),
            pushes={},
        )
        of = Design(larger, np.hstack([design.k, -self.gain(design.k)]), np.pad(design.L, (wide, (0, 0))))
        A_h = of.A_c
        A_h[:n] -= np.hstack([own, -own @ self.x_ss])
        return of, Hold(hold.name, A_h)

    def faces(self, faces: Faces) -> Faces:
        """Faces for a difference of states (x, r), from those for a difference of states x."""
        return replace(faces, R=np.hstack([faces.R, -faces.R @ self.x_ss]))


@dataclass(frozen=True, eq=False)
class Target:
    """One channel of a set-point, or a part of it: parts with the same name and combination are added.

    Attributes:
        combination: outputs or states of the assumed plant, by name, with their weights; the channel is a target for
            their sum.
        terms: terms of its ṙ(t), from ``step``, ``pulse``, ``ramp``, ``sines`` or ``ternary``; shape (M, 5).
        name: name of the channel; if empty, that of the single output or state.
        unit: unit of the channel; if empty, that of the single output or state.
    """

    combination: Mapping[str, float]
    terms: Array
    name: str = ""
    unit: str = field(default="", kw_only=True)


def setpoint(plant: LinearPlant, targets: Sequence[Target]) -> Setpoint | None:
    """The set-point of these targets for a controller that assumes ``plant``; ``None`` if there are no targets.

    If there are several steady states, the one with the smallest command is used and, among these, the one with the
    smallest state.

    Raises:
        AnalysisError: if the plant is not linear, if a target names something that is neither an output nor a state of
            it, if two targets with the same name differ in their combination, or if the plant has no such steady state:
            it cannot rest there, or there are too many set-points.
    """
    expect_linear(plant, "the assumed plant")
    if not targets:
        return None
    rows: dict[str, Array] = {}
    units: dict[str, str] = {}
    terms = []
    for target in targets:
        row, unit, name = _row(plant, target)
        if name in rows and not np.array_equal(rows[name], row):
            raise AnalysisError(
                f"set-point {name!r} is given twice, with different combinations; give them different names"
            )
        rows[name], units[name] = row, unit or units.get(name, "")
        part = np.asarray(target.terms, dtype=float).reshape(-1, 5)
        if not (np.isfinite(part[:, :4]).all() and (part[:, 3] >= 0).all() and (part[:, 4] >= part[:, 3]).all()):
            raise AnalysisError(f"set-point {name!r}: its numbers must be finite, and its times not negative")
        terms.append(np.column_stack([np.full(len(part), list(rows).index(name)), part]))
    x_ss, u_ss = _steady_states(plant, rows)
    found = np.concatenate(terms)
    return Setpoint(tuple(rows), tuple(units.values()), x_ss, u_ss, found[np.lexsort((found[:, 5], found[:, 4]))])


def step(size: float, start: float = 0.0) -> Array:
    """r jumps by ``size`` at ``start`` [s]; at 0 it is there from the beginning."""
    return np.array([[size, 0.0, 0.0, start, start]])


def pulse(size: float, start: float, duration: float) -> Array:
    """r is larger by ``size`` from ``start`` on, for ``duration`` [s]."""
    return np.concatenate([step(size, start), step(-size, start + duration)])


def ramp(size: float, start: float, duration: float) -> Array:
    """r rises evenly by ``size`` from ``start`` on, over ``duration`` [s]."""
    return np.array([[size / duration, 0.0, 0.0, start, start + duration]])


def polygon(times: ArrayLike, values: ArrayLike) -> Array:
    """r = 0 before the first of ``times`` [s], linear between them, constant after the last; both shape (N,)."""
    t, r = np.atleast_1d(np.asarray(times, float)), np.atleast_1d(np.asarray(values, float))
    slopes = np.diff(r) / np.diff(t)
    none = np.zeros(len(slopes))
    pieces = np.column_stack([slopes, none, none, t[:-1], t[1:]])
    return np.concatenate([step(float(r[0]), float(t[0])), pieces[slopes != 0]])


def sines(sizes: ArrayLike, frequencies: ArrayLike, phases: ArrayLike, start: float = 0.0) -> Array:
    """r = Σ a sin(2π f (t − start) + φ) from ``start`` on, of frequencies [Hz] and phases [rad]."""
    f, phi = np.atleast_1d(np.asarray(frequencies, float)), np.atleast_1d(np.asarray(phases, float))
    a, omega = np.broadcast_to(np.asarray(sizes, float), f.shape), 2 * np.pi * f
    moving = np.column_stack([a * omega, omega, phi - omega * start, np.full(len(f), start), np.full(len(f), np.inf)])
    return np.concatenate([step(float(a @ np.sin(phi)), start), moving])


def ternary(size: float, interval: float, start: float, end: float) -> Array:
    """A pseudo-random ternary sequence of velocities, integrated: ``size`` from peak to peak, until ``end`` [s].

    A shift register of five stages gives 242 velocities −v, 0 or v of ``interval`` [s] each, then the same again.
    """
    register, velocity = list(_REGISTER), []
    for _ in range(TERNARY_INTERVALS):
        number = sum(tap * stage for tap, stage in zip(_TAPS, register, strict=True)) % 3
        register = [number, *register[:-1]]
        velocity.append(number if number < 2 else -1)
    path = np.cumsum([0, *velocity]) * interval
    v = size / np.ptp(path) * np.tile(velocity, max(-count_steps((start - end) / interval / len(velocity)), 1))
    cuts = np.flatnonzero(np.diff(v, prepend=np.nan, append=np.nan) != 0)
    parts = [(v[i], 0.0, 0.0, start + i * interval, start + j * interval) for i, j in pairwise(cuts)]
    return np.array([part for part in parts if part[0] != 0 and not at_or_after(float(part[3]), end)]).reshape(-1, 5)


def _row(plant: LinearPlant, target: Target) -> tuple[Array, str, str]:
    """C_r of a target, its unit and its name."""
    known = {
        **{name: (row, unit) for name, row, unit in zip(plant.states, np.eye(plant.n), plant.state_units, strict=True)},
        **{name: (row, unit) for name, row, unit in zip(plant.outputs, plant.C, plant.output_units, strict=True)},
    }
    for name in target.combination:
        if name not in known:
            outputs, states = (", ".join(names) for names in (plant.outputs, plant.states))
            raise AnalysisError(
                f"set-point of {name!r}: the assumed plant's outputs are {outputs}, its states {states}"
            )
    single = len(target.combination) == 1
    name = target.name or (next(iter(target.combination)) if single else "")
    if not name:
        raise AnalysisError("a set-point of a combination of outputs needs a name")
    unit = target.unit or (known[next(iter(target.combination))][1] if single else "")
    row = sum((weight * known[of][0] for of, weight in target.combination.items()), np.zeros(plant.n))
    return np.asarray(row), unit, name


def _steady_states(plant: LinearPlant, rows: Mapping[str, Array]) -> tuple[Array, Array]:
    """x_ss and u_ss of A x + B u = 0, C_r x = 1 of one target and 0 of the others."""
    C_r, n, n_u = np.array(list(rows.values())).reshape(-1, plant.n), plant.n, plant.n_u
    whole = np.block([[plant.A, plant.B], [C_r, np.zeros((len(C_r), n_u))]])
    left, right = choose_units(np.abs(whole))
    whole = left[:, None] * whole * right
    wanted = np.vstack([np.zeros((n, len(C_r))), np.diag(left[n:])])
    U, s, Vt = np.linalg.svd(whole)
    rank = int((s > _REST * s[0]).sum())
    found = Vt[:rank].T @ ((U[:, :rank].T @ wanted) / s[:rank, None])
    missed = np.abs(whole @ found - wanted).max(axis=0, initial=0.0)
    for name, short, column in zip(rows, missed, wanted.T, strict=True):
        if short > _REST * np.abs(column).max():
            raise AnalysisError(
                f"set-point {name!r}: the assumed plant has no steady state for it; it cannot rest there, or there are "
                f"more set-points than its {n_u} inputs can hold"
            )
    free = Vt[rank:].T
    # a coordinate at which the plant is at rest anywhere needs no command; the one that it has here is rounding
    _, command, Wt = np.linalg.svd(free[n:])
    used = int((command > max(_REST, 16 * np.finfo(float).eps * s[0] / s[rank - 1])).sum())
    x_ss, u_ss = np.split(right[:, None] * found, [n])
    along, commands = np.split(right[:, None] * (free @ Wt.T), [n])
    less = np.linalg.lstsq(commands[:, :used], u_ss, rcond=None)[0]
    x_ss, u_ss = x_ss - along[:, :used] @ less, u_ss - commands[:, :used] @ less
    return x_ss - along[:, used:] @ np.linalg.lstsq(along[:, used:], x_ss, rcond=None)[0], u_ss
