"""The quality of an operating point and its linearisation: numbers, and notices for the user.

A prediction applies to small departures of a smooth plant from rest. Violations of these conditions are found here
before the prediction: a plant that is not at rest, an input that can only push one way, dry friction, an output that
depends directly on the input, an uncontrollable or unobservable mode.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from icmj.plant.modes import Mode
from icmj.plant.notice import Notice

AT_REST = 1e-6
"""Largest acceleration, as a fraction of gravity, of a plant that is at rest."""
BENT = 1e-2
"""Largest relative disagreement of two one-sided differences of a smooth plant."""
ROOMY = 0.01
"""Least distance of a joint from the ends of its range, as a share of it, where there is a choice."""
COARSE = 1e-4
"""Largest relative error of A, B or C that goes without a word."""


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
    """

    residual: Residual
    moving: tuple[str, ...] = ()
    errors: tuple[float, float, float] = (0.0, 0.0, 0.0)
    kinks: tuple[Kink, ...] = ()
    friction: tuple[str, ...] = ()
    margins: tuple[Margin, ...] = ()
    room: tuple[Margin, ...] = ()
    feedthrough: tuple[str, ...] = ()
    neutral: tuple[Mode, ...] = ()
    uncontrollable: tuple[Mode, ...] = ()
    unobservable: tuple[Mode, ...] = ()
    idle: tuple[str, ...] = ()

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
        for mode in self.uncontrollable:
            if not mode.stable:
                yield Notice("uncontrollable", "warning", self._unmoved(mode))
        for mode in self.unobservable:
            if not mode.stable:
                yield Notice("unobservable", "warning", _unseen(mode))

    def _unmoved(self, mode: Mode) -> str:
        words = f"no input moves {_list(mode.states)}, and it does not come to rest by itself ({_pole(mode)})"
        idle = tuple(name for name in self.idle if name in mode.states)
        if mode.eigenvalue == 0 and idle:
            named = ", ".join(f'"{name}"' for name in idle)
            words += f"; nothing depends on {_list(idle)}: drop = [{named}], and leave it out of outputs"
        return words


def dropped(names: tuple[str, ...]) -> Notice:
    """The notice that states were left out that affect nothing and are affected by nothing."""
    named = ", ".join(f'"{name}"' for name in names)
    words = f"nothing depends on {_list(names)}, and no input moves it: dropped, as drop = [{named}] would say"
    return Notice("dropped state", "warning", words)


def _unseen(mode: Mode) -> str:
    does = "do" if len(mode.states) > 1 else "does"
    if abs(mode.eigenvalue) == 0:
        named = ", ".join(f'"{name}"' for name in mode.states)
        return f"{_list(mode.states)} {does} not matter to any output; drop = [{named}], or add an output that shows it"
    return f"no output shows {_list(mode.states)}, and it does not come to rest by itself ({_pole(mode)})"


def _pole(mode: Mode) -> str:
    λ = mode.eigenvalue
    return f"eigenvalue {λ.real:.3g} rad/s" if λ.imag == 0 else f"eigenvalue {λ.real:.3g} ± {abs(λ.imag):.3g}j rad/s"


def _list(names: tuple[str, ...]) -> str:
    return " and ".join(filter(None, (", ".join(names[:-1]), names[-1])))
