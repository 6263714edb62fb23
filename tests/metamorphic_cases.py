"""Random run files whose instants coincide, and the rules that every run must obey, whatever its numbers are.

The rules need no oracle: each compares a run with another of the same file, changed so that the answer is known.

* ``later``: what begins at t leaves everything before t as it was, however large or small it is;
* ``longer``: a run of T and a longer one are equal up to T, events at T included;
* ``rows``: there is one at every multiple of its interval; what is recorded changes no bit of the motion, and what is
  measured of it no more than interpolation errs; the first or the last row changes no measure by more than its share;
* ``instants``: what begins on a row, an event or a tick, beside it by rounding, or between them, is exported alike at
  any rate, whatever the rows, and changes nothing that is exported of the time before;
* ``order``: where two instants coincide, the run is the limit of runs in which they follow one another in the order
  that docs/simulation.md states: an edge just before, then the action, then tick or threshold;
* ``shift``: from rest, moving every instant by the same time moves the run;
* ``plants``: linear plant and MuJoCo agree where the sway is small;
* ``routes``: every way to the same run gives the same bits;
* ``units``: with each state, input and output in a unit of its own, and time in milliseconds to hours, the theory and
  the linear plant say the same;
* ``coordinates``: so they do of the states in other, well-conditioned coordinates.

Motions between events can be unstable, so differences grow from rounding to anything. What no smooth motion does is to
jump: from one event to the next a difference may grow by :data:`GROWTH`, and an action that is lost, or an event that
is judged too early, exceeds this by orders of magnitude.
"""

from __future__ import annotations

import random
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.linalg import block_diag

import icmj
from icmj.case.plants import linear_plant
from icmj.measurement.sway import measure_sway
from icmj.simulation.settings import reseed

GROWTH = 1e5  # of a difference, from one event to the next
ROUNDING = 1e-12  # s, of an event on either plant
NONLINEAR = 1e-7  # of the sway, where it is scaled by SMALL
SMALL = 1e-4
JUST = 1e-9  # s, how long before another an instant is that is to come first
SHARES = 20  # of a measure that a row may change it by
EXPORTED = 1e-4  # of a signal, between rows some 2 ms apart; rows of outputs 10 ms apart
QUIET = 1e-12  # the largest value of a signal that consists of rounding
FINE = {"three-link": 0.25}  # of those 2 ms, of bodies that move faster
TURNED = 1e-6  # of a number of the theory, in other coordinates
TOGETHER = 1e-4  # s; motions whose events lie further apart are no longer compared


@dataclass(frozen=True)
class Drawn:
    """A random run.

    Attributes:
        seed: it was drawn with.
        base: the shipped run file that it changes.
        changes: keys of the run file and their values.
        clock: interval of a clock that replaces the event rule [s].
        continuous: whether continuous control replaces it.
        grid: [s] the instants are multiples of it, or of its half.
    """

    seed: int
    base: str
    changes: dict[str, Any]
    clock: float | None
    continuous: bool
    grid: float

    @property
    def intermittent(self) -> bool:
        """Whether the controller has an observer and a hold."""
        return "intermittent" in self.base or self.base in _EVENT

    def changed(self, **changes: Any) -> Drawn:
        """The same with other values."""
        return replace(self, changes={**self.changes, **{key.replace("__", "."): of for key, of in changes.items()}})

    @property
    def duration(self) -> float:
        """Of the run [s]."""
        return float(self.changes["simulation.duration"])

    def __str__(self) -> str:
        return f"seed {self.seed}: {self.base} {self.changes} clock {self.clock} continuous {self.continuous}"


_EVENT = ("runs/rivals/one-link-event.toml", "runs/simple-0.8.toml", "runs/three-link-0.9.toml")
_READING = (
    "runs/rivals/one-link-switching.toml",
    "runs/rivals/one-link-delayed-pd.toml",
    "runs/rivals/one-link-predictor.toml",
    "runs/rivals/three-link-switching.toml",
)
_CHANNELS = _READING[-1]
_HYBRID = tuple(f"examples/hybrid/{name}.toml" for name in ("plain-pd", "hysteresis", "reflex", "alert", "saturating"))
# of what they are made, which scales with the motion
_SIZES = {"q_t": 0.002, "size": 0.02, "level": 0.002, "u_max": 6.0}
_PID = {"kind": "delayed-pid", "switches": None, "I": 50.0, "force_gain": 0.0005, "force_time": 10.0}
# of each: the position that leans, an input with a size that moves the body, an output, the threshold's size
_BODIES = {
    "one-link": ("ankle", "ankle_torque", 1.0, "lean", 2e-3),
    "simple": ("hinge", "torque", 0.02, "angle", 1e-2),
    "three-link": ("ankle", "ankle_torque", 1.0, "shank", 1e-2),
}


def body(base: str) -> tuple[str, str, float, str, float]:
    """What a shipped run file calls its position, input and output, with sizes of a push and of a threshold."""
    if base in _HYBRID:
        return _BODIES["one-link"]
    if base == _CHANNELS:
        return "ankle", "ankle_torque", 1.0, "ankle", 1e-2
    return next(names for body, names in _BODIES.items() if body in base)


