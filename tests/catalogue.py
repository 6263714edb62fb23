"""``python -m tests.catalogue`` from the checkout: verdicts on orbits of random loops against exact runs beside them.

A loop is a random unstable plant under an LQ design of any weight, with inputs of half to four times their strength, a
matched, a zero-order or another hold, a delay or none, which is predicted, in part or not, and a round or a box rule;
some are two plants side by side, on whose orbits two faces are reached together. Beside each orbit that is admissible,
0.1 % of its size off it, a run of 200 events is started: it comes back, leaves, or settles beside, as the verdict says.
What a run and the verdict differ in may be slow, or a deviation that grows at first. Such an orbit is looked at again
from a hundredth of the distance, for 1,000 events; where these are too few, their differences have to fall or grow by
the largest multiplier from one event to the next. With ``--starts``, runs begin at small states instead, and each
cycle of one event, or of two that mirror each other, that one settles on has to be in the catalogue.
"""

from __future__ import annotations

import argparse
import json
import sys
import warnings
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.linalg import block_diag

sys.path.insert(0, str(Path(__file__).parent))

from theory_cases import whole

from icmj import (
    BoxTrigger,
    Controller,
    EventTrigger,
    LinearPlant,
    Prediction,
    Settings,
    Simulation,
    measure,
    output_weight,
    predict,
)
from icmj.case.laid_orbit import settled_on
from icmj.controller.delay import Delay
from icmj.controller.design import Design, design_lq
from icmj.controller.hold import Hold, system_matched, zero_order
from icmj.controller.trigger import EventRule
from icmj.errors import IcmjError
from icmj.linear.run import simulate
from icmj.theory.error_system import ErrorSystem, error_system
from icmj.theory.prediction import PredictedOrbit

LONGEST = 4.0  # s: intervals up to which orbits are predicted
AWAY, EVENTS = 1e-3, 200  # of the size of the orbit, and how long it is looked at
AGAIN, NEARER = 5, 100  # times as long, and times as near, at the second look
BACK, GONE = 0.1, 10.0  # of the distance that a run begins at, at its end: has come back, has left
CLOSER = 10  # times as near: from there a neighbour of a family is as much nearer, another orbit is where it was
STILL = 1e-11  # of the size of the orbit: what rounding leaves between two events of a motion that has settled
ROUNDING = 1e-9  # of the size of the orbit: a distance that need not fall any more
FAR = 0.3  # of the size of the orbit: what has been so far away has left
PART = 10  # events after which a run is looked at: what has left may have a thousand events in each interval
ALIKE = 0.2  # of what is missing to 1: so far may a growth per event be from the multiplier


@dataclass(frozen=True, eq=False)
class Loop:
    """A loop with its event rule, and what it is of."""

    system: ErrorSystem
    rule: EventRule
    kind: str

    def predict(self) -> Prediction:
        """Its orbits with intervals up to ``LONGEST``."""
        return predict(self.system, self.rule, delta_max=LONGEST)

    def run(self, start: np.ndarray, duration: float) -> Simulation:
        """The exact run from (x, x_o, x_h)."""
        system, hold = self.system, self.system.hold or system_matched(self.system.design)
        x, x_o, x_h = np.split(start, [system.n, system.n + system.n_hat])
        settings = Settings(duration=duration, record_interval=1e4, limit=1e9)
        law = Controller(system.design, hold, self.rule, system.delay)
        return simulate(system.actual, law, settings, x0=x, x_o0=x_o, x_h0=x_h)

    def states(self, run: Simulation, size: int) -> np.ndarray:
        """Its state at each event of a run, shape (K, size)."""
        events = run.events
        held = events.x_h if self.system.delay else events.x_o
        return self.system.from_original(np.hstack([events.x, events.x_o, held]))[:, :size]


def random_loop(seed: int, number: int) -> Loop:
    """One of the loops of a seed."""
    rng = np.random.default_rng([seed, number])
    while True:
        n, n_u, n_y = rng.integers(2, 4), rng.integers(1, 3), rng.integers(1, 3)
        twofold = rng.uniform() < 0.15
        if twofold:
            n, n_u, n_y = 2, 1, 1
        A = rng.normal(size=(n, n))
        A += (rng.uniform(0.2, 1.5) - np.linalg.eigvals(A).real.max()) * np.eye(n)
        B, C = rng.normal(size=(n, n_u)), rng.normal(size=(n_y, n))
        if twofold:  # two of them, each pulled towards the other
            pull = rng.uniform(0.1, 0.5) * A
            A, B, C = np.block([[A - pull, pull], [pull, A - pull]]), block_diag(B, B), block_diag(C, C)
        weights = {"R_c": 10 ** rng.uniform(-3, 1.5), "R_o": 10 ** rng.uniform(-3, 1.5)}
        gain = 10 ** rng.uniform(np.log10(0.5), np.log10(4))
        assumed = LinearPlant(A, B, C)
        try:
            design = design_lq(assumed, **weights)
            return _with_hold(rng, assumed.scaled(gain), design, twofold)
        except IcmjError:
            continue


