"""The quality of an operating point and its linearisation, as numbers and as notices that say what to do.

A prediction holds for small departures of a smooth plant from rest. What violates that is found here before the
prediction is made: a plant that is not at rest, an input that can only push one way, dry friction, an output that
depends directly on the input, and modes that are neutral, uncontrollable or unobservable, by the names of their states.
A plant that is given by its matrices has the last of these alone.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from icmj.base.array import Array, argmax_abs
from icmj.base.balancing import balance, choose_units
from icmj.errors import ModelError
from icmj.plant.linear_plant import LinearPlant

Fault = Literal["not at rest", "kink", "dry friction", "feedthrough", "coarse derivatives"]
"""The kinds of notice that may be errors; what else may be noticed is called so where it is."""


@dataclass(frozen=True)
class Notice:
    """One notice.

    Attributes:
        kind: its name, a few words; by that of an error a run file allows it.
        severity: ``error`` if it would make a prediction meaningless, otherwise ``warning``.
        words: one sentence: what is wrong, where, and what to do.
    """

    kind: str
    severity: Literal["warning", "error"]
    words: str

    def __str__(self) -> str:
        return f"{self.kind}: {self.words}"


def permit(notices: Iterable[Notice], allow: Iterable[str], where: str) -> tuple[Notice, ...]:
    """The notices, with allowed errors turned into warnings; raises if one is an error that is not allowed.

    Raises:
        ModelError: the first error not allowed, with how to allow it; it begins with ``where``.
    """
    allowed, result = set(allow), []
    for notice in notices:
        if notice.severity == "error" and notice.kind not in allowed:
            raise ModelError(f'{where}: {notice} (or go on with [analysis] allow = ["{notice.kind}"])')
        result.append(replace(notice, severity="warning"))
    return tuple(dict.fromkeys(result))


# relative: finite differences err by 1e-9, and a double integrator's eigenvalues by the root of that
_RANK, _NEUTRAL, _SHARE = 1e-7, 1e-4, 0.1
IDLE = 1e-8
"""Largest effect of what affects nothing, relative to the largest entry of A, where A is made of differences."""


@dataclass(frozen=True)
class PlantMode:
    """An eigenvalue of A and the states that take part in it.

    Attributes:
        eigenvalue: [rad/s]; of a complex pair the upper one.
        states: those that take at least a tenth of the largest share.
    """

    eigenvalue: complex
    states: tuple[str, ...]

    @property
    def stable(self) -> bool:
        """Whether the mode decays."""
        return self.eigenvalue.real < -_NEUTRAL * abs(self.eigenvalue)


def neutral(plant: LinearPlant) -> tuple[PlantMode, ...]:
    """Modes with eigenvalue zero, such as integrators and positions without a preferred value."""
    return tuple(PlantMode(0j, _names(plant, v)) for v in _find_null(plant.A, plant.C[:0], plant.error).T)


def unobservable(plant: LinearPlant) -> tuple[PlantMode, ...]:
    """Modes that no output shows (Popov, Belevitch, Hautus): C v = 0 for a right eigenvector v."""
    return _find_hidden(plant, plant.A, plant.C)


def uncontrollable(plant: LinearPlant) -> tuple[PlantMode, ...]:
    """Modes that no input moves: wᵀB = 0 for a left eigenvector w."""
    return _find_hidden(plant, plant.A.T, plant.B.T)


def idle(plant: LinearPlant) -> tuple[str, ...]:
    """States on which no rate depends, such as a place on a level floor."""
    largest = np.abs(plant.A).max(axis=0)
    return tuple(name for name, size in zip(plant.states, largest, strict=True) if size <= plant.error)


def adrift(plant: LinearPlant, positions: np.ndarray | None = None) -> tuple[str, ...]:
    """States on which no rate depends and that no input brings back: where on a level floor a body stands.

    Without them the plant has no such mode. Of the states with the numbers ``positions`` also the largest in each
    direction of them on which no rate depends, such as the heading of a body that is not quite upright.
    """
    kept = _constants(plant, _RANK)
    found: list[str] = []
    for name in idle(plant):
        w = kept[:, plant.states.index(name)]
        if np.linalg.norm(w) < _RANK:
            continue
        found.append(name)
        # what else never changes, once this state is gone
        kept = np.linalg.svd(w[None, :])[2][1:] @ kept
    still = idle(plant)
    among = [int(i) for i in (() if positions is None else positions) if plant.states[i] not in still]
    while among:
        _, values, V = np.linalg.svd(plant.A[:, among])
        w = kept[:, among] @ V[-1]
        if values[-1] > IDLE * np.abs(plant.A).max() or np.linalg.norm(w) < _RANK:
            break
        found.append(plant.states[among.pop(argmax_abs(np.abs(V[-1])))])
        kept = np.linalg.svd(w[None, :])[2][1:] @ kept
    return tuple(found)


def find_undecided(plant: LinearPlant, error: float) -> tuple[str, ...]:
    """States on which no rate depends, of which A and B, right to ``error`` of A, do not tell whether an input moves
    them; none if the error is smaller than what decides.
    """
    still = idle(plant)
    return still if still and len(_constants(plant, error)) > len(_constants(plant, _RANK)) else ()


def _constants(plant: LinearPlant, error: float) -> Array:
    """Orthonormal w with wᵀ[A, B] = 0, to ``error`` of A's size: what wᵀx is never changes; shape (k, n)."""
    size = max(1.0, float(np.abs(plant.A).max(initial=0.0)))
    columns = np.linalg.norm(plant.B, axis=0)
    whole = np.hstack([plant.A, size * plant.B / np.where(columns > 0, columns, 1.0)])
    U, values, _ = np.linalg.svd(whole)
    return np.asarray(U[:, values < error * size].T)