def draw(seed: int) -> Drawn:
    """A random run: every controller × set-point × delay × least interval about it × disturbances × rows."""
    rng = random.Random(seed)
    base = rng.choice((*_EVENT[:2] * 4, _EVENT[2], *_READING, *_HYBRID[1:]))
    position, pushed, size, output, threshold = body(base)
    grid = rng.choice((0.02, 0.05, 0.1, 0.125))
    clock, continuous = None, False
    duration = grid * rng.randint(int(2 / grid), int(8 / grid))
    changes: dict[str, Any] = {
        "simulation.duration": duration,
        "simulation.initial": {position: rng.choice((0.0, 0.005, 0.01))},
        "simulation.record_interval": rng.choice((grid / 5, grid, 2 * grid, 0.013)),
        "simulation.timestep": rng.choice((None, None, grid / 20)),
    }
    # most are multiples of the grid, like every other instant; others make events coincide with actions alone
    delays = (0.0, grid, 2 * grid, 3 * grid, round(rng.uniform(0.05, 0.3), 3), round(rng.uniform(0.05, 0.3), 2))
    if base in _EVENT:
        delay = rng.choice(delays)
        changes |= {
            "assumed.delay": delay,
            "actual.gain": rng.choice((0.9, 1.0, 1.1)),
            "controller.delta_min": rng.choice((0.001, 0.001, grid / 2, max(delay, grid), delay + grid)),
            "controller.hold": rng.choice(("system-matched", "system-matched", "zero-order")),
            "controller.q_t": threshold * rng.choice((0.1, 0.3, 1.0, 3.0)),
        }
        kind = rng.choice(("rule", "rule", "rule", "rule", "sampled", "clock", "box", "box" if delay else "continuous"))
        if kind == "sampled":
            changes["controller.sampling_delay"] = grid * rng.choice((0.5, 1, 2))
        elif kind == "clock":
            clock = grid * rng.choice((1, 2, 3))
        elif kind == "continuous":
            continuous = True
        elif kind == "box":
            changes |= {"controller.rule": "box", "controller.q_t": None, "controller.threshold": threshold}
            changes |= {"controller.Q_t": None}
        if rng.random() < 0.4:
            changes["setpoint"] = [_setpoint(rng, output, grid, duration)]
    elif base in _HYBRID:
        changes["assumed.delay"] = rng.choice(delays)
        changes["actual.gain"] = rng.choice((0.9, 1.0, 1.1))
    else:
        changes["assumed.delay"] = max(rng.choice(delays), grid)
        if "delayed-pd" in base and rng.random() < 0.5:
            changes |= {f"controller.{key}": value for key, value in _PID.items()}
        if "predictor" in base and rng.random() < 0.5:
            changes["setpoint"] = [_setpoint(rng, output, grid, duration)]
    shares = base in _EVENT and not continuous
    acting = [
        _disturbance(rng, pushed, output, size, threshold, grid, duration, shares)
        for _ in range(rng.choice((0, 1, 1, 2)))
    ]
    changes["simulation.disturbance"] = acting
    if rng.random() < 0.3:
        # pushed so hard that nearly every event is due at once, where the rule is watched from the last one's action on
        base, clock, continuous = _EVENT[0], None, False
        position, pushed, size, output, threshold = body(base)
        changes = {
            key: of for key, of in changes.items() if key in ("simulation.duration", "simulation.record_interval")
        }
        changes |= {
            "simulation.initial": {position: 0.01},
            "assumed.delay": rng.choice(delays[1:]),
            "controller.delta_min": 0.001,
            "controller.q_t": threshold * rng.choice((0.1, 0.5)),
            "simulation.disturbance": [
                {"kind": "step", "input": pushed, "size": 0.5, "start": grid * rng.randint(0, 20)}
            ],
        }
    return Drawn(seed, base, changes, clock, continuous, grid)


def _start(rng: random.Random, grid: float, duration: float) -> float:
    return grid / 2 * rng.randint(0, int(1.5 * duration / grid))


def _setpoint(rng: random.Random, output: str, grid: float, duration: float) -> dict[str, Any]:
    kind = rng.choice(("step", "pulse", "ramp"))
    found = {"kind": kind, "output": output, "size": rng.choice((0.0047, 0.0113)), "start": _start(rng, grid, duration)}
    return found if kind == "step" else found | {"duration": grid * rng.choice((1, 3, 8))}


def _disturbance(
    rng: random.Random,
    pushed: str,
    output: str,
    size: float,
    threshold: float,
    grid: float,
    duration: float,
    shares: bool,
) -> dict[str, Any]:
    kind = rng.choice(("step", "impulse", "noise", "gaussian", "bias", "sinusoids", "share" if shares else "step"))
    start = _start(rng, grid, duration)
    seed = rng.randrange(1000)
    push, noisy = {"input": pushed, "start": start}, {"input": pushed, "seed": seed, "start": start}
    return {
        "step": {**push, "kind": "step", "size": size * rng.choice((-1, 1, 1e-6))},
        "impulse": {**push, "kind": "impulse", "size": size * grid, "duration": grid},
        "noise": {**noisy, "kind": "noise", "size": size / 2, "corner": 1.0},
        "gaussian": {**noisy, "kind": "gaussian", "size": size / 2, "interval": grid / 2},
        "share": {**noisy, "kind": "gaussian", "share": 0.1, "interval": grid / 2},
        "bias": {"kind": "bias", "output": output, "size": threshold * rng.choice((0.2, 2.1)), "start": start},
        "sinusoids": {"kind": "sinusoids", "input": pushed, "terms": [[size, 3.0, 0.5, start, start + 4 * grid]]},
    }[kind]  # fmt: skip


