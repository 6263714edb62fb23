"""Branches of cycles of a switched delayed feedback: from one value of a parameter of the controller to another.

The map of a round (:mod:`icmj.cycle.switched`) is smooth in pieces: where a cycle comes to a corner of the region in
which feedback is on, it may end, or go on as another. So a branch is followed in its parameter by Newton's method, with
steps that are halved where it does not converge, and ends where that does not help.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from icmj.base.array import Array
from icmj.controller.switching import SwitchingPD
from icmj.cycle.switched import SwitchedCycle, find_switched_cycle
from icmj.errors import CycleError, IcmjError
from icmj.plant.linear_plant import LinearPlant

_HALVINGS = 8  # of a step along a branch
_JUMP = 0.1  # relative change of a period that no step of a branch makes
_LOCATED = 1e-7  # relative: of a parameter where stability changes


@dataclass(frozen=True, eq=False)
class SwitchedBranch:
    """Cycles along a parameter of the controller.

    Attributes:
        parameter: its name.
        value: of it at each cycle, shape (M,).
        cycles: M of them.
        changes: where an attracting cycle becomes a repelling one, or the reverse.
        end: why the branch ends.
    """

    parameter: str
    value: Array
    cycles: tuple[SwitchedCycle, ...]
    changes: tuple[float, ...]
    end: str


def follow_switched(
    plant: LinearPlant, law: SwitchingPD, parameter: str, to: float, *, points: int = 40, x0: ArrayLike | None = None
) -> SwitchedBranch:
    """The cycle along a parameter of the controller, from the law's own value on, by Newton's method at each.

    Args:
        plant, law, x0: as for :func:`find_switched_cycle`, at the first value.
        parameter: ``P``, ``D``, ``slope``, ``dead_zone``, ``delay``, or ``share`` for ρ of a = −tan(π(ρ − ½)).
        to: last value.
        points: how many cycles, if the branch runs through.

    Raises:
        CycleError: if there is no cycle to begin with, or no such parameter.
    """
    at, first = vary(law, parameter)
    if not np.isfinite(to) or to == first:
        raise CycleError(f"a branch runs between two different values, got {first:g} and {to:g}")
    cycles, values = [find_switched_cycle(plant, law, x0)], [first]
    p, sign = len(cycles[0].states), -1 if cycles[0].mirrored else 1

    def there(value: float, i: int) -> SwitchedCycle:
        """The cycle at a parameter value, with the neighbours of point i as first guess."""
        z = cycles[i].states[0]
        if i > 0 and values[i] != values[i - 1]:
            part = (value - values[i]) / (values[i] - values[i - 1])
            z = z + np.clip(part, -2, 2) * (z - cycles[i - 1].states[0])
        found = find_switched_cycle(plant, at(value), z, rounds=p, sign=sign)
        if len(found.switches) != len(cycles[i].switches):
            raise CycleError("a switch appears or vanishes")
        if abs(found.period / cycles[i].period - 1) > _JUMP:
            raise CycleError(f"beyond, the nearest cycle is another one, of {found.period:.6g} s")
        return found

    step = (to - first) / max(points - 1, 1)
    end, least = f"reached {parameter} = {to:.6g}", abs(step) * 0.5**_HALVINGS
    length = step
    while values[-1] != to:
        value = values[-1] + length
        if abs(value - first) > abs(to - first) - 0.01 * abs(step):
            value = to
        try:
            cycles.append(there(value, len(cycles) - 1))
        except IcmjError as error:
            length /= 2
            if abs(length) < least:
                end = f"ends at {parameter} = {values[-1]:.6g}: {error}"
                break
            continue
        values.append(value)
        length = np.sign(step) * min(abs(step), 1.5 * abs(length))
    changes = [
        _change(lambda value, i=i: there(value, i), values[i : i + 2], cycles[i].attracting)  # type: ignore[misc]
        for i in range(len(cycles) - 1)
        if cycles[i].attracting != cycles[i + 1].attracting
    ]
    return SwitchedBranch(parameter, np.array(values), tuple(cycles), tuple(changes), end)


def _change(there: Callable[[float], SwitchedCycle], between: list[float], attracting: bool) -> float:
    """The value between two others at which stability changes, by bisection."""
    left, right = between
    while abs(right - left) > _LOCATED * max(abs(left), abs(right)):
        middle = (left + right) / 2
        try:
            same = there(middle).attracting == attracting
        except IcmjError:
            break
        left, right = (middle, right) if same else (left, middle)
    return (left + right) / 2


def vary(law: SwitchingPD, parameter: str) -> tuple[Callable[[float], SwitchingPD], float]:
    """The controller at a value of a parameter, and its own value."""
    if parameter == "share":
        own = 0.5 - np.arctan(law.slope) / np.pi
        return (lambda value: replace(law, slope=-float(np.tan(np.pi * (value - 0.5))))), float(own)
    if parameter not in ("P", "D", "slope", "dead_zone", "delay"):
        raise CycleError(f"no parameter {parameter!r}; expected P, D, slope, share, dead_zone or delay")
    own = np.asarray(getattr(law, parameter), dtype=float)
    if own.size != 1:
        raise CycleError(f"{parameter} is a number for each input; a branch needs one")
    return (lambda value: replace(law, **{parameter: value})), float(own.ravel()[0])
