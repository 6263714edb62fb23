"""Writing a log: one ``.rrd`` with everything in it, in whole columns, complete or not at all.

The time series that the viewer shows, taken from a result.

Plain numpy; how they are drawn is in :mod:`icmj.log.blueprint`, how they are stored in :mod:`icmj.log.writer`.

The summary of a result: properties of the recording, and one page of Markdown for the replay.
"""

from __future__ import annotations

import shutil
import uuid
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from itertools import repeat
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import pyarrow as pa
import rerun as rr
from rerun.chunk import RrdReader

from icmj.base.array import RELATIVE_ROUNDING, Array
from icmj.base.files import whole
from icmj.base.numbers import amount, collect_facts, ordinal, relative
from icmj.base.numbers import eigenvalue as eigenvalue_in_words
from icmj.base.text import one_line
from icmj.case.comparison import COMPARED, RUN, Comparison, compare
from icmj.case.laid_orbit import lay_orbit
from icmj.case.motion import acting, modes, reduce_state, running_interval, with_resets
from icmj.case.quantity import in_brackets, in_unit
from icmj.case.result import Result, has_prediction
from icmj.controller.setpoint import Setpoint
from icmj.errors import LogError
from icmj.log import archive, palette
from icmj.log.blueprint import blueprint, write_phase_plane
from icmj.log.figure import write_figures
from icmj.log.palette import Colour
from icmj.log.target import in_memory
from icmj.log.timeline import time_column
from icmj.measurement.statistics import Estimate
from icmj.simulation.simulation import Simulation
from icmj.theory.prediction import PREDICTION

if TYPE_CHECKING:
    from icmj.case.result import PredictedResult


@dataclass(frozen=True, eq=False)
class Entity:
    """Series of one kind that share their times: one entity of the log.

    Attributes:
        path: entity path.
        t: times [s], shape (M,); may repeat where a value jumps.
        values: shape (M, w).
        names, colours: for the legend, length w.
        width: stroke width, or marker size of points [ui points].
        kind: ``lines`` or ``points``.
    """

    path: str
    t: Array
    values: Array
    names: tuple[str, ...]
    colours: tuple[Colour, ...]
    width: float = 1.5
    kind: Literal["lines", "points"] = "lines"

    @property
    def aggregation(self) -> Literal["Off", "MinMax"]:
        """How the viewer draws more points than pixels: a sawtooth is kept as it is, smooth curves by extremes."""
        return "Off" if len(self.t) < 3000 else "MinMax"


def groups(result: Result) -> Iterator[Entity]:
    """Every group of series of ``result``; those that do not exist (no cycle, no trigger ...) are left out."""
    yield from _signals(result) if has_prediction(result) else _bare_signals(result)
    yield from acting_groups(result)
    yield from pressure_groups(result)
    if has_prediction(result):
        yield from _trigger(result)
        yield from _intervals(result)
        yield from _modes(result)
    run = result.simulation
    if run.mode.size:
        yield Entity("mode/run", run.t, run.mode[:, None].astype(float), (", ".join(run.modes),), (palette.RUNNING,))


def _bare_signals(result: Result) -> Iterator[Entity]:
    """Outputs, inputs and states of a run with nothing to be compared with."""
    run, plant = result.simulation, result.actual
    for path, values, names in (
        ("outputs/run", run.y, plant.outputs),
        ("inputs/run", run.u, plant.inputs),
        ("states/plant", run.x, plant.states),
    ):
        yield Entity(path, run.t, values, names, palette.series(len(names)))
    yield from setpoint_groups(run)