def _find_hidden(plant: LinearPlant, A: Array, C: Array) -> tuple[PlantMode, ...]:
    """Modes of A that no row of C shows."""

    def null(λ: complex) -> NDArray[np.complex128]:
        return _find_null(A - λ * np.eye(plant.n), C, plant.error, abs(λ))

    balanced, _ = balance(A)
    limit, found = _NEUTRAL * np.abs(balanced).max(initial=0.0), list[complex]()
    for λ in (0j, *np.linalg.eigvals(balanced).astype(complex)):
        # of several that are one rounding makes a ring, and what it leaves at one is left between two of them, too
        alike = (other for other in found if abs(λ - other) < limit)
        if λ.imag >= 0 and not any(_is_within(null(λ), null((λ + other) / 2)) for other in alike):
            found.append(complex(λ))
    return tuple(PlantMode(λ, _names(plant, v)) for λ in found for v in null(λ).T)


def _is_within(V: NDArray[np.complex128], W: NDArray[np.complex128]) -> bool:
    """Whether W spans each of V, but for shares that are not told."""
    return not V.size or bool(np.abs(V - W @ np.linalg.pinv(W) @ V).max() < _SHARE)


def _find_null(A: Array, C: Array, error: float, rate: float = 0.0) -> NDArray[np.complex128]:
    """A basis of the v with A v = 0 and C v = 0, in units in which their entries compare, shape (n, r).

    Each v is 1 in a state in which all others are 0, the one with the largest share that is left.

    Args:
        A: shape (n, n); its diagonal is the difference of something and a number of the size ``rate``.
        C: shape (c, n).
        error: of each entry of A; where it is 0, the units of states and rows are chosen by the entries themselves,
            so that none that the plant is given in decides.
        rate: [1/s].
    """
    C = C[np.abs(C).max(axis=1, initial=0.0) > 0]
    M = np.vstack([A, C])
    if error:
        left, right = np.ones(len(M)), np.ones(len(A))
        left[: len(A)] = IDLE / error
        left[len(A) :] = 1 / np.linalg.norm(C, axis=1)
    else:
        left, right = choose_units(np.abs(M) + rate * np.eye(*M.shape))
    _, values, Vh = np.linalg.svd(left[:, None] * M * right)
    N = left_over = Vh[int((values > _RANK).sum()) :].conj().T
    pivots = []
    for _ in range(N.shape[1]):
        pivots.append(argmax_abs(np.linalg.norm(left_over, axis=1)))
        row = left_over[pivots[-1]]
        left_over = left_over - np.outer(left_over @ row.conj(), row) / (np.linalg.norm(row) ** 2)
    return np.asarray(N @ np.linalg.inv(N[pivots]), complex)


def _names(plant: LinearPlant, vector: NDArray[np.complex128]) -> tuple[str, ...]:
    share = np.abs(vector)
    return tuple(name for name, part in zip(plant.states, share, strict=True) if part > _SHARE * share.max())