def _with_hold(rng: np.random.Generator, actual: LinearPlant, design: Design, twofold: bool) -> Loop:
    name = str(rng.choice(["matched", "zero-order", "own"], p=[0.45, 0.35, 0.2]))
    own = Hold("own", design.A_c - 0.3 * np.eye(design.plant.n))
    hold = {"matched": system_matched(design), "zero-order": zero_order(design), "own": own}[name]
    delay, late = Delay(), "none"
    if rng.uniform() < 0.45:
        t_d = rng.uniform(0.01, 0.15)
        late = str(rng.choice(["predicted", "in part", "not predicted"]))
        delay = Delay(t_d, {"predicted": t_d, "in part": 0.6 * t_d, "not predicted": 0.0}[late])
    which = "box" if twofold else str(rng.choice(["round", "outputs", "box"]))
    rule: EventRule = EventTrigger(np.eye(design.plant.n), 0.01, 1e-4)
    if which == "outputs":
        rule = EventTrigger(output_weight(design), 0.01, 1e-4)
    if which == "box":
        rule = BoxTrigger(0.01, "output" if twofold or rng.uniform() < 0.5 else "state", 1e-4)
    kind = f"{name} hold, delay {late}, {which}{', twofold' if twofold else ''}"
    return Loop(error_system(actual, design, hold, delay=delay), rule, kind)


def fly(loop: Loop, found: PredictedOrbit, off: np.ndarray, events: int) -> tuple[np.ndarray, np.ndarray] | None:
    """The states at events of a run that begins ``off`` an orbit, and their distances from it, in its size.

    ``None`` where the run ends early, or gets far away.
    """
    orbit = found.orbit
    size, left = float(np.linalg.norm(orbit.x_bar)), (events + 2) * orbit.delta
    at = [orbit.x_bar / size + off]
    gap: list[float] = []
    while left > 0 and len(gap) < events - 1:
        # a run begins with an event, and so goes on from one
        run = loop.run(whole(loop.system, size * at[-1]), min(left, (PART + 0.5) * orbit.delta))
        if run.outcome.kind != "completed":
            return None
        if not len(run.events):
            break
        left -= run.events.t[-1]
        for state in loop.states(run, len(off)) / size:
            at.append(state)
            gap.append(min(float(np.linalg.norm(state - s * orbit.x_bar / size)) for s in (1, -1)))
        if max(gap) > FAR:
            return None
    return None if len(gap) < events // 2 else (np.array(at[1:events]), np.array(gap[: events - 1]))


