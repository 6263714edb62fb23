"""Cycles of a switched delayed feedback: fixed points of a map from one quiet interval to the next.

When feedback was off for at least its delay, the plant has been in open loop for all that the controller is still to
read. Its history is then e^{As} ξ, with ξ the state at which the plant crossed into the region where feedback is on, a
delay before feedback follows. So the map of a history is one of ξ alone, with as many multipliers as the plant has
states; of these one is 0, because ξ lies on the edge of the region, and all others of the history are 0 as well. A
*round* goes from one such ξ to the next. On the linear plant all of it is exact.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import singledispatch

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import expm

from icmj.base.array import RELATIVE_ROUNDING, Array
from icmj.case.case import Case
from icmj.case.plants import linear_plant
from icmj.controller.law import Law
from icmj.controller.switching import OFF, SwitchingPD
from icmj.cycle.jacobian import compute_multipliers, difference_jacobian
from icmj.cycle.newton import solve_newton
from icmj.cycle.return_map import LostInterval, Turn
from icmj.errors import CycleError
from icmj.linear.run import simulate
from icmj.plant.linear_plant import LinearPlant, match_ports
from icmj.simulation import ending
from icmj.simulation.settings import Settings
from icmj.simulation.start import make_plant_start

MOST = 12  # rounds in a cycle
LONGEST = 100.0  # times the delay: rounds that are flown before they are given up, at first
_PATIENCE = 6  # times this is doubled
_AHEAD = 0.01  # delays before ξ at which a flight begins, in the region where feedback is off
_SAME = 1e-7  # relative: ξ that are one
_CLOSE = 1e-3  # relative: a simulation that comes as near to an earlier ξ is near a cycle
_LIMIT = 1e9  # of positions, in units of the dead zone's size: beyond, the motion has left
_WARM = 300.0  # delays of a simulation that a first guess is taken from, at first


@singledispatch
def has_exact_cycle(law: Law) -> bool:
    """Whether the cycle of a controller is found exactly by :func:`find_switched_cycle`: of one joint, switched, with a
    dead zone.
    """
    return False


@has_exact_cycle.register
def _(law: SwitchingPD) -> bool:
    return law.switches and law.dead_zone > 0


def make_loop(case: Case) -> tuple[LinearPlant, SwitchingPD, Array | None]:
    """The actual plant with the controller's inputs and outputs, the controller, and where the run of a case starts."""
    law = case.controller
    plant = match_ports(linear_plant(case.actual, case.settings), law.plant, "position")
    x0 = make_plant_start(plant, case.settings, None)
    return plant, law, (x0 if x0.any() else None)  # type: ignore[return-value]