AT_REST = 1e-6
"""Largest acceleration, as a fraction of gravity, of a plant that is at rest."""
BENT = 1e-2
"""Largest relative disagreement of two one-sided differences of a smooth plant."""
ROOMY = 0.01
"""Least distance of a joint from the ends of its range, as a share of it, where there is a choice."""
COARSE = 1e-4
"""Largest relative error of A, B or C that goes without a word."""
STEADY = 1e-3
"""Largest relative change of a response by halving the time step that goes without a word."""


@dataclass(frozen=True)
class Residual:
    """The largest acceleration at the operating point.

    Attributes:
        size: its size, in ``unit``.
        of: name of the state.
        unit: rad/s² or m/s²; 1/s for an activation.
        share: its size relative to gravity (for an angle, with a lever of 1 m); for an activation, its rate.
    """

    size: float
    of: str
    unit: str
    share: float


@dataclass(frozen=True)
class Kink:
    """An input or a state whose slopes differ on its two sides.

    Attributes:
        of: name of the input or state.
        kind: ``input`` or ``state``.
        bend: difference of the two one-sided derivatives, relative to the larger.
        why: a possible reason.
    """

    of: str
    kind: str
    bend: float
    why: str


@dataclass(frozen=True)
class Margin:
    """The distances of an input or a joint at the operating point from the ends of its range, in its unit."""

    of: str
    down: float
    up: float


@dataclass(frozen=True)
class Excess:
    """A limit beyond which the operating point lies.

    Attributes:
        what: the limit, with its numbers.
        kind: kind of the notice, such as ``saturation``.
        inputs: the inputs of the actuator whose limit it is.
    """

    what: str
    kind: str
    inputs: tuple[str, ...] = ()


def dead(plant: LinearPlant, least: float = 0.0) -> tuple[str, ...]:
    """Inputs that move nothing: columns of B that are zero but for ``least``, the rounding of differences."""
    size = np.abs(plant.B).max(axis=0, initial=0.0)
    return tuple(name for name, largest in zip(plant.inputs, size, strict=True) if largest <= least)


@dataclass(frozen=True)
class StepEffect:
    """The dependence of a plant on the time step with which the engine computes its forces.

    Attributes:
        share: the largest change of a response by halving the step, relative to the response.
        input, output: those of this response.
        omega: its angular frequency [rad/s].
        step: the time step of the model [s].
    """

    share: float
    input: str
    output: str
    omega: float
    step: float


@dataclass(frozen=True)
class Raised:
    """A constraint that acts at the operating point with a longer time constant than the model states.

    Attributes:
        of: the constraint.
        stated: the time constant of its ``solref`` [s].
        taken: two time steps of the model, which is what the engine takes instead [s].
    """

    of: str
    stated: float
    taken: float


def compare_steps(plant: LinearPlant, halved: LinearPlant, step: float) -> StepEffect | None:
    """How much the response of each output to each input changes with the step, at the poles' frequencies.

    Responses below a millionth of the largest of an output are left out. ``None`` where nothing changes by more than
    ``STEADY``.
    """
    sizes = np.abs(halved.poles)
    sizes = sizes[sizes > _NEUTRAL * max(1.0, float(sizes.max(initial=0.0)))]
    largest = None
    # beside the poles, where the response of an undamped plant is finite
    for omega in np.unique(np.round(np.sqrt(2) * sizes, 6)) if len(sizes) else (1.0,):
        here, there = (one.response(1j * omega) for one in (halved, plant))
        size = np.abs(here)
        size[size <= 1e-6 * size.max(axis=1, keepdims=True)] = np.inf
        share = np.abs(there - here) / size
        row, column = np.unravel_index(argmax_abs(share.ravel()), share.shape)
        if share[row, column] > max(STEADY, largest.share if largest else 0.0):
            names = plant.inputs[column], plant.outputs[row]
            largest = StepEffect(float(share[row, column]), *names, float(omega), step)
    return largest