def _signals(result: PredictedResult) -> Iterator[Entity]:
    """Outputs, inputs and states: continuous, predicted and run, in this (alphabetical) order drawn on each other."""
    simulation, continuous, prediction = result.simulation, result.continuous, result.prediction
    y_names, u_names = result.actual.outputs, result.actual.inputs
    y_colours, u_colours = palette.series(len(y_names)), palette.series(len(u_names))
    laid = lay_orbit(result) if prediction.cycle else None
    if laid is not None:
        y, u = (laid.at(simulation.t, signal) for signal in (laid.orbit.y, laid.orbit.u))
        for where, values, names, colours in (("outputs", y, y_names, y_colours), ("inputs", u, u_names, u_colours)):
            dim = tuple(palette.dim(colour) for colour in colours)
            yield Entity(f"{where}/predicted", simulation.t, values, ("predicted orbit",) * len(names), dim, 5.0)
    if continuous is not None:
        for where, values, names in (("outputs", continuous.y, y_names), ("inputs", continuous.u, u_names)):
            grey = (palette.CONTINUOUS,) * len(names)
            yield Entity(f"{where}/continuous", continuous.t, values, ("continuous control",) * len(names), grey, 1.0)
    yield Entity("outputs/run", simulation.t, simulation.y, y_names, y_colours)
    yield from setpoint_groups(simulation)
    events, u_after = simulation.events, simulation.u_after(result.controller)
    yield Entity("inputs/run", *with_resets(simulation, simulation.u, u_after), u_names, u_colours)
    for path, (t, values), names in (
        ("states/plant", (simulation.t, simulation.x), result.actual.states),
        ("states/observer", (simulation.t, simulation.x_o), result.assumed.states),
        ("states/hold", with_resets(simulation, simulation.x_h, events.x_o), result.assumed.states),
    ):
        yield Entity(path, t, values, names, palette.series(len(names)))


def setpoint_groups(simulation: Simulation) -> Iterator[Entity]:
    """The set-point that a run followed, if any."""
    if simulation.setpoint:
        names = tuple(f"set-point {name}" for name in simulation.setpoint.names)
        colours = tuple(palette.pale(colour) for colour in palette.series(len(names)))
        yield Entity("outputs/setpoint", *_upright(simulation.setpoint, simulation.t), names, colours, 1.0)


def _upright(r: Setpoint, t: Array) -> tuple[Array, Array]:
    """The set-point at these times, and before and after each of its jumps between them."""
    edges = r.edges[r.edges < t[-1]]
    when = np.concatenate([edges, t, edges])
    values = np.concatenate([r((1 - RELATIVE_ROUNDING) * edges), r(t), r(edges)])
    order = np.argsort(when, kind="stable")
    return when[order], values[order]


def acting_groups(result: Result) -> Iterator[Entity]:
    """The inputs that act on the plant where they differ from the command: limited, and with disturbances."""
    inputs = acting(result)
    if inputs:
        names = tuple(f"{result.actual.inputs[i]}, what acts" for i in inputs)
        colours = tuple(palette.pale(palette.series(result.actual.n_u)[i]) for i in inputs)
        values = np.ascontiguousarray(result.simulation.applied[:, inputs])
        yield Entity("inputs/what_acts", result.simulation.t, values, names, colours, 1.0)
    run = result.simulation
    if run.pushes:
        names = tuple(
            f"push on {name}{in_brackets(unit)}" for name, unit in zip(run.push_names, run.push_units, strict=True)
        )
        colours = tuple(palette.pale(colour) for colour in palette.series(len(names)))
        yield Entity("inputs/pushes", run.t, np.ascontiguousarray(run.push_values), names, colours, 1.0)


def pressure_groups(result: Result) -> Iterator[Entity]:
    """Centre of pressure, its value at rest, and the load of each contact."""
    simulation, pressure = result.simulation, result.simulation.pressure
    if pressure is None:
        return
    axes = pressure.axes or ("x",)
    there = ["xy".index(axis) for axis in axes]
    colours = palette.series(len(axes))
    rest = np.tile(pressure.at_rest[there], (2, 1))
    dim = tuple(palette.dim(colour) for colour in colours)
    yield Entity("pressure/at_rest", simulation.t[[0, -1]], rest, ("at rest",) * len(axes), dim, 1.5)
    for path, values, after, names in (
        ("pressure/centre", pressure.centre[:, there], pressure.centre_after[:, there], axes),
        ("load/borne", pressure.load, pressure.load_after, pressure.geoms),
    ):
        t = simulation.t
        if len(after):
            t, values = with_resets(simulation, values, after)
        yield Entity(path, t, np.ascontiguousarray(values), names, palette.series(len(names)))