def file_of(drawn: Drawn) -> icmj.RunFile:
    """Its run file."""
    return icmj.load_run(drawn.base, allow_code=drawn.base in _HYBRID).with_(**drawn.changes)


def trigger_of(drawn: Drawn) -> icmj.controller.Trigger | None:
    """What replaces its event rule."""
    if drawn.clock is not None:
        return icmj.ClockTrigger(drawn.clock)
    return icmj.Continuous() if drawn.continuous else None


def play(drawn: Drawn, plant: str) -> icmj.Simulation:
    """Carry it out."""
    return icmj.simulate(icmj.prepare(file_of(drawn)), plant, trigger=trigger_of(drawn))  # type: ignore[arg-type]


def differ(
    a: icmj.Simulation, b: icmj.Simulation, until: float, floor: float, shift: float = 0.0, least: float = 1e-9
) -> str:
    """How two runs differ before ``until`` more than what was there before can have grown to; empty if they do not.

    ``floor`` is the difference that they begin with, of the times of events [s] and, relative to the largest, of
    states; ``b`` is later by ``shift``. A motion smaller than ``least`` is that of rounding.
    """
    here, there = a.events.t, b.events.t - shift
    last, close = floor, until
    for k in range(max(len(here), len(there))):
        one = here[k] if k < len(here) else np.inf
        two = there[k] if k < len(there) else np.inf
        first = min(one, two)
        if first > until:
            break
        # an event that the other has not is late by what is left at least
        by = abs(one - two) if max(one, two) < np.inf else until - first
        if by > GROWTH * last:
            return f"event {k} of {first:.9f} s differs by {by:.2e} s, the one before by {last:.2e}"
        last = max(last, by)
        if last > TOGETHER:
            close = first
            break
    # rows that both have, as long as they go together
    rows, others = a.t < close - 1e-9, b.t - shift
    place = np.clip(np.searchsorted(others, a.t - 1e-9), 0, len(others) - 1)
    rows &= np.abs(others[place] - a.t) < 1e-9
    # beside an event, one of them may have it on the other side
    for t in (*here, *there):
        rows &= np.abs(a.t - t) > 10 * TOGETHER
    if rows.any():
        # where nothing but an observer moves, the plant moves by rounding of what that does; what is smaller still
        # is rounding of the sizes that the files state
        size = max(np.abs(a.x).max(), np.abs(a.x_o).max(initial=0.0), least)
        worst = float(np.abs(a.x[rows] - b.x[place[rows]]).max() / size)
        if worst > GROWTH * max(last, floor):
            return f"rows differ by {worst:.2e} of the largest, events by {last:.2e} s"
    return ""


def _later(drawn: Drawn, rng: random.Random, plant: str) -> str:
    _, pushed, size, output, _ = body(drawn.base)
    start = drawn.grid * rng.randint(int(0.3 * drawn.duration / drawn.grid) + 1, int(drawn.duration / drawn.grid))
    more = {"kind": "step", "input": pushed, "size": size * rng.choice((1e-9, 1.0, 10.0)), "start": start}
    key = "simulation.disturbance"
    if drawn.base in _EVENT and "setpoint" in drawn.changes and rng.random() < 0.3:
        key, more = "setpoint", {"kind": "step", "output": output, "size": 0.02, "start": start}
    other = replace(drawn, changes={**drawn.changes, key: [*drawn.changes.get(key, []), more]})
    return differ(play(drawn, plant), play(other, plant), start - JUST, ROUNDING if plant == "linear" else 1e-9)


def _longer(drawn: Drawn, rng: random.Random, plant: str) -> str:
    longer = drawn.changed(simulation__duration=drawn.duration + drawn.grid * rng.choice((0.5, 1, 7)))
    a, b = play(drawn, plant), play(longer, plant)
    return differ(a, b, min(drawn.duration, a.t[-1]), ROUNDING if plant == "linear" else 1e-9)


def _rows(drawn: Drawn, rng: random.Random, plant: str) -> str:
    other = drawn.changed(simulation__record_interval=drawn.grid * rng.choice((0.31, 0.5, 1, 3, 100)))
    a, b = play(drawn, plant).events, play(other, plant).events
    for name in ("t", "x", "x_o", "x_h"):
        if not np.array_equal(getattr(a, name), getattr(b, name), equal_nan=True):
            return f"rows at another interval change {name} of events"
    if words := _measured(drawn, rng, plant):
        return words
    # extremes in MuJoCo are those of polynomials through samples, of which rows are some: few within short intervals
    size = max(np.abs(a.y_max).max(initial=0.0), np.abs(a.y_min).max(initial=0.0))
    for name in ("y_max", "y_min"):
        one, other = getattr(a, name), getattr(b, name)
        close = 0.0 if plant == "linear" else 1e-5 * size
        if not np.allclose(one, other, rtol=0, atol=close):
            return f"rows at another interval change {name} of events by {np.abs(one - other).max():.1e}"
    return ""


