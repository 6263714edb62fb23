"""The estimated time of a case before it starts: from its settings and, if it is long, from a small part of it.

An estimate is there to tell seconds from hours. It knows nothing of events still to come.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np

from icmj.base.array import Array
from icmj.base.numbers import format_duration
from icmj.case.case import Case, PlantKind, expect_measures
from icmj.case.plants import linear_plant
from icmj.engine.composition import goes_by_steps
from icmj.engine.plant import MujocoPlant
from icmj.engine.run import simulate as simulate_mujoco
from icmj.engine.schedule import find_fastest_rate
from icmj.errors import SimulationError, StudyError, prefix_errors
from icmj.linear.run import simulate as simulate_linear
from icmj.plant.linear_plant import match_ports
from icmj.simulation.disturbance import make_acting
from icmj.simulation.settings import Settings
from icmj.simulation.sources import Gridded
from icmj.simulation.start import start_states

LONGEST = 60.0  # s of estimated work that is started without being asked twice
STEPS, STRETCHES, ROWS = 1e6, 1e4, 2e5  # up to these a run takes a few seconds at most
MEMORY = 1.9e9  # bytes that a run may take without being asked twice
_OWN, _PER_NUMBER = 0.4e9, 60.0  # bytes: of the libraries, and of each number while a log is written
SERIES = 1e6  # the same on the linear plant
_TERMS = 100  # sinusoids that take as long as all else of a step
_PER_ROW = 1.5e-5  # s to pose, write and read back one row
_PER_TRIAL = 5e-3  # s to begin a trial of an experiment, and to write and read it
_KEPT = 64.0  # bytes of a row of a trial, all of which are analysed together
_PROBE = 0.1  # s of simulation to estimate from
_LONGEST_PROBE = 2.0  # s of work after which a probe is ended: what takes long may begin to act in its middle
_OTHER_STARTS = 3.0  # runs that one random start takes on average, longer ones among them


def startable(case: Case, plant: PlantKind) -> None:
    """See that a run of the case can start, before anything is written for it.

    Raises:
        ModelError, SimulationError, AnalysisError: if it cannot.
        RunFileError: if its own measures may not be called.
    """
    expect_measures(case.run)
    law, settings, there = case.controller, case.settings, linear_plant(case.actual, case.settings)
    with prefix_errors(case.run.path):
        start_states(there, law, settings)
        if plant == "mujoco":
            _ = case.stepping  # steps that cannot be taken are refused here


def estimate(case: Case, plant: PlantKind, *, study: bool = False) -> float:
    """Seconds that :func:`icmj.study.study.run_case` will take, about; 0 where it is plainly quick."""
    settings, keys, law = case.settings, case.run.study, case.controller
    simulated, growth = settings.duration, 0.0
    if study and case.prediction is not None:
        repeats = 1.5  # the run, and continuous control, which has no events
        repeats += _OTHER_STARTS * keys.attractor_starts if plant == "linear" else len(keys.law_q_t)
        growth = keys.growth_points * 3.5 * 1.25 * (case.prediction.delta_crit or case.run.analysis.delta_max)
        simulated = repeats * settings.duration + growth
    elif plant == "mujoco" and not law.observed:  # its last seconds are flown twice more
        simulated += 2 * min(simulated, 2 * max(1.0, 3 * float(law.realisation.taps[-1])))
    return _seconds(case, plant, simulated, settings.duration / settings.record_interval, growth)


def estimate_trials(case: Case, plant: PlantKind, count: int) -> float:
    """Seconds that ``count`` runs of a case will take, about, with nothing but their recordings."""
    simulated = count * case.settings.duration
    return _PER_TRIAL * count + _seconds(case, plant, simulated, simulated / case.settings.record_interval)


def _seconds(case: Case, plant: PlantKind, simulated: float, rows: float, growth: float = 0.0) -> float:
    """Seconds of work for so many ``simulated`` seconds, of which ``growth`` begin near rest, and rows."""
    weight = 1 + len(_acting(case)) / _TERMS  # each is evaluated at every step
    if plant == "linear":
        steps, few = simulated * _rate(case), SERIES
    else:
        steps, few = simulated / _timestep(case), STEPS if goes_by_steps(case.controller) else STRETCHES
    seconds = _PER_ROW * rows
    if weight * steps > few or rows > ROWS:
        try:
            seconds += simulated * _pace(case, plant, case.settings)
        except _EarlyEnd:  # soon over; what is driven by the clock begins near rest, and is not
            with suppress(_EarlyEnd):
                seconds += growth * _pace(case, plant, replace(case.settings, initial={}, observer={}))
    return seconds


def refuse_long(case: Case, plant: PlantKind, seconds: float, longest: float | None, *, study: bool = False) -> None:
    """Check that the estimate of a case does not exceed a limit.

    Raises:
        StudyError: if ``seconds`` is more than ``longest`` [s], or its rows take more memory than :data:`MEMORY` while
            the log is written; it says what would make it smaller.
    """
    settings = case.settings
    rows = settings.duration / settings.record_interval
    if longest is not None and rows > ROWS and (taken := _OWN + _PER_NUMBER * rows * _columns(case, study)) > MEMORY:
        raise StudyError(
            f"{case.run.path}: {case.run.case.name} ({plant}) would take about {taken / 1e9:.2g} GB of memory "
            f"({rows:.2g} rows); raise simulation.record_interval, or start it with --yes"
        )
    if longest is None or seconds <= longest:
        return
    what = [f"{rows:.2g} rows"] if rows > ROWS else []
    if plant == "mujoco" and settings.duration / _timestep(case) > STEPS:
        what.insert(0, f"{settings.duration / _timestep(case):.2g} steps of {_timestep(case):g} s")
    asked = f" ({', '.join(what)})" if what else ""
    raise StudyError(
        f"{case.run.path}: {case.run.case.name} ({plant}) would take about {format_duration(seconds)}{asked}; shorten "
        f"it (simulation.duration, timestep, record_interval{', study' if study else ''}), or start it with --yes"
    )


def refuse_trials(path: Path, work: Sequence[tuple[Case, PlantKind, int]], jobs: int, longest: float) -> None:
    """Check that the trials of an experiment, so many of each case on a plant, do not exceed a limit.

    Raises:
        StudyError: if they take longer than ``longest`` [s] in ``jobs`` processes, or more memory than :data:`MEMORY`.
    """
    rows = [case.settings.duration / case.settings.record_interval for case, _, _ in work]
    one = max(_PER_NUMBER * n * _columns(case) for n, (case, _, _) in zip(rows, work, strict=True))
    kept = sum(_KEPT * n * count for n, (_, _, count) in zip(rows, work, strict=True))
    seconds, taken = sum(estimate_trials(*each) for each in work) / jobs, _OWN + max(one, kept)
    asked = [format_duration(seconds) + (f" of {jobs} processes" if jobs > 1 else "")] if seconds > longest else []
    asked += [f"{taken / 1e9:.2g} GB of memory"] if taken > MEMORY else []
    if asked:
        raise StudyError(
            f"{path}: {sum(count for _, _, count in work)} trials, of up to {max(rows):.3g} rows, would take about "
            f"{' and '.join(asked)}; make them fewer or shorter (experiment.repetitions, duration, rate), or start it "
            "with --yes"
        )


def _columns(case: Case, study: bool = False) -> float:
    """Numbers in a row of a run and, if the study adds that, of its continuous control."""
    plant, runs = case.actual.linearisation.plant, 2 if study and case.prediction is not None else 1
    return runs * (1 + plant.n + plant.n_y + plant.n_u) + case.controller.realisation.layout.size


def _acting(case: Case) -> Array:
    """Frequencies of all that disturbs the run [rad/s]."""
    plant, settings, law = case.actual.linearisation.plant, case.settings, case.controller
    return np.concatenate([make_acting(plant, settings).omega, law.realisation.signals[:, 2]])


def _rate(case: Case) -> float:
    """About how fast the closed loop is, or what drives it [1/s]."""
    law, plant = case.controller, linear_plant(case.actual, case.settings)
    fastest = find_fastest_rate(match_ports(plant, law.plant, "position"), law)
    # a series is no longer than the shortest delay of a reading
    return max([fastest, *(1 / tau for tau in law.realisation.delayed[:1]), *_acting(case)])


def _timestep(case: Case) -> float:
    """The largest time step in MuJoCo [s], or stretch."""
    longest = np.inf if goes_by_steps(case.controller) else 0.5 / _rate(case)
    # no step goes across a bend of noise
    bends = (noise.interval for noise in case.settings.disturbance if isinstance(noise, Gridded))
    return min([case.stepping.timestep, longest, *bends])


class _Enough(Exception):
    """A probe has taken long enough."""


class _EarlyEnd(Exception):
    """The run of a probe fell, or diverged: it tells nothing of others."""


def _pace(case: Case, plant: PlantKind, settings: Settings) -> float:
    """Seconds of work for one second of simulation, from ever longer beginnings of the run.

    Raises:
        _Ended: if it ends before its time.
    """
    end = settings.duration
    length = 50 * _timestep(case) if plant == "mujoco" else 1 / max(_rate(case), 1e-9)
    length = min(max(length, 2 * case.controller.realisation.delay), end)  # no run is shorter than a delay
    try:
        _time_beginning(case, plant, settings, length)  # compiles, and loads what is loaded once
        first, least = length, _time_beginning(case, plant, settings, length)[0]
        while True:
            length = min(6 * length, end)
            took, pace = _time_beginning(case, plant, settings, length)
            if pace is not None:
                return pace
            if took - least > _PROBE or length >= end / 4:
                return max(took - least, 0.0) / max(length - first, 1e-300)
    except SimulationError:
        return 0.0  # which the run itself will say


def _time_beginning(case: Case, plant: PlantKind, settings: Settings, length: float) -> tuple[float, float | None]:
    """The time that the beginning of a run takes [s]; if it is stopped early, its pace at the end [s/s]."""
    settings = replace(settings, duration=min(length, settings.duration))
    law = case.controller
    begin = time.process_time()  # not of the clock on the wall, on which other programs work, too
    half: tuple[float, float] | None = None
    last = 0.0, 0.0

    def tell(done: float) -> None:
        nonlocal half, last
        last = time.process_time() - begin, done * settings.duration
        if half is None and last[0] > _LONGEST_PROBE / 2:
            half = last
        if last[0] > _LONGEST_PROBE:
            raise _Enough

    try:
        if plant == "linear":
            there = match_ports(linear_plant(case.actual, settings), law.plant, "position")
            run = simulate_linear(there, law, settings, progress=tell)
        else:
            assert isinstance(case.actual, MujocoPlant)
            body = case.actual.matched(law.plant, "position")
            run = simulate_mujoco(body, law, settings, error_estimate=False, progress=tell)
    except _Enough:
        before = (0.0, 0.0) if half is None or half[1] >= last[1] else half
        # where it hardly moves any more, it is the rest that counts
        return last[0], (last[0] - before[0]) / max(last[1] - before[1], 1e-300)
    if run.outcome.kind in ("fell", "diverged"):
        raise _EarlyEnd
    return time.process_time() - begin, None