def _trigger(result: PredictedResult) -> Iterator[Entity]:
    """The hold error over its threshold, which E is computed from, the level of an event, and the events on it."""
    simulation, controller = result.simulation, result.controller
    faces = controller.trigger.faces(controller.design)
    if not len(faces) or not np.isfinite(simulation.E).any():
        return
    events = simulation.events
    share = np.sqrt(np.maximum(1 + simulation.E[:, None] / faces.unit, 0))  # E = unit · (share² − 1)
    t, share = with_resets(simulation, share, np.zeros((len(events), 1)))
    yield Entity("trigger/threshold", simulation.t[[0, -1]], np.ones((2, 1)), ("threshold",), (palette.LEVEL,), 1.5)
    yield Entity("trigger/E", t, share, ("hold error / threshold",), (palette.E,))
    if len(events):
        at = np.ones((len(events), 1))
        yield Entity("trigger/events", events.t, at, ("event",), (palette.EVENT,), 3.0, "points")


def _intervals(result: PredictedResult) -> Iterator[Entity]:
    """Open-loop interval as it runs and at events, with Δ_crit."""
    simulation, prediction = result.simulation, result.prediction
    if simulation.control == "continuous":
        return
    t, since = running_interval(simulation)
    yield Entity("interval/running", t, since[:, None], ("time since last event",), (palette.RUNNING,), 1.0)
    if prediction.delta_crit is not None:
        name = "Δ_crit" if prediction.cycle else "Δ_crit (no cycle predicted)"
        line = np.full((2, 1), prediction.delta_crit)
        yield Entity("interval/delta_crit", simulation.t[[0, -1]], line, (name,), (palette.LEVEL,), 1.5)
    if len(simulation.events):
        at = simulation.events.interval[:, None]
        yield Entity("interval/events", simulation.events.t, at, ("Δ_i",), (palette.EVENT,), 4.0, "points")


def _modes(result: PredictedResult) -> Iterator[Entity]:
    """χ, its real part, with ±γ and the critical mode at the events."""
    simulation, prediction = result.simulation, result.prediction
    if prediction.V_inv is None:
        return
    chi = modes(result, reduce_state(result, simulation.x, simulation.x_o, simulation.x_h)).real
    if chi.shape[1] > 1:
        others = ("other modes",) * (chi.shape[1] - 1)
        grey = (palette.OTHER_MODES,) * len(others)
        yield Entity("modes/others", simulation.t, np.ascontiguousarray(chi[:, 1:]), others, grey, 1.0)
    if prediction.gamma is not None:
        lines = np.outer([1, 1], [prediction.gamma, -prediction.gamma])
        yield Entity("modes/gamma", simulation.t[[0, -1]], lines, ("γ", "−γ"), (palette.LEVEL,) * 2, 1.5)
    yield Entity("modes/critical", simulation.t, chi[:, :1].copy(), ("critical mode",), (palette.CRITICAL,))
    if len(simulation.events):
        events = simulation.events
        at = modes(result, reduce_state(result, events.x, events.x_o, events.x_h)).real[:, :1].copy()
        yield Entity("modes/events", events.t, at, ("event",), (palette.EVENT,), 3.0, "points")


Properties = dict[str, dict[str, float | int | bool | str]]


def summarise(result: Result, compared: Comparison | None) -> Properties:
    """Facts of the run in full precision, by topic; a number that does not exist is left out.

    Args:
        result: the run.
        compared: the run beside its prediction, if there is one.
    """
    if compared is None or not has_prediction(result):
        return _join(result, result.words, {"controller": _settings(result)})
    prediction, motion, outputs = result.prediction, result.measurement, result.actual.outputs
    error = compared.relative_error
    off = () if error.amplitude is None else error.amplitude
    topics: dict[str, dict[str, Any]] = {
        "outcome": {"converged": compared.measured.converged},
        "predicted": _split(collect_facts(PREDICTION, prediction, "logged", outputs)),
        "measured": collect_facts(RUN, result, "logged", outputs) | {"words": motion.words},
        "relative_error": {"interval": error.interval, "period": error.period, "gamma": error.gamma}
        | {f"amplitude_{k}": float(v) for k, v in zip(outputs, off, strict=False)},
        "statistics": _statistics(result),
    }
    return _join(result, compared.words, topics)