def exported(run: icmj.Simulation, drawn: Drawn, rate: float) -> icmj.Series:
    """Its signals at a rate [Hz], as `icmj export` gives them."""
    law = icmj.prepare(file_of(drawn)).controller
    trigger = trigger_of(drawn)
    if trigger is not None:
        law = law.triggered_by(trigger)
    return run.to_series(rate, law)


def _share(series: icmj.Series, rows: slice) -> str:
    """How a measure of a record without some rows differs by more than their share; empty if none does.

    A mean over n rows changes by 1/n of the largest thing that it is a mean of; what is a mean of squares, or a root,
    or follows from a spectrum, by some such shares of its own size: :data:`SHARES` of them, as of a motion that grows
    by this factor over the record. The share of the power below a median frequency changes by as much. What follows
    from a spectrum is a quotient of two sums over windows, which move by a row: where a motion falls within few rows,
    it may change by twice what that does to their power.
    """
    part = replace(series, t=series.t[rows], values=series.values[rows])
    whole, rest = measure_sway(series), measure_sway(part)
    one, other = whole.coordinates, rest.coordinates
    share = SHARES * (len(series) - len(part)) / len(part)
    spacing = 2 / (series.t[-1] - series.t[0])  # of the spectrum's lines, which are as fine as its windows are long
    for place, (a, b) in enumerate(zip(one, other, strict=True)):
        path = np.abs(np.diff(series[a.name])).max() / (series.t[1] - series.t[0])
        of_power = max(share, 2 * _moved(series[a.name]))
        for name, first, second, most in (
            ("mean", a.mean, b.mean, share * a.range),
            ("rms", a.rms, b.rms, share * a.range),
            ("mean distance", a.mean_distance, b.mean_distance, share * a.range),
            ("speed", a.speed, b.speed, share * path),
            ("mean frequency", a.frequencies.mean, b.frequencies.mean, of_power * (a.frequencies.mean + spacing)),
        ):
            if np.isnan(first) != np.isnan(second) or abs(first - second) > most:
                return f"{name} of {a.name} is {first:.6g} of all rows and {second:.6g} of all but {len(series)}"
        below = _power_below(whole.spectrum.frequency, whole.spectrum.power[:, place], b.frequencies.median)
        still = np.isnan(a.frequencies.median) and np.isnan(b.frequencies.median)
        if not (still or abs(below - 0.5) <= of_power):
            return (
                f"of the power of {a.name}, {below:.4f} lies below its median frequency of all rows but {len(series)}"
            )
    return ""


