"""The archive: a result as one JSON tree and named flat arrays, bit-exact both ways.

The walk knows dataclasses, arrays, run files and plain values, and nothing else; it builds only the classes listed
here, so a log can carry data but no code. A digest over everything tells when a stored bit has changed. The files of a
run file go with it, so that the log can be analysed where these files do not exist.

Whether data read from a log are of the types that their dataclasses declare.

Checks of a result beyond its types: matching shapes, increasing times, finite numbers.

A log is believed only as far as this: the digest in it says that nothing has changed since it was written, not that
what was written makes sense.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping
from dataclasses import fields, is_dataclass, replace
from functools import lru_cache
from pathlib import Path
from types import NoneType, UnionType
from typing import TYPE_CHECKING, Any, Literal, Union, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import NDArray

from icmj.base.array import Array
from icmj.base.files import read_bytes
from icmj.base.text import one_line
from icmj.case.references import plant_files
from icmj.case.result import AmplitudeLaw, Attractor, Growth, Result, has_prediction
from icmj.controller.controller import Controller, RecordedLaw, has_trigger, record_law
from icmj.controller.delay import Delay
from icmj.controller.design import Design
from icmj.controller.hold import Hold
from icmj.controller.realisation import Guard, Layout, Mode, Rates, Realisation
from icmj.controller.rules import RULES
from icmj.controller.setpoint import Setpoint
from icmj.controller.trigger import ClockTrigger, Continuous, RecordedRule, record_trigger
from icmj.errors import AnalysisError, IcmjError, LogError
from icmj.measurement.measurement import Measurement
from icmj.measurement.statistics import Estimate, Spectrum, Statistics
from icmj.plant.linear_plant import LinearPlant, Push
from icmj.runfile.controllers import CONTROLLERS
from icmj.runfile.reading import parse_run
from icmj.runfile.schema import MOST_BYTES, BundledFiles, RunFile
from icmj.simulation.disturbance import acting_on
from icmj.simulation.ending import Outcome
from icmj.simulation.labels import Labels
from icmj.simulation.pressure import Pressure
from icmj.simulation.rows import collect_drives
from icmj.simulation.simulation import Events, Simulation
from icmj.theory.crossing import Crossing
from icmj.theory.orbit import Orbit
from icmj.theory.orbit_family import OrbitFamily
from icmj.theory.prediction import PredictedOrbit, Prediction
from icmj.theory.reduction import NeutralMode

if TYPE_CHECKING:
    from icmj.case.result import PredictedResult

_ARRAYS = {float: "fiu", complex: "cfiu"}


def conform(value: Any, where: str = "result") -> None:
    """Check every field of a dataclass, and of those within it, against its declared type.

    Raises:
        LogError: at the first that is not what it should be, by its dotted place.
    """
    cls: Any = type(value)
    for name, hint in _hints(cls).items():
        _check(getattr(value, name), hint, f"{where}.{name}".removeprefix("result."))


@lru_cache(maxsize=100)
def _hints(cls: Any) -> dict[str, Any]:
    hints = get_type_hints(cls)
    return {field.name: hints[field.name] for field in fields(cls)}


def _check(value: Any, hint: Any, where: str) -> None:
    if not _is(value, hint, where):
        raise LogError(f"{where} is {one_line(repr(value), 60)}; expected {_words(hint)}")


def _plain(hint: Any) -> Any:
    """The type behind an annotation that may be an alias, as ``NDArray[...]`` is from numpy 2.5 on."""
    while (aliased := getattr(get_origin(hint) or hint, "__value__", None)) is not None:
        hint = aliased[arguments] if (arguments := get_args(hint)) else aliased
    return hint


def _is(value: Any, hint: Any, where: str) -> bool:
    hint = _plain(hint)
    origin, arguments = get_origin(hint), get_args(hint)
    if origin in (Union, UnionType):
        return any(_is(value, member, where) for member in arguments)
    if origin is Literal:
        return any(type(value) is type(choice) and value == choice for choice in arguments)
    if origin is np.ndarray or hint is np.ndarray:
        return isinstance(value, np.ndarray) and value.dtype.kind in _kinds(arguments)
    if origin is tuple:
        return isinstance(value, tuple) and all(_each(item, arguments[0], f"{where}.{i}") for i, item in _list(value))
    if origin in (Mapping, Mapping, dict):
        return isinstance(value, dict) and all(
            isinstance(key, str) and _each(item, arguments[1], f"{where}.{key}") for key, item in value.items()
        )
    if hint in (float, complex, int):
        numbers = {float: (int, float), complex: (int, float, complex), int: (int,)}[hint]
        small = not isinstance(value, int) or abs(value) < 2**63
        return isinstance(value, numbers) and not isinstance(value, bool) and small
    if not isinstance(hint, type):
        return True
    if not isinstance(value, hint):
        return False
    if is_dataclass(value) and not isinstance(value, RunFile | NoneType):
        conform(value, where)
    return True


def _each(value: Any, hint: Any, where: str) -> bool:
    _check(value, hint, where)
    return True


def _list(values: tuple[Any, ...]) -> list[tuple[int, Any]]:
    return list(enumerate(values))


def _kinds(arguments: tuple[Any, ...]) -> str:
    """Kinds of dtype that an annotation ``NDArray[...]`` stands for; floats may be stored as integers."""
    scalar = get_args(arguments[1])[0] if len(arguments) == 2 and get_args(arguments[1]) else None
    if scalar is None or not isinstance(scalar, type):
        return "fciub"
    return _ARRAYS[complex] if issubclass(scalar, np.complexfloating) else _ARRAYS[float]


def _words(hint: Any) -> str:
    hint = _plain(hint)
    if get_origin(hint) in (Union, UnionType):
        return " or ".join(_words(member) for member in get_args(hint))
    if get_origin(hint) is Literal:
        return " or ".join(repr(choice) for choice in get_args(hint))
    if get_origin(hint) is np.ndarray:
        return "an array"
    names = {float: "a number", int: "a whole number", str: "text", bool: "true or false", NoneType: "nothing"}
    return names.get(hint, getattr(hint, "__name__", str(hint)))


MOST_EVENTS = 64  # of one period; eight are looked for


def validate(result: Result) -> None:
    """Check everything that readers of a result rely on.

    Raises:
        LogError: at the first thing that is not as promised, by its dotted place.
    """
    conform(result)
    actual, assumed, controller = result.actual, result.controller.plant, result.controller
    _require((actual.n_u, actual.n_y) == (assumed.n_u, assumed.n_y), "actual", "has other inputs or outputs")
    if not has_prediction(result):
        for name in ("continuous", "measurement", "growth", "law", "statistics"):
            _require(getattr(result, name) is None, name, "is there without a prediction")
        _require(not result.attractors, "attractors", "are there without a prediction")
        _simulation(result, "simulation", result.simulation, assumed.n if has_trigger(controller) else 0)
        return
    _require(has_trigger(controller), "prediction", f"is there for a {controller.kind} controller")
    _require(result.measurement is not None, "measurement", "is missing beside a prediction")
    _plants(result)
    _simulation(result, "simulation", result.simulation, result.assumed.n)
    if (beside := result.continuous) is not None:
        _simulation(result, "continuous", beside, result.assumed.n)
        _require(result.simulation.plant == beside.plant, "continuous.plant", "is not that of the simulation")
    _measurement(result)
    _prediction(result, result.prediction)
    _experiments(result)
    _statistics(result)


def _plants(result: PredictedResult) -> None:
    assumed, design = result.assumed, result.controller.design
    mine, theirs = (design.plant.n, design.plant.n_u, design.plant.n_y), (assumed.n, assumed.n_u, assumed.n_y)
    _require(mine == theirs, "controller.design.plant", f"has the sizes {mine}, expected {theirs}")
    _finite("controller.design.k", design.k)
    _finite("controller.design.L", design.L)
    _shape("controller.hold.A_h", result.controller.hold.A_h, assumed.n, assumed.n)
    _finite("controller.hold.A_h", result.controller.hold.A_h)
    try:
        result.controller.trigger.faces(design)
    except (AnalysisError, ValueError, IndexError) as error:
        raise LogError(f"controller.trigger does not fit the design: {error}") from error


def _simulation(result: Result, name: str, simulation: Simulation, m: int) -> None:
    n, n_u, n_y = result.actual.n, result.actual.n_u, result.actual.n_y
    N = _rising(f"{name}.t", simulation.t, least=1)
    for key, width in (("x", n), ("y", n_y), ("u", n_u), ("x_o", m), ("x_h", m)):
        _shape(f"{name}.{key}", getattr(simulation, key), N, width)
    _shape(f"{name}.E", simulation.E, N)
    if simulation.applied.size:
        _shape(f"{name}.applied", simulation.applied, N, n_u)
    if simulation.pushes or simulation.pushed.size:
        _shape(f"{name}.pushed", simulation.pushed, N, len(simulation.pushes))
    if simulation.qpos.size:
        _shape(f"{name}.qpos", simulation.qpos, N, None)
    _require(simulation.qpos.ndim == 2, f"{name}.qpos", f"has shape {simulation.qpos.shape}")
    _pressure(f"{name}.pressure", simulation)
    for key, width in (("states", n), ("inputs", n_u), ("outputs", n_y), ("assumed", result.assumed.n)):
        for kind in (key, f"{key.removesuffix('s')}_units"):
            count = len(getattr(simulation.labels, kind))
            _require(count in (0, width), f"{name}.labels.{kind}", f"has {count} words for {width} columns")
    events, end = simulation.events, simulation.outcome.t
    _require(np.isfinite(end) and end >= 0, f"{name}.outcome.t", f"is {end}; expected a time")
    if (followed := simulation.setpoint) is not None:
        for key, *shape in (
            ("x_ss", result.assumed.n, len(followed.names)),
            ("u_ss", n_u, len(followed.names)),
            ("terms", None, 6),
        ):
            _shape(f"{name}.setpoint.{key}", getattr(followed, key), *shape)
    _rising(f"{name}.edges", simulation.edges, least=0)
    K = _rising(f"{name}.events.t", events.t, least=0)
    _require(K == 0 or events.t[-1] <= simulation.t[-1] * (1 + 1e-9), f"{name}.events.t", "ends after the run")
    for key, width in (("x", n), ("x_o", m), ("x_h", m), ("y_max", n_y), ("y_min", n_y)):
        _shape(f"{name}.events.{key}", getattr(events, key), K, width if K else None)


def _pressure(name: str, simulation: Simulation) -> None:
    pressure, N = simulation.pressure, len(simulation.t)
    if pressure is None:
        return
    K, G = len(pressure.t_after), len(pressure.geoms)
    _require(K in (0, len(simulation.events)), f"{name}.t_after", f"has {K} times for {len(simulation.events)} events")
    for key, *shape in (
        *(("t", N), ("centre", N, 2), ("at_rest", 2), ("load", N, G), ("load_at_rest", G)),
        *(("t_after", K), ("centre_after", K, 2), ("load_after", K, G)),
    ):
        _shape(f"{name}.{key}", getattr(pressure, key), *shape)


def _measurement(result: PredictedResult) -> None:
    measured = result.measurement
    for where, told in (("measurement", measured), ("prediction", result.prediction)):
        for key in ("outputs", "output_units"):
            count = len(getattr(told, key))
            _require(count in (0, result.actual.n_y), f"{where}.{key}", f"has {count} words")
    _shape("measurement.amplitude", measured.amplitude, result.actual.n_y)
    _require(measured.intervals.ndim == 1, "measurement.intervals", f"has shape {measured.intervals.shape}")
    _require(bool((measured.intervals > 0).all()), "measurement.intervals", "holds one that is not positive")
    if measured.p is not None:
        _require(1 <= measured.p <= MOST_EVENTS, "measurement.p", f"is {measured.p}")
    if measured.kind == "cycle":
        for key in ("p", "interval", "period"):
            _require(getattr(measured, key) is not None, f"measurement.{key}", "is missing, though there is a cycle")
        _shape("measurement.intervals", measured.intervals, measured.p)
        _require(len(result.simulation.events) >= (measured.p or 0), "measurement.p", "is more than there are events")
    for key in ("interval", "period"):
        _positive(f"measurement.{key}", getattr(measured, key))


def _prediction(result: PredictedResult, prediction: Prediction) -> None:
    size = _at_events(result)
    delayed = bool(result.simulation.delay) == bool(result.controller.delay)
    _require(delayed, "simulation.delay", "and the controller's are not one: only one of them is none")
    for key in ("delta_crit", "period", "delta_max"):
        _positive(f"prediction.{key}", getattr(prediction, key))
    for i, crossing in enumerate(prediction.crossings):
        _positive(f"prediction.crossings.{i}.delta", crossing.delta)
    if prediction.amplitude is not None:
        _shape("prediction.amplitude", prediction.amplitude, result.actual.n_y)
    if prediction.V_inv is not None:
        _shape("prediction.V_inv", prediction.V_inv, size, size)
    if prediction.multipliers is not None:
        _shape("prediction.multipliers", prediction.multipliers, None)
    if prediction.delta_crit is not None:
        missing = [key for key in ("eigenvalue", "orbit", "gamma") if getattr(prediction, key) is None]
        _require(not missing, "prediction", f"has a Δ_crit, but no {', '.join(missing)}")
    _require(not prediction.cycle or prediction.period is not None, "prediction.cycle", "is true without a period")
    if prediction.orbit is not None:
        _require(prediction.delta_crit is not None, "prediction.orbit", "is there without a Δ_crit")
        _orbit(result, "prediction.orbit", prediction.orbit)
    for i, other in enumerate(prediction.others):
        where = f"prediction.others.{i}"
        _positive(f"{where}.crossing.delta", other.crossing.delta)
        _orbit(result, f"{where}.orbit", other.orbit)
        if other.V_inv is not None:
            _shape(f"{where}.V_inv", other.V_inv, size, size)
        if other.multipliers is not None:
            _shape(f"{where}.multipliers", other.multipliers, None)


def _orbit(result: PredictedResult, where: str, orbit: Orbit) -> None:
    n, m, n_u, n_y = result.actual.n, result.assumed.n, result.actual.n_u, result.actual.n_y
    M = _rising(f"{where}.t", orbit.t, least=2, twice=1 if result.controller.delay else 0)  # the action
    _positive(f"{where}.delta", orbit.delta)
    _positive(f"{where}.period", orbit.period)
    _require(orbit.sign in (1, -1), f"{where}.sign", f"is {orbit.sign}; expected 1 or -1")
    _shape(f"{where}.x_bar", orbit.x_bar, _at_events(result))
    for key, width in (("X", n + 2 * m), ("y", n_y), ("u", n_u), ("e_hp", m)):
        _shape(f"{where}.{key}", getattr(orbit, key), M, width)
    _shape(f"{where}.E", orbit.E, M)
    for key, width in (("y", n_y), ("u", n_u), ("x", n)):
        for what in ("peak", "range"):
            _shape(f"{where}.{key}_{what}", getattr(orbit, f"{key}_{what}"), width)


def _experiments(result: PredictedResult) -> None:
    n, m = result.actual.n, result.assumed.n
    if result.growth is not None:
        points = _rising("growth.delta", result.growth.delta, least=1)
        _shape("growth.measured", result.growth.measured, points)
        _shape("growth.predicted", result.growth.predicted, points)
    if (law := result.law) is not None:
        _shape("law.q_t", law.q_t, None)
        _require(
            bool(len(law.q_t) and (law.q_t > 0).all() and np.isfinite(law.q_t).all()), "law.q_t", "is no threshold"
        )
        _shape("law.interval_error", law.interval_error, len(law.q_t))
        _shape("law.amplitude_error", law.amplitude_error, len(law.q_t))
    for i, attractor in enumerate(result.attractors):
        where = f"attractors.{i}"
        _shape(f"{where}.states", attractor.states, None, _at_events(result))
        _shape(f"{where}.x0", attractor.x0, n)
        _shape(f"{where}.x_o0", attractor.x_o0, m)
        _require(attractor.count >= 1 and 0 <= attractor.share <= 1, where, "has no sensible count or share")


def _statistics(result: PredictedResult) -> None:
    told, n_y = result.statistics, result.actual.n_y
    if told is None:
        return
    _require(0 <= told.start <= told.end, "statistics.start", f"is {told.start:g} s, the end {told.end:g} s")
    bins = len(told.counts)
    _shape("statistics.counts", told.counts, bins)
    _shape("statistics.edges", told.edges, bins + 1 if bins else 0)
    for key in ("mean", "rms"):
        found = len(getattr(told, key))
        _require(found == n_y, f"statistics.{key}", f"has {found} numbers for {n_y} outputs")
    F = _rising("statistics.spectrum.frequency", told.spectrum.frequency, least=2)
    for key in ("power", "low", "high"):
        _shape(f"statistics.spectrum.{key}", getattr(told.spectrum, key), F, n_y)


def _at_events(result: PredictedResult) -> int:
    """Length of the state that the map from event to event acts on; with a delay it includes the hold."""
    n, m = result.actual.n, result.assumed.n
    return n + 2 * m if result.controller.delay else n + m


def _rising(where: str, t: Array, least: int, twice: int = 0) -> int:
    """The number of times in ``t``, which increase from zero or later; at most ``twice`` are repeated, for jumps."""
    _require(t.ndim == 1 and len(t) >= least, where, f"has shape {t.shape}; expected at least {least} times")
    gaps = np.diff(t)
    good = np.isfinite(t).all() and (t[:1] >= 0).all() and (gaps >= 0).all() and (gaps == 0).sum() <= twice
    _require(bool(good), where, "does not rise, or holds what is no time")
    return len(t)


def _shape(where: str, values: Any, *expected: int | None) -> None:
    fits = values.ndim == len(expected) and all(
        want is None or have == want for have, want in zip(values.shape, expected, strict=False)
    )
    wanted = ", ".join("any" if want is None else str(want) for want in expected)
    _require(fits, where, f"has shape {values.shape}; expected ({wanted})")


def _finite(where: str, values: Array) -> None:
    _require(bool(np.isfinite(values).all()), where, "holds a NaN or an infinity")


def _positive(where: str, value: float | None) -> None:
    if value is not None:
        _require(bool(np.isfinite(value) and value > 0), where, f"is {value}; expected a positive number")


def _require(good: bool, where: str, otherwise: str) -> None:
    if not good:
        raise LogError(f"the archive is not that of a run: {where} {otherwise}")


_DATA: tuple[type, ...] = (
    *(LinearPlant, Push, Design, Hold, Delay, Setpoint, Controller),
    *(*RULES.collect("RULE"), ClockTrigger, Continuous, RecordedRule),
    *(Crossing, NeutralMode, OrbitFamily, Orbit, PredictedOrbit, Prediction),
    *(Events, Labels, Outcome, Pressure, Simulation, Measurement),
    *(Estimate, Spectrum, Statistics),
    *(Growth, AmplitudeLaw, Attractor, Result),
    *(Layout, Rates, Mode, Guard, Realisation, RecordedLaw),
    *(law for laws in CONTROLLERS.collect("LAWS") for law in laws),
)
_CLASSES = {cls.__name__: cls for cls in _DATA}
_FORMER = {"Family": OrbitFamily}  # as logs of before call them
_LEFT_OUT = {("Result", "scene")}  # stored as what it is for, the 3D entities

_KINDS = "fciub"  # float, complex, integers, bool

Flat = dict[str, NDArray[Any]]


def pack(result: Result) -> tuple[str, Flat]:
    """The tree as JSON text, and the arrays by their dotted place in it, flattened row by row.

    Complex arrays are stored as (re, im) pairs; dtype and shape are in the tree.

    Raises:
        LogError: if the result holds something that has no place in a log.
    """
    arrays: Flat = {}
    # of a rule, or a controller, of somebody's own a log carries the numbers, and says where the code is
    law = record_law(result.controller)
    if has_trigger(law):
        law = law.triggered_by(record_trigger(law.trigger, law.design))
    result = replace(result, controller=law)
    return json.dumps(_encode(result, "", arrays), ensure_ascii=False), arrays


def unpack(tree: str, arrays: Flat) -> Result:
    """The result from what :func:`pack` gave, every array bit for bit.

    Raises:
        LogError: if tree and arrays do not make a result of this version of icmj, or what they make does not hold
            what its dataclasses promise.
    """
    try:
        result = _decode(parts := json.loads(tree), arrays)
        # of a log of before, its run file says when what is given jumps
        if type(result) is Result and "edges" not in parts["simulation"]:
            acting = acting_on(result.actual, result.run.simulation.settings())
            drives = collect_drives(result.controller, acting, result.simulation.t)
            result = replace(result, simulation=replace(result.simulation, edges=drives["edges"]))
        # a prediction of before called a cycle predicted by the paper's condition
        if type(result) is Result and result.prediction and "others" not in parts["prediction"]:
            result = replace(result, prediction=_judged_by_orbit(result.prediction))
    except IcmjError:
        raise
    except (LookupError, TypeError, ValueError, AttributeError, ArithmeticError, MemoryError, RecursionError) as error:
        raise LogError(f"the archive is not one of this version of icmj ({one_line(error, 200)})") from error
    if type(result) is not Result:
        raise LogError("the archive holds no result")
    validate(result)
    return result


def _judged_by_orbit(prediction: Prediction) -> Prediction:
    """The prediction of a log of before: a cycle is predicted where its orbit attracts."""
    cycle = prediction.verdict == "attracting" and prediction.orbit is not None
    return replace(prediction, cycle=cycle, period=prediction.orbit.period if cycle and prediction.orbit else None)


def digest(tree: str, arrays: Flat) -> str:
    """SHA-256 over the tree and every array with its name, as hexadecimal text."""
    total = hashlib.sha256(tree.encode())
    for key in sorted(arrays):
        total.update(f"\0{key}\0".encode())
        total.update(np.ascontiguousarray(arrays[key]).tobytes())
    return total.hexdigest()


def _encode(value: Any, key: str, arrays: Flat) -> Any:
    if isinstance(value, np.ndarray):
        if value.dtype.kind not in _KINDS:
            raise LogError(f"{key}: an array of {value.dtype} has no place in a log")
        flat = np.ascontiguousarray(value).reshape(-1)
        if value.dtype.kind == "c":
            flat = flat.view(flat.real.dtype)
        elif value.dtype.kind == "b":
            flat = flat.view(np.uint8)
        arrays[key] = flat
        return {"@array": key, "dtype": value.dtype.str, "shape": list(value.shape)}
    if isinstance(value, np.generic):
        value = value.item()
    if value is None or isinstance(value, bool | int | str):
        return value
    if isinstance(value, float):
        return float(value)
    if isinstance(value, complex):
        return {"@complex": [value.real, value.imag]}
    if isinstance(value, RunFile):
        told: dict[str, Any] = {"@run": value.text, "path": value.path.as_posix()}
        if value.changes:
            told["changes"] = dict(value.changes)
        if (carried := keep_files(value)).files:
            told["kept"] = {"place": carried.place, "assumed": carried.assumed, "actual": carried.actual}
            told["files"] = [
                [name, _encode(np.frombuffer(content, np.uint8), f"{key}.files.{i}", arrays)]
                for i, (name, content) in enumerate(carried.files.items())
            ]
        return told
    if is_dataclass(value) and type(value).__name__ in _CLASSES:
        name = type(value).__name__
        kept = [f.name for f in fields(value) if (name, f.name) not in _LEFT_OUT]
        return {"@": name} | {f: _encode(getattr(value, f), f"{key}.{f}".lstrip("."), arrays) for f in kept}
    if isinstance(value, tuple | list):
        items = [_encode(item, f"{key}.{i}", arrays) for i, item in enumerate(value)]
        return {"@tuple": items} if isinstance(value, tuple) else items
    if isinstance(value, Mapping) and not any(str(k).startswith("@") for k in value):
        return {str(k): _encode(v, f"{key}.{k}", arrays) for k, v in value.items()}
    raise LogError(f"{key}: a {type(value).__name__} has no place in a log")


def _decode(value: Any, arrays: Flat) -> Any:
    if isinstance(value, list):
        return [_decode(item, arrays) for item in value]
    if not isinstance(value, dict):
        return value
    if "@array" in value:
        dtype = np.dtype(value["dtype"])
        if dtype.kind not in _KINDS:
            raise ValueError(f"array of {dtype}")
        return np.array(arrays[value["@array"]]).view(dtype).reshape(value["shape"])
    if "@complex" in value:
        return complex(*value["@complex"])
    if "@tuple" in value:
        return tuple(_decode(item, arrays) for item in value["@tuple"])
    if "@run" in value:
        run = parse_run(value["@run"], value["path"]).recall(value.get("changes", {}))
        files = {str(name): _decode(content, arrays).tobytes() for name, content in value.get("files", ())}
        told = {key: str(text) for key, text in value.get("kept", {}).items()}
        return run.keeping(BundledFiles(files=files, **told)) if files else run
    parts = {k: _decode(v, arrays) for k, v in value.items() if k != "@"}
    if value.get("@") == "Tried":  # a run without a prediction, as it was called before
        return Result(controller=parts.pop("law"), prediction=None, **parts)
    return (_FORMER | _CLASSES)[value["@"]](**parts) if "@" in value else parts


def keep_files(run: RunFile) -> BundledFiles:
    """The files of a run file: as they are on disk, else as the log had them that it was read from; or none."""
    home = run.path.absolute()
    try:
        paths = [path.absolute() for path in (run.assumed_path, run.actual_path)]
        files = dict.fromkeys(path.resolve() for path in plant_files(run))
        if not files or sum(path.stat().st_size for path in files) > MOST_BYTES:
            return run.kept
        root = Path(os.path.commonpath([home.parent, *(path.parent for path in files)]))
        contents = {path.relative_to(root).as_posix(): read_bytes(path, MOST_BYTES) for path in files}
    except (OSError, ValueError, IcmjError):
        return run.kept
    named = (run.assumed.model or run.assumed.matrices, run.actual.model or run.actual.matrices)
    absolute = [
        # what does not lie beside the run file: an absolute path, or a shipped model by its name
        path.relative_to(root).as_posix() if name and (Path(name).is_absolute() or path != home.parent / name) else ""
        for name, path in zip(named, paths, strict=True)
    ]
    return BundledFiles(home.relative_to(root).as_posix(), contents, *absolute)