def _join(result: Result, verdict: str, topics: Mapping[str, Mapping[str, Any]]) -> Properties:
    """Topics that not every result has, with those that all have; without what does not exist."""
    run, simulation = result.run, result.simulation
    outcome = simulation.outcome
    of_all: dict[str, dict[str, Any]] = {
        "case": {
            "name": run.case.name,
            "title": run.title,
            "changes": run.changes_in_words or None,
            "plant": simulation.plant,
            "control": simulation.control,
            "rows": len(simulation.t),
            "events": len(simulation.events),
        },
        "outcome": {"kind": outcome.kind, "time": outcome.t, "message": outcome.message, "verdict": verdict},
        "measures": dict(result.measures),
        "precision": dict(simulation.precision),
        "pressure": {} if simulation.pressure is None else dict(simulation.pressure.facts),
        "provenance": dict(result.provenance),
        "run_file": {"path": run.path.as_posix(), "text": run.text},
    }
    told = {name: {**of_all.get(name, {}), **topics.get(name, {})} for name in (*of_all, *topics)}
    return {name: {k: v for k, v in facts.items() if v is not None} for name, facts in told.items()}


def markdown(result: Result, compared: Comparison | None) -> str:
    """One page: the verdict, the numbers side by side if there is a prediction, how the run ended and what made it."""
    if compared is None or not has_prediction(result):
        return _plain_page(result)
    simulation = result.simulation
    predicted, measured, error = compared.predicted, compared.measured, compared.relative_error
    outputs, units = result.actual.outputs, result.actual.output_units or ("",) * result.actual.n_y
    rows: list[tuple[str, Any, Any, Any]] = []
    for fact, expected in COMPARED:
        three = (getattr(predicted, expected.name), getattr(measured, fact.name), getattr(error, fact.name))
        if fact.kind == "outputs":
            each = zip(*(repeat(None) if values is None else values for values in three), strict=False)
            rows += [
                (in_unit(fact.label_of(name), unit), *values)
                for name, unit, values in zip(outputs, units, each, strict=False)
            ]
        else:
            mean = fact.name == "interval" and measured.kind == "noisy"  # which is not a cycle's interval
            rows.append((in_unit(fact.label, fact.unit), *three[:2], None if mean else three[2]))
    cycle, orbits = "a limit cycle" if predicted.cycle else "no limit cycle", result.prediction.orbits
    eigenvalue = "" if predicted.eigenvalue is None else f" λ_crit = {eigenvalue_in_words(predicted.eigenvalue)};"
    lines = [
        *_head(result),
        f"**{PLANTS[simulation.plant]}**, {CONTROLS[simulation.control]}.",
        "",
        f"{compared.words}",
        "",
        "| | predicted | measured | error |",
        "| :-- | --: | --: | --: |",
        *(f"| {name} | {amount(p)} | {amount(m)} | {relative(e)} |" for name, p, m, e in rows),
        "",
        "## Prediction",
        f"The linear theory predicts {cycle};{eigenvalue} the orbit under the event rule: {predicted.verdict}.",
        f"By the paper's condition: {'a limit cycle' if predicted.by_paper else 'no limit cycle'}.",
        *(f"- {ordinal(i)} orbit: {one.words}" for i, one in enumerate(orbits) if len(orbits) > 1),
        "",
        "## Run",
        f"- outcome: the run {simulation.outcome.message}",
        f"- motion: {result.measurement.words}",
        f"- {len(simulation.events)} events, {len(simulation.t)} rows",
        *(f"- {key.replace('_', ' ')}: {in_words(value)}" for key, value in simulation.precision.items()),
        *([f"- {words}" for words in simulation.pressure.words] if simulation.pressure else ()),
        *(f"- {name}: {in_words(value)}" for name, value in result.measures.items()),
        "",
        "## Provenance",
        *(f"- {key.replace('_', ' ')}: {value}" for key, value in result.provenance.items()),
    ]
    return "\n".join(lines) + "\n"