@dataclass(frozen=True, eq=False)
class SwitchedMap:
    """The map from one quiet interval to the next.

    Attributes:
        plant: with the inputs and outputs of the law's.
        law: that switches, with a dead zone.
    """

    plant: LinearPlant
    law: SwitchingPD

    def __post_init__(self) -> None:
        if not self.law.switches:
            raise CycleError("feedback that is not switched is a linear loop, which has no cycle of its own")
        if not self.law.dead_zone:
            raise CycleError(
                "without a dead zone every round is the one before times a factor, so that there is no cycle but where "
                "that is 1; give a dead zone"
            )

    @property
    def least(self) -> float:
        """Zero: rounds have no minimum length."""
        return 0.0

    def has_collapsed(self, interval: float) -> bool:
        """Always false: rounds have no minimum length."""
        return False

    def another(self) -> SwitchedMap:
        """The same object: it keeps no state between simulations."""
        return self

    def turn(self, z: Array, p: int = 1) -> Turn:
        """Fly p rounds from z = ξ, shape (n,).

        Raises:
            Lost: if the motion leaves, or stays off or on.
        """
        return self.flight(z, p)[0]

    def flight(self, z: Array, p: int = 1) -> tuple[Turn, Array]:
        """Fly p rounds from z: the turn, and the switches in it, since its begin [s].

        Raises:
            Lost: as for :meth:`turn`.
        """
        delay, duration = self.law.delay, LONGEST * self.law.delay * p
        back = expm(-self.plant.A * _AHEAD * delay) @ z
        if self.law.realisation.following(OFF, self.plant.C @ back) != OFF:
            raise LostInterval.after(ending.end_diverged(0.0, "does not begin where feedback is off"), 0.0)
        for _ in range(_PATIENCE):
            found = self.rounds(back, duration)
            if len(found.at) > p or found.ended:
                break
            duration *= 2
        if len(found.at) <= p:
            raise LostInterval.after(found.outcome, found.outcome.t)
        last, first = found.number[p], found.number[0]
        times = found.times - found.times[first]
        turn = Turn(
            intervals=np.diff(found.times[found.number[: p + 1]]), states=found.at[:p], end=found.at[p],
            y_max=found.y_max[first + 1 : last + 1].max(axis=0), y_min=found.y_min[first + 1 : last + 1].min(axis=0),
        )  # fmt: skip
        return turn, times[first:last]

    def rounds(self, x0: Array, duration: float) -> _Rounds:
        """All ξ of a simulation from a state."""
        size = _LIMIT * max(self.law.dead_zone, float(np.abs(self.plant.C @ x0).max()))
        settings = Settings(duration=duration, limit=size, record_interval=duration)
        run = simulate(self.plant, self.law, settings, x0=x0)
        t, delay = run.events.t, self.law.delay
        # the row of an event shows what was before it; what it switches to is the mode of the next row
        before = run.mode[np.searchsorted(run.t, t)]
        on = np.flatnonzero(before == OFF)
        since = t[on] - np.where(on > 0, t[on - 1], -np.inf)
        quiet = on[since >= delay * (1 - 1e-12)]
        at = run.events.x[quiet] @ expm(-self.plant.A * delay).T
        return _Rounds(at, t, quiet, run.events.y_max, run.events.y_min, run.outcome)


@dataclass(frozen=True, eq=False)
class _Rounds:
    """Rounds of a simulation: every ξ, shape (K, n), switches, their indices, extremes, and how it ended."""

    at: Array
    times: Array
    number: NDArray[np.intp]
    y_max: Array
    y_min: Array
    outcome: ending.Outcome

    @property
    def ended(self) -> bool:
        return self.outcome.kind != "completed"


@dataclass(frozen=True, eq=False)
class SwitchedCycle:
    """A cycle of a body under a switched delayed feedback, on the linear plant.

    Attributes:
        law: the controller.
        period: [s].
        mirrored: whether its second half is the first with opposite sign.
        states: ξ of each round of the period, or of its first half, shape (p, n): the plant's state a delay before
            feedback is switched on.
        switches: times since the first one, over the period or its first half [s]; on, off, on, …
        y_peak, y_range: largest magnitude, and peak to peak, of every output over the period, shape (n_y,).
        multipliers: of the map over the period or its first half, by falling magnitude, shape (n,); all others of a
            history are 0.
        multiplier_errors: how wrong each may be, shape (n,).
        closure: largest |±P(ξ) − ξ|, relative to the size of ξ.
    """

    law: SwitchingPD
    period: float
    mirrored: bool
    states: Array
    switches: Array
    y_peak: Array
    y_range: Array
    multipliers: NDArray[np.complex128]
    multiplier_errors: Array
    closure: float

    @property
    def attracting(self) -> bool:
        """Whether every multiplier is inside the unit circle, and not on it but for rounding."""
        return bool(np.abs(self.multipliers[0]) < 1 - RELATIVE_ROUNDING)

    @property
    def words(self) -> str:
        """The cycle in one sentence."""
        kind = "An attracting" if self.attracting else "A repelling"
        many = len(self.switches) * (2 if self.mirrored else 1)
        mirrored = "mirrored " if self.mirrored else ""
        return (
            f"{kind} {mirrored}cycle of {self.period:.6g} s with {many} switches, largest multiplier "
            f"{abs(self.multipliers[0]):.4g}; peak of {self.law.position} {self.peak:.6g} times the dead zone."
        )

    @property
    def peak(self) -> float:
        """Largest magnitude of the position over the size of the dead zone."""
        return float(self.y_peak[self.law.plant.outputs.index(self.law.position)] / self.law.dead_zone)