def look(loop: Loop, found: PredictedOrbit, rng: np.random.Generator, away: float, events: int) -> str:
    """What a run that begins so far from an orbit does in so many events: ``back``, ``beside``, ``gone``, ``unclear``.

    ``beside``: it settles on another orbit, at a distance in proportion to that at which it began.
    """
    off = rng.normal(size=len(found.orbit.x_bar))
    flown = fly(loop, found, away * off / np.linalg.norm(off), events)
    if flown is None:
        return "gone"
    at, gap = flown
    last, middle = (float(gap[k - 5 : k].max()) for k in (len(gap), len(gap) // 2))
    if last < BACK * away and (last < 0.9 * middle or last < ROUNDING):
        return "back"
    # mirrored or not, what settles is as two events before, or is on its way to it
    closing, before = (np.linalg.norm(at[k] - at[k - 2]) for k in (-1, len(at) // 2))
    if closing < 1e-3 * last and closing < max(0.9 * before, STILL):
        nearer = fly(loop, found, away / CLOSER * off / np.linalg.norm(off), events)
        beside = nearer is not None and nearer[1][-5:].max() < last / np.sqrt(CLOSER)
        return "beside" if beside else "gone"
    if last > GONE * away:
        return "gone"
    return "unclear"


def measure_growth(loop: Loop, found: PredictedOrbit, rng: np.random.Generator) -> float | None:
    """By which factor from one event to the next a run near an orbit comes to rest, or is driven away."""
    off = rng.normal(size=len(found.orbit.x_bar))
    flown = fly(loop, found, AWAY / NEARER * off / np.linalg.norm(off), EVENTS * AGAIN)
    if flown is None:
        return None
    moved = np.linalg.norm(flown[0][2:] - flown[0][:-2], axis=1)[len(flown[0]) // 2 :]
    return float(np.exp(np.polyfit(np.arange(len(moved)), np.log(np.maximum(moved, 1e-300)), 1)[0]))


SAID = {"attracting": "back", "repelling": "gone", "family": "beside"}


def judge(loop: Loop, found: PredictedOrbit, seed: int) -> tuple[str, str]:
    """What runs do beside an orbit, and whether its verdict says so: ``agrees``, ``differs`` or ``unclear``.

    A family has members so near that a run may also come back to the one that it began at.
    """
    wanted, seen = SAID[found.verdict], ""
    for away, events in ((AWAY, EVENTS), (AWAY / NEARER, EVENTS * AGAIN)):
        seen = look(loop, found, np.random.default_rng(seed), away, events)
        if seen == wanted or (wanted, seen) == ("beside", "back"):
            return seen, "agrees"
    growth, multiplier = measure_growth(loop, found, np.random.default_rng(seed)), found.multiplier
    if growth is not None and multiplier is not None:
        seen = f"{seen}, {growth:.7g} per event"
        if abs(growth - multiplier) < ALIKE * abs(1 - multiplier):
            return seen, "agrees"
    # so many events do not change what is multiplied by so nearly 1
    slow = multiplier is not None and abs(multiplier - 1) * EVENTS * AGAIN < 1
    return seen, "unclear" if slow or seen.startswith("unclear") else "differs"


def check_orbits(seed: int, number: int) -> Iterator[dict[str, object]]:
    """What is found of each admissible orbit of a loop."""
    loop = random_loop(seed, number)
    for i, found in enumerate(loop.predict().orbits):
        if found.verdict in SAID:
            seen, how = judge(loop, found, number)
            yield {
                "seed": seed, "loop": number, "kind": loop.kind, "orbit": i, "words": found.words, "seen": seen,
                "multiplier": found.multiplier, "judged": how, "verdict": found.verdict,
            }  # fmt: skip


def check_starts(seed: int, number: int, starts: int) -> Iterator[dict[str, object]]:
    """What is found of each cycle of one event, or of two mirrored ones, that runs from small states settle on."""
    loop = random_loop(seed, number)
    system, prediction, rng = loop.system, loop.predict(), np.random.default_rng([seed, number, 1])
    for start in range(starts):
        x = 0.02 * rng.normal(size=system.n)
        state = np.concatenate([x, np.zeros(2 * system.n_hat)])
        run = loop.run(state, 200.0)
        if run.outcome.kind != "completed" or len(run.events) < 20:
            continue
        found = measure(run, T_hat=system.T_hat)
        simple = found.p == 1 or (found.p == 2 and found.mirrored)
        if found.kind == "cycle" and simple and found.interval is not None and found.interval < 0.98 * LONGEST:
            here = settled_on(prediction, found) is not None
            yield {
                "seed": seed, "loop": number, "kind": loop.kind, "start": start, "words": found.words,
                "judged": "agrees" if here else "differs", "verdict": "cycle",
            }  # fmt: skip


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--loops", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--first", type=int, default=0, help="the number of the first loop")
    parser.add_argument("--starts", type=int, default=0, help="runs from so many small states instead, of each loop")
    given = parser.parse_args()
    # exponentials of the fastest modes, which SciPy takes to where nothing is asked of them
    warnings.filterwarnings("ignore", "(overflow|invalid value) encountered", RuntimeWarning)
    counted: Counter[str] = Counter()
    for number in range(given.first, given.first + given.loops):
        try:
            rows = list(
                check_starts(given.seed, number, given.starts) if given.starts else check_orbits(given.seed, number)
            )
        except IcmjError as error:
            counted[f"refused: {str(error)[:60]}"] += 1
            continue
        for row in rows:
            counted[f"{row['verdict']}: {row['judged']}"] += 1
            if row["judged"] != "agrees":
                print(json.dumps(row, ensure_ascii=False), flush=True)
        if (number + 1) % 100 == 0:
            print(number + 1, dict(counted), flush=True)
    print(json.dumps(counted, indent=1, ensure_ascii=False))
    return int(any(key.endswith("differs") for key in counted))


if __name__ == "__main__":
    sys.exit(main())