def _moved(values: np.ndarray) -> float:
    """The share of a signal's power in windows of half its length that may come or go where they move by a row.

    Hann's window is sin²(πk/L) at row k of L, so a square there changes by 4π/L |cot(πk/L)| of itself: on average by 11
    rows' share of an even motion, by more where most of the motion is beside an end. And a window's mean, which is
    taken off, changes by a row in place of another over L: by much where a body at rest falls in the last rows.
    """
    length, changed, power = len(values) // 2, 0.0, 0.0
    turn = np.pi * np.arange(1, length) / length
    for first in (0, (len(values) - length) // 2, len(values) - length):
        part = values[first : first + length]
        about, weight = (part - part.mean())[1:], np.sin(turn) ** 4
        power += (about**2 * weight).sum()
        changed += 4 * np.pi / length * (about**2 * weight / np.abs(np.tan(turn))).sum()
        changed += 2 * np.abs(part[-1] - part[0]) / length * (np.abs(about) * weight).sum()
    return float(changed / power) if power > 0 else 0.0


def _power_below(frequency: np.ndarray, power: np.ndarray, edge: float) -> float:
    """The share of the power of a spectrum below a frequency, by trapezoids as :func:`frequencies` counts it.

    A median is judged by it: where it lies between two peaks, far apart as the lines of a short record are, it moves
    by much when half of the power moves by little.
    """
    below = np.concatenate([[0.0], np.cumsum(np.diff(frequency) * (power[1:] + power[:-1]) / 2)])
    return float(np.interp(edge, frequency, below / below[-1])) if below[-1] > 0 else float("nan")


def _measured(drawn: Drawn, rng: random.Random, plant: str) -> str:
    """What is measured at 100 Hz, whatever was recorded, and whether the first or the last row is there."""
    fine = drawn.changed(simulation__record_interval=0.005, simulation__timestep=None)
    run = play(fine, plant)
    series = exported(run, drawn, 100.0)
    outputs = [name for name in series.names if name.startswith("y.")]
    found = series.chosen(outputs)
    if len(found) < 30:
        return ""
    for rows in (slice(1, None), slice(None, -1)):
        if words := _share(found, rows):
            return words
    coarse = play(fine.changed(simulation__record_interval=0.01), plant)
    for rare, interval in ((run, 0.005), (coarse, 0.01)):
        # of a fall the last row alone is beyond the limit: those due between it and that before are not recorded
        fell = rare.outcome.kind == "fell"
        due = interval * np.arange(int((rare.t[-2] if fell else rare.t[-1]) / interval + 1e-9) + 1)
        lost = due[np.abs(rare.t[np.searchsorted(rare.t, due - 1e-9)] - due) > 1e-9]
        if len(lost):
            return f"no row at {lost[0]:.6f} s, where rows are {interval} s apart"
    other = exported(coarse, drawn, 100.0).chosen(outputs)
    off = np.abs(other.values - found.values[: len(other)]).max() / max(np.abs(found.values).max(), 1e-9)
    return f"outputs at 100 Hz differ by {off:.1e} of the largest, by the interval of rows" if off > EXPORTED else ""


def few_rows(run: icmj.Simulation, t: np.ndarray) -> np.ndarray:
    """Whether fewer than four rows of a run lie in the piece between two breaks in which each instant lies."""
    led = run.leads[:, 0] if run.leads.size else run.edges
    breaks = np.unique(np.concatenate([run.events.t, run.actions, run.edges, run.switches, led]))
    rows = np.diff(np.searchsorted(run.t, [-np.inf, *(breaks + 1e-9), np.inf]))
    return np.asarray(rows[np.searchsorted(breaks, t - 1e-9)] < 4)


def _instants(drawn: Drawn, rng: random.Random, plant: str) -> str:
    """A step on an instant of the grid, where rows, ticks and events are, or between, with rows of any interval.

    As docs/data.md says, a spline is of fourth order in the distance of rows where that is short beside the motion, and
    rounds off the corners of Gaussian noise and of a box's event function, and is of lower order where there are fewer
    than four rows between two breaks: there nothing is asked.
    """
    acting = drawn.changes.get("simulation.disturbance", [])
    if any(of["kind"] == "gaussian" for of in acting):  # it bends at every point of its grid, where no row is
        return "skipped"
    _, pushed, size, _, _ = body(drawn.base)
    start = drawn.grid * rng.randint(2, max(int(drawn.duration / drawn.grid) - 1, 2)) + rng.choice((0.0, 0.0, 0.00237))
    key = "simulation.disturbance"

    def with_step(at: float | None, interval: float) -> Drawn:
        more = [] if at is None else [{"kind": "step", "input": pushed, "size": size, "start": at}]
        changes = {**drawn.changes, key: [*drawn.changes.get(key, []), *more]}
        return replace(drawn, changes={**changes, "simulation.record_interval": interval, "simulation.timestep": None})

    def sizes(found: icmj.Series) -> np.ndarray:
        largest = np.nanmax(np.abs(found.values), axis=0)
        return np.where(largest > QUIET, largest, 1.0)

    cornered = {"interval", "E"} if drawn.changes.get("controller.rule") == "box" else {"interval"}
    close, closer = (next((by for name, by in FINE.items() if name in drawn.base), 1.0) * h for h in (0.002, 0.00137))
    rate, runs = rng.choice((100.0, 331.0, 1000.0)), {}
    for interval in (close, closer, 1 / rate):
        one = with_step(start, interval)
        runs[interval] = run = play(one, plant)
        found = exported(run, one, rate)
        if interval == close:
            first = found
    known, names, size_of = found, first.names, sizes(found)
    for interval in (close, closer):
        found = exported(runs[interval], with_step(start, interval), rate)
        off = np.nan_to_num(np.abs(found.values - known.values[: len(found)]) / size_of)
        off[:, [name in cornered for name in names]] = 0
        off[few_rows(runs[interval], found.t)] = 0
        at = np.unravel_index(off.argmax(), off.shape)
        if off[at] > EXPORTED:
            return f"{names[at[1]]} at {found.t[at[0]]:.6f} s differs by {off[at]:.1e}, of rows {interval} s apart"
    # rows of an instant that is another by rounding only
    floor = ROUNDING if plant == "linear" else 1e-9
    for slip in (-4e-13, 4e-13):
        if words := differ(runs[close], play(with_step(start + slip, close), plant), drawn.duration, floor):
            return f"{words}, where it is {slip:g} s later"
    before = exported(play(with_step(None, close), plant), with_step(None, close), rate)
    rows = min(int((first.t < start - 1e-9).sum()), len(before))
    for name in sorted(set(before.names) - cornered):
        off = np.nan_to_num(np.abs(first[name][:rows] - before[name][:rows])) / size_of[known.place(name)]
        off[few_rows(runs[close], first.t[:rows])] = 0  # the step is a break, and may leave few before it
        if off.max() > EXPORTED:
            return f"{name} at {first.t[off.argmax()]:.6f} s differs by {off.max():.1e} by a step at {start:.6f} s"
    return ""


def _order(drawn: Drawn, rng: random.Random, plant: str) -> str:
    """Edges first: the run is that whose edges come just before. Then actions: before ticks that fall on them."""

    def before(source: dict[str, Any]) -> dict[str, Any]:
        if source["kind"] == "sinusoids":
            terms = [[*term[:3], max(term[3] - JUST, 0.0), term[4] - JUST] for term in source["terms"]]
            return {**source, "terms": terms}
        if source["kind"] == "gaussian" or not source.get("start"):
            return source
        return {**source, "start": source["start"] - JUST}

    other = drawn
    for key in ("simulation.disturbance", "setpoint"):
        if key in drawn.changes:
            other = replace(other, changes={**other.changes, key: [before(of) for of in drawn.changes[key]]})
    if drawn.clock is not None and drawn.changes["assumed.delay"]:
        other = other.changed(assumed__delay=drawn.changes["assumed.delay"] - JUST)
    return differ(play(drawn, plant), play(other, plant), drawn.duration - 2 * JUST, 10 * JUST)


def _shift(drawn: Drawn, rng: random.Random, plant: str) -> str:
    shift = drawn.grid * rng.choice((1, 2, 5))
    still = {"step", "impulse", "pulse", "bias", "ramp"}
    kinds = [source for key in ("simulation.disturbance", "setpoint") for source in drawn.changes.get(key, [])]
    if drawn.clock is not None or drawn.base not in _EVENT or any(of["kind"] not in still for of in kinds):
        return "skipped"
    # late enough for the least interval after the start to be over, whose end is not moved
    late = drawn.grid * max(8, int(drawn.changes.get("assumed.delay", 0.0) / drawn.grid) + 2)
    begun = {}
    for key in ("simulation.disturbance", "setpoint"):
        if key in drawn.changes:
            begun[key] = [{**of, "start": of.get("start", 0.0) + late} for of in drawn.changes[key]]
    base = replace(drawn, changes={**drawn.changes, **begun, "simulation.initial": {}})
    base = base.changed(simulation__duration=drawn.duration + late)
    moved = {key: [{**of, "start": of["start"] + shift} for of in sources] for key, sources in begun.items()}
    other = replace(base, changes={**base.changes, **moved})
    other = other.changed(simulation__duration=base.duration + shift)
    a, b = play(base, plant), play(other, plant)
    # at rest until the controller takes up the set-point, the plant moves by rounding of how far that has moved
    least = max([1e-9, *(abs(of["size"]) for of in begun.get("setpoint", []))])
    return differ(a, b, min(base.duration, a.t[-1]) - JUST, 1e-11 if plant == "linear" else 1e-9, shift, least)


def scaled(drawn: Drawn, by: float) -> Drawn:
    """The same with every size in proportion: on the linear plant, the same motion."""
    changes = dict(drawn.changes)
    for key in ("controller.q_t", "controller.threshold"):
        if changes.get(key):
            changes[key] = changes[key] * by
    if drawn.base in _HYBRID:
        held = dict(file_of(drawn).model_dump()["controller"]["parameters"])
        named = {
            "hysteresis": ["q_t"],
            "reflex": ["q_t"],
            "alert": ["q_t", "size", "level"],
            "saturating": ["q_t", "u_max"],
        }
        for name in named[Path(drawn.base).stem]:
            held[name] = held.get(name, _SIZES[name]) * by
        changes["controller.parameters"] = held
    elif drawn.base == _CHANNELS:
        channels = icmj.load_run(drawn.base).model_dump()["controller"]["channel"]
        changes["controller.channel"] = [{**channel, "dead_zone": 0.004 * by} for channel in channels]
    elif "switching" in drawn.base:
        changes["controller.dead_zone"] = 0.004 * by
    changes["simulation.initial"] = {name: value * by for name, value in changes["simulation.initial"].items()}

    def size(source: dict[str, Any]) -> dict[str, Any]:
        if "terms" in source and source["kind"] == "sinusoids":
            return {**source, "terms": [[term[0] * by, *term[1:]] for term in source["terms"]]}
        return {**source, "size": source["size"] * by} if "size" in source else source

    for key in ("simulation.disturbance", "setpoint"):
        if key in changes:
            changes[key] = [size(of) for of in changes[key]]
    return replace(drawn, changes=changes)


def _plants(drawn: Drawn, rng: random.Random, plant: str) -> str:
    words = ""
    # where they differ by what is nonlinear, they do not at a hundredth of the sway
    for by in (SMALL, SMALL / 100):
        small = scaled(drawn, by).changed(simulation__timestep=None)
        a, b = play(small, "linear"), play(small, "mujoco")
        large = a.t[np.abs(a.x).max(axis=1) > 1e-3]  # rad: from there on it falls
        until = min(drawn.duration, a.t[-1], b.t[-1], *large[:1])
        words = differ(a, b, until - 1e-6, NONLINEAR)
        if not words:
            return ""
    return words


def _signals(run: icmj.Simulation) -> dict[str, np.ndarray]:
    """All that a run holds, as arrays."""
    found = {name: getattr(run, name) for name in ("t", "x", "y", "u", "x_o", "x_h", "E", "applied")}
    return found | {"events": run.events.t, "before": run.events.x, "jumps": run.jumps, "leads": run.leads}


def _routes(drawn: Drawn, rng: random.Random, plant: str) -> str:
    """By its parts, by its log, as one of many: the same bits (tests/case/test_routes.py has all ways)."""
    run = file_of(drawn)
    case, trigger = icmj.prepare(run), trigger_of(drawn)
    if trigger is not None:
        case = replace(case, controller=case.controller.triggered_by(trigger))
    way = rng.choice(("parts", "many") if trigger is not None or rng.random() < 0.8 else ("log",))
    settings = case.settings
    if way == "many":
        settings = replace(settings, duration=settings.duration)
        case = replace(case, settings=reseed(settings, 7))
    expected = _signals(icmj.simulate(case, plant))
    if way == "parts":
        there = linear_plant(case.actual, case.settings) if plant == "linear" else case.actual
        found = _signals(icmj.simulate_plant(there, case.controller, case.settings, match="position"))
    elif way == "many":
        case = replace(case, settings=settings)
        found = icmj.simulate_many(case, 1, plant=plant, seeds=[7], keep=_signals, jobs=1).kept
        found = {name: values[0] for name, values in found.items()}
    else:
        with tempfile.TemporaryDirectory() as folder:
            quiet = run.with_(**{"study.growth_points": 0, "study.law_q_t": None, "study.attractor_starts": 0})
            icmj.write_log(icmj.run_case(quiet, plant), Path(folder) / "run.rrd")
            found = _signals(icmj.read_log(Path(folder) / "run.rrd").simulation)
    for name, values in expected.items():
        if not np.array_equal(values, found[name], equal_nan=True):
            return f"{name} is another by way of {way}"
    return ""


@dataclass(frozen=True)
class Turn:
    """Other coordinates: x = M x', u = U u', y = Y y', and ``time`` seconds as the unit of time."""

    M: np.ndarray
    U: np.ndarray
    Y: np.ndarray
    time: float = 1.0

    def plant(self, P: icmj.LinearPlant) -> icmj.LinearPlant:
        A, B = (np.linalg.solve(self.M, part) * self.time for part in (P.A @ self.M, P.B * self.U))
        return icmj.LinearPlant(A, B, P.C @ self.M / self.Y[:, None], P.states, P.inputs, P.outputs)

    def controller(self, law: icmj.Controller) -> icmj.Controller:
        M, rule = self.M, law.trigger
        turned = {
            "Q_t": lambda Q_t: (M.T @ Q_t @ M + (M.T @ Q_t @ M).T) / 2,
            "threshold": lambda threshold: threshold / self.Y,
            "delta_min": lambda shortest: shortest / self.time,
            "interval": lambda interval: interval / self.time,
        }
        known = [of.name for of in fields(rule) if of.name in turned]  # type: ignore[arg-type]
        k, L = law.design.k @ M / self.U[:, None], np.linalg.solve(M, law.design.L * self.Y) * self.time
        return icmj.Controller(
            icmj.Design(self.plant(law.plant), k, L),
            icmj.Hold(law.hold.name, np.linalg.solve(M, law.hold.A_h @ M) * self.time),
            replace(rule, **{name: turned[name](getattr(rule, name)) for name in known}),  # type: ignore[type-var]
            icmj.Delay(law.delay.t_d / self.time),
            sampling_delay=law.sampling_delay / self.time,
        )


def _widen(plant: icmj.LinearPlant, law: icmj.Controller, m: int) -> tuple[icmj.LinearPlant, icmj.Controller]:
    """The same loop beside m integrators in a chain, as place and speed are, that nothing drives or reads."""
    names, chain, rule = tuple("pqr"[:m]), np.eye(m, k=1), law.trigger

    def wider(P: icmj.LinearPlant) -> icmj.LinearPlant:
        B, C = np.pad(P.B, ((0, m), (0, 0))), np.pad(P.C, ((0, 0), (0, m)))
        return icmj.LinearPlant(block_diag(P.A, chain), B, C, (*P.states, *names), P.inputs, P.outputs)

    design = icmj.Design(
        wider(law.plant), np.pad(law.design.k, ((0, 0), (0, m))), np.pad(law.design.L, ((0, m), (0, 0)))
    )
    held = icmj.Hold(law.hold.name, block_diag(law.hold.A_h, chain * bool(law.hold.A_h.any())))
    if isinstance(rule, icmj.EventTrigger):
        rule = replace(rule, Q_t=np.pad(rule.Q_t, (0, m)))
    return wider(plant), replace(law, design=design, hold=held, trigger=rule)


def _otherwise(drawn: Drawn, rng: random.Random, turn_of: Callable[[int, int, int], Turn]) -> str:
    """How theory and linear plant differ in other coordinates, for runs from a start state; empty if they do not."""
    if drawn.base not in _EVENT:
        return "skipped"
    plain = replace(drawn, changes={**drawn.changes, "setpoint": [], "simulation.disturbance": []})
    case, trigger = icmj.prepare(file_of(plain)), trigger_of(plain)
    law = case.controller if trigger is None else case.controller.triggered_by(trigger)
    plant = case.actual.linearisation.plant
    if rng.random() < 0.5:
        # with a delay the theory refuses neutral modes
        plant, law = _widen(plant, replace(law, delay=icmj.Delay()), rng.choice((2, 3)))
    turn = turn_of(plant.n, plant.n_u, plant.n_y)
    x0, hour = np.array([plain.changes["simulation.initial"].get(name, 0.0) for name in plant.states]), turn.time
    loops = ((plant, law, x0, 1.0), (turn.plant(plant), turn.controller(law), np.linalg.solve(turn.M, x0), hour))

    def run(there: icmj.LinearPlant, of: icmj.Controller, start: np.ndarray, unit: float) -> icmj.Simulation:
        settings = icmj.Settings(duration=drawn.duration / unit, record_interval=0.01 / unit, limit=1e9)
        return icmj.simulate_plant(there, of, settings, x0=start)

    def foretell(there: icmj.LinearPlant, of: icmj.Controller, start: np.ndarray, unit: float) -> icmj.Prediction:
        system = icmj.error_system(there, of.design, of.hold, delay=of.delay)
        return icmj.predict(system, of.trigger, delta_max=3.0 / unit)  # type: ignore[arg-type]

    a, b = (run(*loop) for loop in loops)
    events = replace(b.events, t=b.events.t * hour)
    b = replace(b, t=b.t * hour, x=b.x @ turn.M.T, x_o=b.x_o @ turn.M.T, events=events)
    words = differ(a, b, min(a.t[-1], b.t[-1]) * (1 - JUST), ROUNDING)
    if words or law.kind != "event" or law.sampling_delay:
        return words
    here = foretell(*loops[0])
    try:
        there = foretell(*loops[1])
    except icmj.IcmjError as error:
        return f"the theory refuses the other: {error}"
    told = [
        ([(c.kind, c.direction) for c in p.crossings], [one.verdict for one in p.orbits],
         [(mode.kind, len(mode.rates)) for mode in p.neutral], p.state_feedback_stable, p.observer_feedback_stable)
        for p in (here, there)
    ]  # fmt: skip
    if told[0] != told[1]:
        return f"the theory says {told[1]} instead of {told[0]}"
    for c, o in zip(here.crossings, there.crossings, strict=True):
        if abs(c.delta - o.delta * hour) > TURNED * c.delta:
            return f"the crossing at {c.delta:.9f} s is at {o.delta * hour:.9f} s"
    for one, other in zip(here.orbits, there.orbits, strict=True):
        peaks = np.hstack([one.orbit.y_peak, one.orbit.u_peak])
        others = np.hstack([other.orbit.y_peak * turn.Y, other.orbit.u_peak * turn.U])
        if one.family is None and not np.allclose(others, peaks, rtol=TURNED, atol=TURNED * QUIET, equal_nan=True):
            return f"peaks at {one.crossing.delta:.6f} s are {others} instead of {peaks}"
    return ""


def _units(drawn: Drawn, rng: random.Random, plant: str) -> str:
    def turn(*counts: int) -> Turn:
        x, u, y = (
            np.array([rng.choice((180 / np.pi, 10.0 ** rng.randint(-3, 3))) for _ in range(count)]) for count in counts
        )
        return Turn(np.diag(x), u, y, rng.choice((1e-3, 1.0, 60.0, 3600.0)))

    return _otherwise(drawn, rng, turn)


def _coordinates(drawn: Drawn, rng: random.Random, plant: str) -> str:
    def turn(n: int, n_u: int, n_y: int) -> Turn:
        normal = np.random.default_rng(rng.randrange(10**6)).normal
        one, other = (np.linalg.qr(normal(size=(n, n)))[0] for _ in range(2))
        return Turn(one * np.geomspace(1, rng.choice((1, 3, 10)), n) @ other, np.ones(n_u), np.ones(n_y))

    return _otherwise(drawn, rng, turn)


RULES: dict[str, Callable[[Drawn, random.Random, str], str]] = {
    "later": _later,
    "longer": _longer,
    "rows": _rows,
    "instants": _instants,
    "order": _order,
    "shift": _shift,
    "plants": _plants,
    "routes": _routes,
    "units": _units,
    "coordinates": _coordinates,
}
LINEAR = ("plants", "units", "coordinates")  # the rules that are put to the linear plant only, or to both together


@dataclass
class Tally:
    """What a hunt has found: how many runs obeyed each rule, were refused, or failed it."""

    obeyed: Counter[str] = field(default_factory=Counter)
    refused: Counter[str] = field(default_factory=Counter)
    failures: list[str] = field(default_factory=list)

    def __str__(self) -> str:
        rules = ", ".join(f"{rule} {self.obeyed[rule]} (refused {self.refused[rule]})" for rule in RULES)
        return f"{sum(self.obeyed.values())} runs obey: {rules}; {len(self.failures)} failures"


def check(rule: str, seed: int, plant: str) -> str | None:
    """What a random run does against a rule; ``None`` if it is refused, or the rule does not apply to it."""
    drawn, rng = draw(seed), random.Random(seed + 1)
    try:
        words = RULES[rule](drawn, rng, plant)
    except icmj.IcmjError:
        return None
    return None if words == "skipped" else words


def hunt(
    seeds: Iterable[int], seconds: float = np.inf, rules: Iterable[str] = RULES, tally: Tally | None = None
) -> Tally:
    """Put random runs to all rules, on both plants, until the time is over; counted in ``tally`` as it goes."""
    tally, begin = Tally() if tally is None else tally, time.monotonic()
    for seed in seeds:
        for rule in rules:
            for plant in ("linear",) if rule in LINEAR else ("linear", "mujoco"):
                if time.monotonic() - begin > seconds:
                    return tally
                words = check(rule, seed, plant)
                if words is None:
                    tally.refused[rule] += 1
                elif words:
                    tally.failures.append(f"{rule} on {plant}: {words}; {draw(seed)}")
                else:
                    tally.obeyed[rule] += 1
    return tally