@dataclass(frozen=True)
class Quality:
    """The quality of an operating point.

    Attributes:
        residual: remaining accelerations.
        moving: states with a velocity at this point.
        errors: errors of A, B and C, from halving the step, relative to the largest entry of each.
        kinks: states and inputs in which the plant is not smooth.
        friction: joints with dry friction, which has no linear model at rest.
        margins: distances of the inputs to their limits.
        room: distances of joints to the ends of their ranges.
        feedthrough: outputs that depend directly on the inputs (D ≠ 0).
        neutral, uncontrollable, unobservable: such modes, by the names of their states.
        idle: states on which nothing depends.
        excesses: limits beyond which the point lies.
        dead: inputs that move nothing.
        step_effect: the dependence of the plant on the model's time step, where it is noticeable.
        raised: constraints that are softer than stated because of that step.
        undecided: states on which nothing depends, of which the derivatives, without a kink, do not tell whether an
            input moves them.
    """

    residual: Residual
    moving: tuple[str, ...] = ()
    errors: tuple[float, float, float] = (0.0, 0.0, 0.0)
    kinks: tuple[Kink, ...] = ()
    friction: tuple[str, ...] = ()
    margins: tuple[Margin, ...] = ()
    room: tuple[Margin, ...] = ()
    feedthrough: tuple[str, ...] = ()
    neutral: tuple[PlantMode, ...] = ()
    uncontrollable: tuple[PlantMode, ...] = ()
    unobservable: tuple[PlantMode, ...] = ()
    idle: tuple[str, ...] = ()
    excesses: tuple[Excess, ...] = ()
    dead: tuple[str, ...] = ()
    step_effect: StepEffect | None = None
    raised: tuple[Raised, ...] = ()
    undecided: tuple[str, ...] = ()

    @property
    def at_rest(self) -> bool:
        """Whether the operating point is an equilibrium."""
        return self.residual.share <= AT_REST and not self.moving

    @property
    def merits(self) -> tuple[bool, ...]:
        """The conditions for a prediction, the most important first.

        The plant is at rest; it is smooth at and near the operating point; the inputs can control all modes that do not
        decay by themselves; and the joints are not at the ends of their ranges.
        """
        reached = all(mode.stable for mode in self.uncontrollable)
        roomy = all(min(joint.down, joint.up) > ROOMY * (joint.down + joint.up) for joint in self.room)
        return self.at_rest, not self.kinks, max(self.errors) <= COARSE, reached, roomy

    @property
    def notices(self) -> tuple[Notice, ...]:
        """The notices that the user must see."""
        return tuple(self._notices())

    def _notices(self) -> Iterator[Notice]:
        r = self.residual
        if r.share > AT_REST:
            of_gravity = "" if r.unit == "1/s" else f", {r.share:.2g} of gravity"
            yield Notice(
                "not at rest", "error",
                f"{r.of} accelerates by {r.size:.3g} {r.unit}{of_gravity}, at the operating point; choose a keyframe "
                'at rest, or operating_point = "static control" or "balance"',
            )  # fmt: skip
        if self.moving:
            words = f"{_list(self.moving)} has a velocity at the operating point; choose a keyframe at rest"
            yield Notice("not at rest", "error", words)
        for kink in self.kinks:
            words = f"the plant answers differently up and down in {kink.kind} {kink.of!r}: {kink.why}"
            yield Notice("kink", "error", words)
        if self.friction:
            words = f"{_list(self.friction)} has dry friction, which no linear model has at rest; set frictionloss to 0"
            yield Notice("dry friction", "error", words)
        for output in self.feedthrough:
            words = (
                f"output {output!r} jumps with the inputs (D ≠ 0), which closes an algebraic loop through the "
                'controller; leave it out of outputs, or take outputs = "joints"'
            )
            yield Notice("feedthrough", "error", words)
        if not self.kinks and max(self.errors) > COARSE:
            letter, error = max(zip("ABC", self.errors, strict=True), key=lambda pair: pair[1])
            words = f"{letter} is right to {error:.1g} of its largest entry only; the plant is hardly smooth there"
            yield Notice("coarse derivatives", "warning", words)
        if self.undecided:
            named = ", ".join(f'"{name}"' for name in self.undecided)
            words = (
                f"nothing depends on {_list(self.undecided)}, and A is right to {max(self.errors):.1g} of its largest "
                f"entry only, which does not tell whether an input moves it: drop = [{named}], and leave it out of "
                "outputs, or make the plant smooth there (noslip_iterations = 0)"
            )
            yield Notice("coarse derivatives", "error", words)
        for excess in self.excesses:
            still = [name for name in self.dead if name in excess.inputs]
            where = f", where {_list(tuple(still))} moves nothing" if still else ""
            yield Notice(
                excess.kind, "warning", f"the operating point is beyond {excess.what}{where}; operate it inside"
            )
        for name in self.dead:
            if not any(name in excess.inputs for excess in self.excesses):
                words = f"input {name!r} moves nothing (its column of B is zero); leave it out of inputs"
                yield Notice("uncontrollable", "warning", words)
        for mode in self.uncontrollable:
            if not mode.stable:
                yield Notice("uncontrollable", "warning", self._unmoved(mode))
        for mode in self.unobservable:
            if not mode.stable:
                yield Notice("unobservable", "warning", _unseen(mode))
        if (effect := self.step_effect) is not None:
            words = (
                f"forces of the model depend on its time step of {effect.step:g} s: half of it changes the response of "
                f"{effect.output} to {effect.input} by {effect.share:.2g} at {effect.omega:.3g} rad/s, and so the "
                "prediction (actearly of a motor with inductance, or a constraint faster than two steps); give the "
                "model a smaller timestep"
            )
            yield Notice("time step", "warning", words)
        if self.raised:
            words = (
                f"the time constant of {_list(tuple(f'{each.of} ({each.stated:g} s)' for each in self.raised))} is "
                f"raised to {self.raised[0].taken:g} s, two time steps of the model, in prediction and run, whatever "
                "the run's steps; give the model a smaller timestep to have it as stated"
            )
            yield Notice("time step", "warning", words)

    def _unmoved(self, mode: PlantMode) -> str:
        words = f"no input moves {_list(mode.states)}, and it does not come to rest by itself ({_pole(mode)})"
        idle = tuple(name for name in self.idle if name in mode.states)
        if mode.eigenvalue == 0 and idle:
            named = ", ".join(f'"{name}"' for name in idle)
            words += f"; nothing depends on {_list(idle)}: drop = [{named}], and leave it out of outputs"
        return words


