"""Many runs of one case that differ in seed, initial state or other values, in several processes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from icmj.base.array import Array, as_naturals, list_multiples
from icmj.base.card import Card, WithCard
from icmj.case.case import Case, PlantKind, prepare, revise, simulate, simulate_plant
from icmj.case.plants import linear_plant
from icmj.engine.plant import MujocoPlant
from icmj.errors import SimulationError, expect
from icmj.measurement.sway import sway_numbers
from icmj.runfile.messages import short
from icmj.runfile.schema import RunFile
from icmj.series.interpolation import NEAR
from icmj.series.series import Series
from icmj.simulation.settings import MOST_ROWS, Settings, reseed
from icmj.simulation.simulation import Simulation
from icmj.work.workers import Task, do, processes

SIGNALS = ("x", "y", "u", "x_o", "x_h")
NAMES = (*SIGNALS, "events", "sway")
Keep = Sequence[str] | Callable[[Simulation], Mapping[str, ArrayLike]]
_AT_ONCE = 50  # runs that a process is given
_ALONE = 8  # runs that are not worth a process


@dataclass(frozen=True, eq=False, repr=False)
class Batch(WithCard):
    """Many runs of one case; see :func:`simulate_many`.

    Attributes:
        base: the case of which all runs are.
        seeds: seed of each run, shape (n,).
        varied: varied values by key of the run file, each of shape (n,).
        t: times of the rows of the signals [s], shape (K,).
        outcome: how each run ended (``completed``, ``sliding``, ``fell``, …), length n.
        kept: the requested quantities by name, each of shape (n, …); see :func:`simulate_many`.
    """

    base: Case
    seeds: np.ndarray
    varied: Mapping[str, np.ndarray]
    t: Array
    outcome: tuple[str, ...]
    kept: Mapping[str, Array]

    def __len__(self) -> int:
        return len(self.seeds)

    def __getitem__(self, name: str) -> Array:
        """The quantity that was kept under this name."""
        return self.kept[name]

    def case(self, index: int) -> Case:
        """The case of one of these runs, which can be simulated again with its complete record."""
        case = _vary(self.base, {key: values[index].item() for key, values in self.varied.items()})
        return replace(case, settings=reseed(case.settings, int(self.seeds[index])))

    def card(self) -> Card:
        """Its representation at a prompt or in a notebook."""
        ended = {kind: self.outcome.count(kind) for kind in dict.fromkeys(self.outcome)}
        rows = tuple((name, f"shape {values.shape}") for name, values in self.kept.items())
        words = ", ".join(f"{count} {kind}" for kind, count in ended.items())
        return Card(f"{len(self)} runs of {self.file.case.name}: {words}", rows)

    @property
    def file(self) -> RunFile:
        """The run file of all runs, before the varied values."""
        return self.base.run


def simulate_many(
    case: Case,
    n: int | None = None,
    *,
    plant: PlantKind = "linear",
    seeds: Sequence[int] | None = None,
    vary: Mapping[str, ArrayLike] | None = None,
    keep: Keep = ("y",),
    jobs: int | None = None,
    progress: Callable[[float], None] | None = None,
) -> Batch:
    """Simulate one case many times, with different noise seeds or values, and keep the same quantities of every run.

    Args:
        case: the case.
        n: number of runs; by default the number of ``seeds`` or of values to ``vary``.
        plant: ``linear`` or ``mujoco``.
        seeds: one seed for each run, by default 0, 1, 2, …. Together with the seed of each noise it determines the
            signal: the noises of one run remain different signals, and a run does not depend on the process that
            computes it.
        vary: values by key of the run file (``simulation.initial.ankle``, ``actual.gain``), one for each run. For keys
            outside ``simulation``, design and analysis are repeated for every value.
        keep: names, or a function. Signals (``x``, ``y``, ``u``, ``x_o``, ``x_h``) are kept at the multiples of
            ``record_interval``, shape (n, K, w), NaN after the end of a run that ended early; ``events`` gives their
            times [s], shape (n, largest number of events), NaN after the last; ``sway`` gives the numbers of
            :func:`icmj.measure_sway` for the outputs, such as ``sway.shank.rms`` or ``sway.shank.frequency.median``,
            shape (n,), NaN if a run was too short. A function takes the run and returns numbers or arrays by name, with
            the same shapes for every run; it may be one of a script or a notebook.
        jobs: number of processes; by default the number of cores. With one, no process is started.
        progress: called repeatedly with the completed fraction, 0–1.

    Raises:
        SimulationError: if numbers of runs differ, a seed or a number is not whole, or a quantity to be kept is unknown
            or, from a function, no table of numbers.
        RunFileError: if a key is unknown, or a value not allowed.
        AnalysisError: if it is no case.
        StudyError: if the number of processes is not positive.
    """
    expect(case, Case, "simulate_many")
    varied = {key: _vector(key, values) for key, values in (vary or {}).items()}
    each = None if seeds is None else as_naturals(seeds, "seeds", SimulationError)
    lengths = {key: len(values) for key, values in varied.items()} | ({} if each is None else {"seeds": len(each)})
    n = int(as_naturals(next(iter(lengths.values()), 1) if n is None else n, "n", SimulationError)[0])
    wrong = [f"{key} has {length}" for key, length in lengths.items() if length != n]
    if wrong or n < 1:
        raise SimulationError(f"{n} runs{', but ' * bool(wrong)}{', '.join(wrong)}; give one value for each run")
    each = np.arange(n) if each is None else each
    listed = isinstance(keep, Iterable) and not isinstance(keep, str) and all(name in NAMES for name in keep)
    if not (listed or callable(keep)):
        raise SimulationError(f"keep: {short(keep)}; expected some of {', '.join(NAMES)}, or a function")
    jobs = processes(jobs, -(-n // _ALONE))
    parts = _parts(case, bool(varied))
    size = 1 if jobs == 1 else min(_AT_ONCE, -(-n // (2 * jobs)))  # of one process each run is told
    runs = [slice(first, first + size) for first in range(0, n, size)]
    there = (case.run, parts, case if jobs == 1 else None, plant, keep)
    work = [(*there, each[of], {key: values[of] for key, values in varied.items()}) for of in runs]
    found, done = [_Results([], {})] * len(runs), np.zeros(len(runs))
    for news in do([Task(f"runs of {case.run.case.name}", _some, some) for some in work], jobs):
        done[news.index] = news.done
        if news.value is not None:
            found[news.index] = news.value
        if progress is not None:
            progress(float(done.mean()))
    names = list(dict.fromkeys(name for part in found for name in part.kept))
    kept = {name: _stack([array for part in found for array in part.kept[name]]) for name in names}
    outcome = tuple(kind for part in found for kind in part.outcome)
    return Batch(case, each, varied, _grid(case.settings), outcome, kept)


@dataclass(frozen=True, eq=False)
class _Results:
    """Results of some runs: the outcome and the kept quantities of each."""

    outcome: list[str]
    kept: dict[str, list[Array]]


def _some(
    run: RunFile,
    parts: Mapping[str, Any],
    like: Case | None,
    plant: PlantKind,
    keep: Keep,
    seeds: np.ndarray,
    varied: Mapping[str, np.ndarray],
    progress: Callable[[float], None] | None = None,
) -> _Results:
    """Carry out some of the runs, one after the other."""
    told, base = _Results([], {}), like or replace(LAST.get(run), **parts)
    for index, seed in enumerate(seeds):
        case = _vary(base, {key: values[index].item() for key, values in varied.items()})
        case = replace(case, settings=reseed(case.settings, int(seed)))
        if callable(keep) or plant != "linear":
            found = simulate(case if callable(keep) else _record_steps(case), plant)
        else:  # without the centre of pressure, which nobody asks for
            actual = linear_plant(case.actual, case.settings)
            found = simulate_plant(actual, case.controller, case.settings, match="position")
        told.outcome.append(found.outcome.kind)
        values = _numbers(keep(found)) if callable(keep) else _name(found, keep, case)
        for name, value in values.items():
            told.kept.setdefault(name, []).append(value)
        if progress is not None:
            progress((index + 1) / len(seeds))
    return told


class LastCase:
    """The case that a process prepared last: the next one mostly differs in threshold, set-point and simulation alone.

    Nothing that changes a bit: what is taken over is what would be computed again.
    """

    def __init__(self) -> None:
        self._key: object = None
        self._case: Case | None = None

    def get(self, run: RunFile, q_t: float | None = None) -> Case:
        """The case of a run file; with ``q_t``, theory is asked at this threshold and scaled, whatever came before."""
        reference = run if q_t is None else run.with_(**{"controller.q_t": q_t})
        key = (run.path, *(getattr(reference, name) for name in _TABLES))
        if self._case is None or self._key != key:
            self._key = None  # should this fail, the case that is kept is of no run file
            self._case, self._key = prepare(reference, like=self._case), key
        return revise(self._case, run)


_TABLES = ("assumed", "actual", "design", "controller", "analysis")
LAST = LastCase()
"""That of this process."""


def _parts(case: Case, varies: bool) -> dict[str, Any]:
    """What another process takes of the case beside its run file: they may have been replaced in it."""
    law = case.controller
    rule = getattr(law, "trigger", None)
    own = case.theory is not None and rule is not case.theory.rule
    if varies and (own or case.settings != case.run.simulation.settings()):
        raise SimulationError(
            "vary: these are values of the run file, and settings or trigger of this case are others than those of its "
            "run file; prepare one that says the same"
        )
    # code of the user's own is known by the run file alone
    there = type(rule or law).__module__.startswith("icmj.")
    return {name: getattr(case, name) for name in ("settings", *(("controller", "theory") if there else ()))}


def _vary(case: Case, changes: Mapping[str, Any]) -> Case:
    """The case with other values; changes of the simulation alone reuse plants and design."""
    if not changes:
        return case
    run = case.run.with_(**changes)
    return revise(case, run) if all(key.startswith("simulation.") for key in changes) else prepare(run, like=case)


def _vector(key: str, values: ArrayLike) -> np.ndarray:
    try:
        vector = np.asarray(values)
    except ValueError:
        vector = np.zeros((0, 0))
    if vector.ndim == 1:
        return vector
    raise SimulationError(f"vary: {key} must be a vector of values, one for each run")


def _numbers(told: object) -> dict[str, Array]:
    """What a function keeps of a run, as arrays by name."""
    try:
        if isinstance(told, Mapping):
            return {str(name): np.asarray(value, dtype=float) for name, value in told.items()}
    except (TypeError, ValueError):
        pass
    raise SimulationError(f"keep: the function returned {short(told)}; expected numbers or arrays by name")


def _grid(settings: Settings) -> Array:
    return list_multiples(settings.record_interval, settings.duration)


def _record_steps(case: Case) -> Case:
    """The case with a row at each step of a fixed length: these end beside the multiples of its record interval."""
    from icmj.engine.stepping import refine

    settings = case.settings
    if not isinstance(case.actual, MujocoPlant):
        return case
    step = refine(case.actual, case.controller, settings, 1.0).timestep  # none where it is chosen for a tolerance
    if step is None or not settings.duration / MOST_ROWS <= step < settings.record_interval:
        return case
    return replace(case, settings=replace(settings, record_interval=step))


def _name(found: Simulation, keep: Sequence[str], case: Case) -> dict[str, Array]:
    """The quantities to keep under these names."""
    kept: dict[str, Array] = {}
    for name in keep:
        if name == "events":
            kept[name] = found.events.t
        elif name == "sway":
            y = _rows(found, "y", case)
            there = np.isfinite(y).all(axis=1)
            labels = found.labels
            series = Series(_grid(case.settings)[there], y[there], labels.outputs, labels.output_units)
            kept |= {f"sway.{name}": value for name, value in sway_numbers(series).items()}
        else:
            kept[name] = _rows(found, name, case)
    return kept


def _rows(found: Simulation, name: str, case: Case) -> Array:
    """A signal at the multiples of the record interval, NaN after the end; between rows where none is there."""
    t, values = _grid(case.settings), getattr(found, name)
    at = np.minimum(np.searchsorted(found.t, t - NEAR), len(found.t) - 1)
    there = np.abs(found.t[at] - t) < NEAR
    rows = np.full((len(t), values.shape[1]), np.nan)
    if there[t <= found.t[-1]].all():
        rows[there] = values[at[there]]
        return rows
    series = found.to_series(1 / case.settings.record_interval, case.controller)
    columns = [place for place, column in enumerate(series.names) if column.startswith(f"{name}.")]
    rows[: len(series)] = series.values[: len(t), columns]
    return rows


def _stack(arrays: list[Array]) -> Array:
    """Arrays of one shape stacked; vectors of several lengths are filled up with NaN."""
    if len({array.shape for array in arrays}) > 1 and all(array.ndim == 1 for array in arrays):
        longest = max(map(len, arrays))
        arrays = [np.pad(array, (0, longest - len(array)), constant_values=np.nan) for array in arrays]
    if len({array.shape for array in arrays}) > 1:
        raise SimulationError("keep: returns arrays of other shapes for other runs; they cannot be stacked")
    return np.stack(arrays)