def _head(result: Result) -> list[str]:
    """The title, and beneath it which values are not the file's."""
    changes = [result.run.changes_in_words, ""] if result.run.changes_in_words else []
    return [f"# {result.run.title}", *changes]


def _plain_page(result: Result) -> str:
    """One page without a prediction: what the run did, the controller, how it was computed and what made it."""
    run = result.simulation
    parts = {
        "Controller": _settings(result),
        "Run": {
            "outcome": f"the run {run.outcome.message}",
            "switches": len(run.events),
            "rows": len(run.t),
            **result.measures,
            **run.precision,
        },
        "Provenance": result.provenance,
    }
    lines = [*_head(result), f"**{PLANTS[run.plant]}**, {result.controller.kind} control.", ""]
    lines.append(result.words)
    for title, facts in parts.items():
        lines += ["", f"## {title}", *(f"- {key.replace('_', ' ')}: {in_words(value)}" for key, value in facts.items())]
    if run.pressure is not None:
        lines += ["", "## Ground", *(f"- {words}" for words in run.pressure.words)]
    return "\n".join(lines) + "\n"


def _settings(result: Result) -> dict[str, Any]:
    """The facts of the controller as a log's properties hold them."""
    found: dict[str, Any] = {}
    for key, value in result.controller.facts().items():
        if value is None:
            continue
        if not isinstance(value, bool | int | float | str):
            array = np.asarray(value)
            value = float(array.item()) if array.size == 1 else str(array.tolist())
        found[key] = value
    return found


def _statistics(result: Result) -> dict[str, float | None]:
    """Distributions under noise; nothing without."""
    found = result.statistics
    if found is None:
        return {}
    facts: dict[str, Estimate | None] = {
        "interval": found.interval,
        "interval_deviation": found.interval_deviation,
        "binding": found.binding,
    }
    for name, mean, rms in zip(result.actual.outputs, found.mean, found.rms, strict=True):
        facts |= {f"mean_{name}": mean, f"rms_{name}": rms}
    known = {name: fact for name, fact in facts.items() if fact is not None}
    values: dict[str, float | None] = {"events": found.events, "least": found.least}
    return values | {
        key: value for name, fact in known.items() for key, value in ((name, fact.value), (f"{name}_error", fact.error))
    }


PLANTS = {"linear": "Linear plant", "mujoco": "MuJoCo plant"}
CONTROLS = {"event": "event-driven", "clock": "clock-driven", "continuous": "continuous control"}


def in_words(value: float | int | str) -> str:
    """A fact as readable text."""
    return amount(value) if isinstance(value, float) else str(value)


def _split(facts: dict[str, Any]) -> dict[str, Any]:
    """Facts with a complex number as two."""
    λ = facts.pop("eigenvalue")
    return facts | {"eigenvalue_re": None if λ is None else λ.real, "eigenvalue_im": None if λ is None else λ.imag}


APPLICATION = "icmj"
LITTLE = 20_000_000  # bytes; the longest shipped run logs half of it
FORMAT = 1
"""Version of what the archive holds; raised when an older reader could misread a newer log."""


def write_log(result: Result, path: Path | str) -> None:
    """Write ``result`` to ``path`` as a rerun recording.

    The log is written under a temporary name, read back to check that it is complete, and renamed, so a log is
    either complete or absent. It contains an archive with its own digest, which :func:`icmj.read_log` reads.

    Raises:
        LogError: if the result cannot be stored or the file cannot be written.
    """
    path = Path(path)
    tree, arrays = archive.pack(result)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        # a run that diverged is logged too
        with whole(path) as part, strictly(), np.errstate(invalid="ignore", over="ignore"):
            with in_memory(part) as sink:
                _write(result, tree, arrays, sink)
            _verify(part)
    except (OSError, RuntimeError, ValueError, TypeError) as error:
        raise LogError(f"{path}: the log cannot be written ({_reason(error, path.parent)})") from error