def find_switched_cycle(
    plant: LinearPlant, law: SwitchingPD, x0: ArrayLike | None = None, *, rounds: int | None = None, sign: int = 1
) -> SwitchedCycle:
    """The cycle that a simulation settles on, or the cycle nearest to a first guess, with its multipliers.

    Args:
        plant: with the inputs and outputs of the law's.
        law: the controller, with a dead zone.
        x0: start of the simulation, shape (n,); by default ten times the dead zone's size in the first state. With
            ``rounds``, the first guess of ξ.
        rounds: in the period, or in half of a mirrored one, where ``x0`` is a guess.
        sign: −1 for a mirrored cycle, where ``x0`` is a guess.

    Raises:
        CycleError: if there is none, and what the motion does instead.
    """
    loop = SwitchedMap(plant, law)
    start = 10 * law.dead_zone * np.eye(plant.n)[0] if x0 is None else np.asarray(x0, dtype=float)
    guess = (start, rounds, sign) if rounds else _guess(loop, start)
    z, p, sign = guess
    scale = np.maximum(np.abs(z), RELATIVE_ROUNDING * np.abs(z).max())
    found = solve_newton(
        loop, z, scale, lambda turn: difference_jacobian(loop, turn.states[0], scale, p).J, p=p, sign=sign
    )
    p, sign = find_shortest(found.turn.states, p, sign)
    J = difference_jacobian(loop, found.z, scale, p, rounding=found.closure)
    values, errors = compute_multipliers(J, scale)
    turn, switches = loop.flight(found.z, p)
    peak, spread = turn.extent(sign)
    return SwitchedCycle(
        law=law,
        period=float(turn.intervals.sum()) * (1 if sign > 0 else 2),
        mirrored=sign < 0,
        states=turn.states,
        switches=switches,
        y_peak=peak,
        y_range=spread,
        multipliers=values,
        multiplier_errors=errors,
        closure=found.closure,
    )


def _guess(loop: SwitchedMap, x0: Array) -> tuple[Array, int, int]:
    """ξ near a cycle, how many rounds it has, and whether these end in the mirror image.

    Raises:
        CycleError: if the simulation comes to none.
    """
    duration = _WARM * loop.law.delay
    for _ in range(_PATIENCE):
        found = loop.rounds(x0, duration)
        last = found.at[-1] if len(found.at) else np.zeros(0)
        for p in range(1, min(MOST, len(found.at) - 1) + 1):
            for sign in (1, -1):
                if np.abs(sign * found.at[-1 - p] - last).max() < _CLOSE * np.abs(last).max():
                    return last, p, sign
        if found.ended:
            raise CycleError(f"no cycle: the motion {found.outcome.message}")
        duration *= 2
    if len(found.at) < 2:
        raise CycleError(f"no cycle: in {duration / 2:g} s feedback was not switched off for as long as its delay")
    raise CycleError(f"no cycle: the motion does not repeat after {MOST} rounds or fewer in {duration / 2:g} s")


def find_shortest(states: Array, p: int, sign: int) -> tuple[int, int]:
    """After how many rounds, and with which sign, it closes first; its ξ are ``states``, shape (p, n)."""
    for q in range(1, p):
        for s in (1, -1):
            again = s * states[q] - states[0]
            if p % q == 0 and s ** (p // q) == sign and np.abs(again).max() < _SAME * np.abs(states[0]).max():
                return q, s
    return p, sign