def notice_omission(plant: LinearPlant, names: tuple[str, ...]) -> Notice:
    """The notice that states of ``plant`` were left out that are :func:`adrift`."""
    named, kept = ", ".join(f'"{name}"' for name in names), _constants(plant, _RANK)
    moved = any(np.linalg.norm(kept[:, plant.states.index(name)]) < _RANK for name in names)
    why = "no output shows it" if moved else "no input moves it"
    words = f"nothing depends on {_list(names)}, and {why}: dropped, as drop = [{named}] would say"
    return Notice("dropped state", "warning", words)


def _unseen(mode: PlantMode) -> str:
    does = "do" if len(mode.states) > 1 else "does"
    if abs(mode.eigenvalue) == 0:
        named = ", ".join(f'"{name}"' for name in mode.states)
        return f"{_list(mode.states)} {does} not matter to any output; drop = [{named}], or add an output that shows it"
    return f"no output shows {_list(mode.states)}, and it does not come to rest by itself ({_pole(mode)})"


def _pole(mode: PlantMode) -> str:
    λ = mode.eigenvalue
    return f"eigenvalue {λ.real:.3g} rad/s" if λ.imag == 0 else f"eigenvalue {λ.real:.3g} ± {abs(λ.imag):.3g}j rad/s"


def _list(names: tuple[str, ...]) -> str:
    return " and ".join(filter(None, (", ".join(names[:-1]), names[-1])))


@dataclass(frozen=True, eq=False)
class GivenLinearisation:
    """The linearisation of a plant that is linear: the plant itself."""

    plant: LinearPlant


@dataclass(frozen=True, eq=False)
class MatrixPlant:
    """A plant that is linear everywhere, and at rest at zero.

    Attributes:
        linearisation: holds the plant.
    """

    linearisation: GivenLinearisation

    @classmethod
    def of(cls, plant: LinearPlant) -> MatrixPlant:
        """The plant in the form that a case holds."""
        return cls(GivenLinearisation(plant))

    @property
    def states(self) -> tuple[str, ...]:
        """All states."""
        return self.linearisation.plant.states

    @property
    def told(self) -> tuple[Notice, ...]:
        """Notices on choices that were made for the user: none."""
        return ()

    @cached_property
    def quality(self) -> Quality:
        """The quality of the operating point: its modes; all other checks apply to models only."""
        plant = self.linearisation.plant
        return Quality(
            Residual(0.0, plant.states[0], "", 0.0),
            neutral=neutral(plant),
            uncontrollable=uncontrollable(plant),
            unobservable=unobservable(plant),
            idle=idle(plant),
            dead=dead(plant),
        )