@contextmanager
def strictly() -> Iterator[None]:
    """Within the block, rerun raises an error on a wrong argument instead of dropping the data with a warning."""
    before = rr.strict_mode()
    rr.set_strict_mode(True)
    try:
        yield
    finally:
        rr.set_strict_mode(before)


def _write(result: Result, tree: str, arrays: archive.Flat, sink: Path) -> None:
    digest = archive.digest(tree, arrays)
    # one identity for one content: two versions of a case stay two recordings in the viewer
    identity = uuid.uuid5(uuid.NAMESPACE_OID, digest)
    # every chunk straight to the file, in this order: of a log cut short the summary and the archive come first
    recording = rr.RecordingStream(
        APPLICATION, recording_id=identity, batcher_config=rr.ChunkBatcherConfig(flush_num_rows=1)
    )
    recording.save(sink, default_blueprint=blueprint(result))
    recording.set_log_time_enabled(False)
    recording.set_log_tick_enabled(False)
    recording.send_recording_name(f"{result.run.title} ({result.simulation.plant})")
    compared = compare(result) if has_prediction(result) else None
    properties, words = summarise(result, compared), markdown(result, compared)
    for name, facts in properties.items():
        if facts:
            recording.send_property(name, [_fact(key, value) for key, value in facts.items()])
    recording.log("summary", rr.TextDocument(words, media_type=rr.MediaType.MARKDOWN), static=True)
    _write_archive(recording, tree, arrays, digest)
    for group in groups(result):
        _write_group(recording, group)
    if has_prediction(result):
        write_phase_plane(recording, result)
    if result.scene is not None:
        write_figures(recording, result.scene)
    recording.flush(timeout_sec=60.0)
    recording.disconnect()


def _write_group(recording: rr.RecordingStream, group: Entity) -> None:
    colours, names = list(group.colours), list(group.names)
    style = (
        rr.SeriesPoints(colors=colours, names=names, marker_sizes=[group.width] * len(names))
        if group.kind == "points"
        else rr.SeriesLines(
            colors=colours, names=names, widths=[group.width] * len(names), aggregation_policy=group.aggregation
        )
    )
    recording.log(group.path, style, static=True)
    M, w = group.values.shape
    columns = rr.Scalars.columns(scalars=np.ascontiguousarray(group.values).reshape(-1)).partition(np.full(M, w))
    recording.send_columns(group.path, [time_column(group.t)], columns)


def _write_archive(recording: rr.RecordingStream, tree: str, arrays: archive.Flat, digest: str) -> None:
    """One static row: the tree, its digest, and every array as a plain list of numbers that other tools read too."""
    head = {"format": pa.array([FORMAT]), "tree": pa.array([tree]), "sha256": pa.array([digest])}
    body = {key: pa.array(values) for key, values in arrays.items()}
    recording.log("archive", _batches(head | body), static=True)


def _batches(columns: dict[str, pa.Array]) -> list[Any]:
    return [rr.AnyBatchValue(f"{ARCHIVE}:{key}", values, drop_untyped_nones=False) for key, values in columns.items()]


ARCHIVE = "icmj"


def _fact(key: str, value: float | int | bool | str) -> Any:
    return rr.AnyBatchValue(key, pa.array([value]))


def _verify(part: Path) -> None:
    """Check that the file opens and contains its manifest and the archive; a full disk is noticed only here."""
    if not part.is_file():
        raise ValueError("rerun wrote no file; is it switched off by RERUN in the environment?")
    if "/archive" not in RrdReader(part).store().summary():
        raise ValueError("what was written does not read back")


def _reason(error: BaseException, folder: Path) -> str:
    """The cause of an error in one line, including a full disk, which rerun does not report."""
    why = error.strerror if isinstance(error, OSError) and error.strerror else one_line(error, 300)
    with suppress(OSError):
        free = shutil.disk_usage(folder).free
        if free < LITTLE:
            why += f"; only {free / 1e6:.1f} MB are free there"
    return why
